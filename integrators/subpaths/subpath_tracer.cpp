#include "integrators/subpaths/subpath_tracer.h"

#include "integrators/path/wave_stages.h"

namespace nephroid {

SubpathTracer::SubpathTracer(const RenderContext& context)
    : seeds(max_slots_per_block),
      indices(max_slots_per_block),
      paths(max_slots_per_block),
      scattered_from(max_slots_per_block),
      path_sums(max_slots_per_block),
      hits(max_slots_per_block),
      vertices(max_slots_per_block),
      sums(max_slots_per_block),
      context_(context),
      cosine_(max_slots_per_block),
      reverse_pdf_(max_slots_per_block) {}

void SubpathTracer::trace(bool coherent) {
    ray_count_ += paths.rays.count;
    context_.accelerator.intersect(paths.rays, coherent, hits);
}

void SubpathTracer::find_vertices(bool wants_misses) {
    list_hits(context_.surfaces, paths, hits, wants_misses, vertices, special);
    interpolate_plain_vertices(context_.surfaces, paths, hits, vertices);
}

NEPHROID_FLATTEN void SubpathTracer::carry_sums() {
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const auto active = first_lanes(vertices.count - k);
        const UintV path(&vertices.path[k], stdx::vector_aligned);
        const FloatV cosine = dot(vertices.geometric_normal.load(k), vertices.wo.load(k));
        const FloatV distance = gather(hits.t.data(), path, active);
        sums.store(k, mis_arrive(path_sums.gather(path, active), distance, cosine));
    }
}

template <Transport transport>
NEPHROID_FLATTEN void SubpathTracer::scatter(const Scattering& how) {
    const FloatV zero(0.0F), one(1.0F);
    const FloatV infinity(std::numeric_limits<float>::infinity());
    RayBatch& rays = paths.rays;
    rays.count = 0;
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const UintV slot(&vertices.slot[k], stdx::vector_aligned);
        const auto active = first_lanes(vertices.count - k);
        const UintV seed = gather(seeds.data(), slot, active);
        const UintV index = gather(indices.data(), slot, active);
        const auto [u_lobe, u_roulette] = sample_2d(context_.sampler, seed, index, how.lobe_dimension);
        const auto [u, v] = sample_2d(context_.sampler, seed, index, how.direction_dimension);
        const Frame<FloatV> frame = make_frame(vertices.shading_normal.load(k));
        const Triple<FloatV> normal = vertices.geometric_normal.load(k);
        const Triple<FloatV> local_wo = frame.to_local(vertices.wo.load(k));
        const BsdfParameters<FloatV> bsdf = vertices.bsdf(k);
        const BsdfSample<FloatV> sample = sample_bsdf(bsdf, local_wo, u_lobe, u, v);
        const Triple<FloatV> wi = frame.to_world(sample.wi);
        const FloatV cosine = dot(normal, wi);
        Triple<FloatV> weight = vertices.throughput.load(k) * sample.weight;
        if constexpr (transport == Transport::importance) {
            // Light carries the adjoint BSDF: f |wi.Ns| |wo.Ng| / |wi.Ng| for light from wi to wo (Veach 1997, Sec.
            // 5.3); the sample's weight has |wo.Ns| in the place of all three.
            const FloatV back = dot(normal, vertices.wo.load(k));
            weight = weight * (local_wo.z * cosine / maximum(sample.wi.z * back, FloatV(mis_floor)));
        }
        const FloatV scale = one / gather(how.reference.data(), slot, active);
        FloatV survival = one;
        if (how.bounce + 1 > roulette_start) {
            survival = minimum(one, maximum(FloatV(least_survival), max_component(weight) * scale));
            weight = weight * (one / survival);
        }
        const auto lives = active && (u_roulette < survival) && (max_component(weight) > zero) && (cosine > zero);
        append_rays(rays, offset_ray_origin(vertices.position.load(k), vertices.error.load(k), normal, wi), wi,
                    infinity, lives);
        paths.throughput.append(rays.count, weight, lives);
        path_sums.append(rays.count, sums.load(k), lives);
        compress_store(&paths.pdf[rays.count], select(sample.delta, zero, sample.pdf), lives);
        compress_store(&reverse_pdf_[rays.count], evaluate_bsdf(bsdf, sample.wi, local_wo).pdf, lives);
        compress_store(&cosine_[rays.count], cosine, lives);
        compress_store(&scattered_from[rays.count], lane_numbers() + UintV(static_cast<uint32_t>(k)), lives);
        compress_store(&paths.slot[rays.count], slot, lives);
        compress_store(&paths.flags[rays.count], UintV(&vertices.flags[k], stdx::vector_aligned), lives);
        rays.count += count_of(lives);
    }
}

NEPHROID_FLATTEN void SubpathTracer::scatter_sums(bool connections, const GuideBatch* other_side) {
    const FloatV zero(0.0F);
    for (size_t i = 0; i < paths.rays.count; i += simd_width) {
        const auto load = [i](const PathArray<float>& values) { return FloatV(&values[i], stdx::vector_aligned); };
        FloatV reverse_pdf = load(reverse_pdf_);
        if (other_side != nullptr) {
            const auto active = first_lanes(paths.rays.count - i);
            const UintV vertex(&scattered_from[i], stdx::vector_aligned);
            reverse_pdf = mixed_pdf(gather(other_side->fraction.data(), vertex, active), reverse_pdf,
                                    gather(other_side->pdf.data(), vertex, active));
        }
        const FloatV pdf = load(paths.pdf);
        MisSums<FloatV> after = mis_scatter(path_sums.load(i), load(cosine_), pdf, reverse_pdf, pdf == zero);
        if (!connections) after.connect = zero;
        path_sums.store(i, after);
    }
}

template void SubpathTracer::scatter<Transport::radiance>(const Scattering&);
template void SubpathTracer::scatter<Transport::importance>(const Scattering&);

}  // namespace nephroid

#include "integrators/subpaths/subpath_tracer.h"

namespace nephroid {

SubpathTracer::SubpathTracer(const RenderContext& context)
    : seeds(max_slots_per_block),
      indices(max_slots_per_block),
      paths(max_slots_per_block),
      path_sums(max_slots_per_block),
      hits(max_slots_per_block),
      vertices(max_slots_per_block),
      sums(max_slots_per_block),
      context_(context) {}

void SubpathTracer::trace(bool coherent) {
    ray_count_ += paths.rays.count;
    context_.accelerator.intersect(paths.rays, coherent, hits);
}

void SubpathTracer::find_plain_vertices(bool wants_misses) {
    const Surfaces& surfaces = context_.surfaces;
    const auto object_count = static_cast<uint32_t>(surfaces.object_count());
    size_t vertex_count = 0;
    special.clear();
    for (size_t i = 0; i < paths.rays.count; ++i) {
        const uint32_t object = hits.object[i];
        const bool plain = object < object_count && surfaces.is_plain(object);
        vertices.path[vertex_count] = static_cast<uint32_t>(i);
        vertex_count += plain ? 1 : 0;
        if (!plain && (object != no_hit || wants_misses)) special.push_back(static_cast<uint32_t>(i));
    }
    vertices.count = vertex_count;
    interpolate_plain_vertices();
}

NEPHROID_FLATTEN void SubpathTracer::interpolate_plain_vertices() {
    const RayBatch& rays = paths.rays;
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const auto active = first_lanes(vertices.count - k);
        const UintV path(&vertices.path[k], stdx::vector_aligned);
        TriangleCorners<FloatV> corners;
        BsdfParameters<FloatV> bsdf;
        context_.surfaces.load_plain(gather(hits.object.data(), path, active),
                                     gather(hits.primitive.data(), path, active), active, corners, bsdf);
        const Triple<FloatV> wo{-gather(rays.direction_x.data(), path, active),
                                -gather(rays.direction_y.data(), path, active),
                                -gather(rays.direction_z.data(), path, active)};
        const SurfaceGeometry<FloatV> g =
            interpolate_surface(corners, gather(hits.u.data(), path, active), gather(hits.v.data(), path, active), wo);
        vertices.position.store(k, g.position);
        vertices.error.store(k, g.error);
        vertices.geometric_normal.store(k, g.geometric_normal);
        vertices.shading_normal.store(k, face_forward(g.shading_normal, g.geometric_normal));
        vertices.wo.store(k, wo);
        vertices.throughput.store(k, paths.throughput.gather(path, active));
        vertices.base.store(k, bsdf.base);
        vertices.coat_f0.store(k, bsdf.coat_f0);
        bsdf.coat_f90.copy_to(&vertices.coat_f90[k], stdx::vector_aligned);
        bsdf.metallic.copy_to(&vertices.metallic[k], stdx::vector_aligned);
        bsdf.alpha.copy_to(&vertices.alpha[k], stdx::vector_aligned);
        gather(paths.slot.data(), path, active).copy_to(&vertices.slot[k], stdx::vector_aligned);
    }
}

void SubpathTracer::push_vertex(size_t path, const SurfaceInteraction& surface) {
    const size_t k = vertices.count++;
    vertices.path[k] = static_cast<uint32_t>(path);
    vertices.position.set(k, surface.position);
    vertices.error.set(k, surface.error);
    vertices.geometric_normal.set(k, surface.geometric_normal);
    vertices.shading_normal.set(k, surface.shading_normal);
    vertices.wo.set(k, -paths.rays.direction(path));
    vertices.throughput.set(k, paths.throughput.get(path));
    vertices.set_bsdf(k, surface.bsdf);
    vertices.slot[k] = paths.slot[path];
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
        if (how.bounce + 1 > bdpt_roulette_start) {
            survival = minimum(one, maximum(FloatV(bdpt_least_survival), max_component(weight) * scale));
            weight = weight * (one / survival);
        }
        const auto lives = active && (u_roulette < survival) && (max_component(weight) > zero) && (cosine > zero);
        FloatV reverse_pdf = evaluate_bsdf(bsdf, sample.wi, local_wo).pdf;
        if (how.other_side != nullptr) reverse_pdf = mixed_pdf(*how.other_side, k, reverse_pdf, how.other_side->pdf);
        MisSums<FloatV> after = mis_scatter(sums.load(k), cosine, sample.pdf, reverse_pdf, sample.delta);
        if (!how.connections) after.connect = zero;
        append_rays(rays, offset_ray_origin(vertices.position.load(k), vertices.error.load(k), normal, wi), wi,
                    infinity, lives);
        paths.throughput.append(rays.count, weight, lives);
        path_sums.append(rays.count, after, lives);
        compress_store(&paths.slot[rays.count], slot, lives);
        compress_store(&paths.flags[rays.count], UintV(&vertices.flags[k], stdx::vector_aligned), lives);
        rays.count += count_of(lives);
    }
}

template void SubpathTracer::scatter<Transport::radiance>(const Scattering&);
template void SubpathTracer::scatter<Transport::importance>(const Scattering&);

}  // namespace nephroid

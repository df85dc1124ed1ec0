#include "integrators/bdpt/vertex_connections.h"

#include <cstddef>

namespace nephroid {

namespace {

/// Reads members of a vector of light vertices.
class LightVertexReader {
  public:
    LightVertexReader(const LightVertices& light, const UintV& index, const FloatV::mask_type& active)
        : base_(reinterpret_cast<const float*>(light.vertices.data())),
          index_(index * UintV(uint32_t{sizeof(LightVertex) / sizeof(float)})),
          active_(active) {}

    FloatV number(size_t offset) const { return gather(base_ + offset / sizeof(float), index_, active_); }
    UintV bits(size_t offset) const {
        return gather(reinterpret_cast<const uint32_t*>(base_) + offset / sizeof(float), index_, active_);
    }
    Triple<FloatV> triple(size_t offset) const {
        return {number(offset), number(offset + sizeof(float)), number(offset + 2 * sizeof(float))};
    }
    BsdfParameters<FloatV> bsdf() const {
        return {triple(offsetof(LightVertex, base)), triple(offsetof(LightVertex, coat_f0)),
                number(offsetof(LightVertex, coat_f90)), number(offsetof(LightVertex, metallic)),
                number(offsetof(LightVertex, alpha))};
    }
    MisSums<FloatV> sums() const {
        return {number(offsetof(LightVertex, mis_connect)), number(offsetof(LightVertex, mis_chain))};
    }

  private:
    const float* base_;
    UintV index_;
    FloatV::mask_type active_;
};

BsdfParameters<FloatV> gather_bsdf(const VertexWave& v, const UintV& index, const FloatV::mask_type& active) {
    return {v.base.gather(index, active), v.coat_f0.gather(index, active), gather(v.coat_f90.data(), index, active),
            gather(v.metallic.data(), index, active), gather(v.alpha.data(), index, active)};
}

}  // namespace

VertexConnections::VertexConnections(const LightTracing& context)
    : context_(context),
      camera_vertex_(max_slots_per_block),
      light_vertex_(max_slots_per_block),
      shadows_(max_slots_per_block) {}

void VertexConnections::connect(uint32_t bounce, const VertexWave& vertices, const MisArray& sums,
                                const LightVertices& light, SampleBuffer& samples) {
    pair_count_ = 0;
    for (size_t k = 0; k < vertices.count; ++k) {
        if (is_narrow_metal(vertices.metallic[k], vertices.alpha[k], delta_alpha)) continue;
        for (uint32_t j = light.last[vertices.slot[k]]; j != no_vertex; j = light.vertices[j].previous) {
            // bounce + 1 scatterings of the camera path with this vertex, and those of the light path.
            if (bounce + 1 + light.vertices[j].scattering > context_.render.max_depth) continue;
            camera_vertex_[pair_count_] = static_cast<uint32_t>(k);
            light_vertex_[pair_count_] = j;
            if (++pair_count_ == max_slots_per_block) flush(vertices, sums, light, samples);
        }
    }
    flush(vertices, sums, light, samples);
}

// Keeps the pairs whose vertices face each other: half of all, and the others need no BSDF.
NEPHROID_FLATTEN void VertexConnections::find_facing(const VertexWave& vertices, const LightVertices& light) {
    size_t kept = 0;
    for (size_t i = 0; i < pair_count_; i += simd_width) {
        const auto active = first_lanes(pair_count_ - i);
        const UintV k(&camera_vertex_[i], stdx::vector_aligned);
        const UintV j(&light_vertex_[i], stdx::vector_aligned);
        const LightVertexReader reader(light, j, active);
        const Triple<FloatV> d = reader.triple(offsetof(LightVertex, position)) - vertices.position.gather(k, active);
        const auto facing = active && (dot(d, vertices.geometric_normal.gather(k, active)) > FloatV(0.0F)) &&
                            (dot(d, reader.triple(offsetof(LightVertex, geometric_normal))) < FloatV(0.0F));
        compress_store(&camera_vertex_[kept], k, facing);
        compress_store(&light_vertex_[kept], j, facing);
        kept += count_of(facing);
    }
    pair_count_ = kept;
}

NEPHROID_FLATTEN void VertexConnections::weigh(const VertexWave& vertices, const MisArray& sums,
                                               const LightVertices& light) {
    const FloatV zero(0.0F), one(1.0F), floor(mis_floor);
    RayBatch& rays = shadows_.rays;
    rays.count = 0;
    for (size_t i = 0; i < pair_count_; i += simd_width) {
        const auto active = first_lanes(pair_count_ - i);
        const UintV k(&camera_vertex_[i], stdx::vector_aligned);
        const LightVertexReader y(light, UintV(&light_vertex_[i], stdx::vector_aligned), active);
        const Triple<FloatV> target = y.triple(offsetof(LightVertex, position));
        const Triple<FloatV> position = vertices.position.gather(k, active);
        const Triple<FloatV> normal = vertices.geometric_normal.gather(k, active);
        const Triple<FloatV> light_normal = y.triple(offsetof(LightVertex, geometric_normal));
        const Triple<FloatV> d = target - position;
        const FloatV inverse2 = one / maximum(dot(d, d), FloatV(1e-30F));
        const Triple<FloatV> wi = d * square_root(inverse2);
        const FloatV cosine = dot(normal, wi);
        const FloatV light_cosine = -dot(light_normal, wi);

        const Frame<FloatV> frame = make_frame(vertices.shading_normal.gather(k, active));
        const Triple<FloatV> local_wo = frame.to_local(vertices.wo.gather(k, active));
        const Triple<FloatV> local_wi = frame.to_local(wi);
        const BsdfParameters<FloatV> bsdf = gather_bsdf(vertices, k, active);
        const BsdfEvaluation<FloatV> at_camera = evaluate_bsdf(bsdf, local_wo, local_wi);
        const FloatV camera_reverse_pdf = evaluate_bsdf(bsdf, local_wi, local_wo).pdf;

        // The light vertex, seen from the camera vertex: light comes from `back`. Adjoint BSDF as in connect_to_camera.
        const Triple<FloatV> back = y.triple(offsetof(LightVertex, wo));
        const Frame<FloatV> light_frame = make_frame(y.triple(offsetof(LightVertex, shading_normal)));
        const Triple<FloatV> local_back = light_frame.to_local(back);
        const Triple<FloatV> local_out = light_frame.to_local(-wi);
        const BsdfParameters<FloatV> light_bsdf = y.bsdf();
        const BsdfEvaluation<FloatV> at_light = evaluate_bsdf(light_bsdf, local_out, local_back);
        const FloatV light_pdf = evaluate_bsdf(light_bsdf, local_back, local_out).pdf;

        const FloatV others = mis_others(sums.gather(k, active), light_pdf * cosine * inverse2, camera_reverse_pdf) +
                              mis_others(y.sums(), at_camera.pdf * light_cosine * inverse2, at_light.pdf);
        const FloatV geometry = light_cosine * inverse2 / maximum(dot(light_normal, back), floor);
        const Triple<FloatV> contribution = vertices.throughput.gather(k, active) *
                                            y.triple(offsetof(LightVertex, throughput)) * at_camera.value *
                                            at_light.value * (geometry / (one + others));
        const auto lit = active && !(contribution.x == zero && contribution.y == zero && contribution.z == zero);

        const Triple<FloatV> origin = offset_ray_origin(position, vertices.error.gather(k, active), normal, wi);
        const Triple<FloatV> end = offset_ray_origin(target, y.triple(offsetof(LightVertex, error)), light_normal, -wi);
        append_rays(rays, origin, end - origin, FloatV(segment_end), lit);
        shadows_.contribution.append(rays.count, contribution, lit);
        compress_store(&shadows_.slot[rays.count], gather(vertices.slot.data(), k, active), lit);
        // A caustic before the connection, or casters up to it with a receiver in the camera path.
        const UintV light_flags = y.bits(offsetof(LightVertex, flags));
        const UintV camera_flags = gather(vertices.flags.data(), k, active);
        static_assert(receiver_seen == 1 && by_casters_only == 2 && is_caustic == 4);
        const UintV caustic = (((light_flags >> 1) & camera_flags) | (light_flags >> 2)) & UintV(1U);
        compress_store(&shadows_.caustic[rays.count], caustic, lit);
        rays.count += count_of(lit);
    }
}

void VertexConnections::flush(const VertexWave& vertices, const MisArray& sums, const LightVertices& light,
                              SampleBuffer& samples) {
    if (pair_count_ == 0) return;
    find_facing(vertices, light);
    weigh(vertices, sums, light);
    pair_count_ = 0;
    ray_count_ += shadows_.rays.count;
    context_.render.accelerator.occluded(shadows_.rays, false, shadows_.occluded);
    add_unoccluded(context_.render.aovs, shadows_, samples);
}

}  // namespace nephroid

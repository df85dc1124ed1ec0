// The state of a wave of paths, as structures of arrays: a stage of the path tracer reads and writes whole vectors.
#pragma once

#include <algorithm>

#include "accel/ray_batch.h"
#include "accel/wave_array.h"
#include "core/bsdf.h"
#include "core/film.h"
#include "core/rounding.h"
#include "guiding/directional_guide.h"

namespace nephroid {

/// Bits of PathWave::flags.
enum PathFlag : uint32_t {
    receiver_seen = 1,    ///< Some vertex so far was not a caster.
    on_caster_chain = 2,  ///< receiver_seen, and every vertex since the last receiver (at least one) is a caster.
};

/// Paths that are about to be traced.
struct PathWave {
    explicit PathWave(size_t capacity)
        : rays(capacity), throughput(capacity), pdf(capacity), slot(capacity), flags(capacity) {}
    RayBatch rays;
    TripleArray throughput;
    PathArray<float> pdf;      ///< Solid-angle density of the ray's direction; 0: delta or camera, no MIS.
    PathArray<uint32_t> slot;  ///< Index into the SampleBuffer.
    PathArray<uint32_t> flags;
};

/// Surface points that paths have reached and will scatter from.
struct VertexWave {
    explicit VertexWave(size_t capacity)
        : path(capacity),
          position(capacity),
          error(capacity),
          geometric_normal(capacity),
          shading_normal(capacity),
          wo(capacity),
          throughput(capacity),
          base(capacity),
          coat_f0(capacity),
          coat_f90(capacity),
          metallic(capacity),
          alpha(capacity),
          slot(capacity),
          flags(capacity) {}
    size_t count = 0;
    PathArray<uint32_t> path;  ///< Index of the path in the PathWave it came from.
    TripleArray position, error, geometric_normal, shading_normal, wo, throughput;
    TripleArray base, coat_f0;
    PathArray<float> coat_f90, metallic, alpha;
    PathArray<uint32_t> slot, flags;

    void set_bsdf(size_t i, const BsdfParameters<float>& p) {
        base.set(i, to_vec3(p.base));
        coat_f0.set(i, to_vec3(p.coat_f0));
        coat_f90[i] = p.coat_f90;
        metallic[i] = p.metallic;
        alpha[i] = p.alpha;
    }
    BsdfParameters<FloatV> bsdf(size_t i) const {
        return {base.load(i), coat_f0.load(i), FloatV(&coat_f90[i], stdx::vector_aligned),
                FloatV(&metallic[i], stdx::vector_aligned), FloatV(&alpha[i], stdx::vector_aligned)};
    }
};

/// The vertices as camera paths that come from `wo` meet them, with directions to lights.
inline GuidePoints guide_points(const VertexWave& v, const TripleArray& wo, const TripleArray& light_direction) {
    return {v.position, v.geometric_normal, light_direction, wo,         v.shading_normal,
            v.base,     v.coat_f0,          v.coat_f90,      v.metallic, v.alpha};
}

/// Directions towards lights from the vertices of a VertexWave, then the light they would bring.
struct LightWave {
    explicit LightWave(size_t capacity)
        : wi(capacity),
          target(capacity),
          radiance(capacity),
          pdf(capacity),
          bsdf_competes(capacity),
          infinite(capacity),
          caustic(capacity) {}
    TripleArray wi, target;
    TripleArray radiance;  ///< Arriving radiance (delta: irradiance); then the contribution to the sample.
    PathArray<float> pdf;
    PathArray<float> bsdf_competes;  ///< 1: BSDF sampling can hit this light too (MIS); 0: delta light.
    PathArray<float> infinite;       ///< 1: the shadow ray has no end.
    PathArray<uint32_t> caustic;     ///< What arrives is a caustic.
};

/// Shadow rays and what they carry.
struct ShadowWave {
    explicit ShadowWave(size_t capacity)
        : rays(capacity), contribution(capacity), slot(capacity), caustic(capacity), occluded(capacity) {}
    RayBatch rays;
    TripleArray contribution;
    PathArray<uint32_t> slot, caustic, occluded;
};

/// Directions of the vertices of a VertexWave where a guide has a say.
struct GuidedWave {
    explicit GuidedWave(size_t capacity) : batch(capacity), delta(capacity), delta_weight(capacity) {}
    GuideBatch batch;
    PathArray<float> delta;    ///< 1: the BSDF chose its mirror direction, which has no density.
    TripleArray delta_weight;  ///< BsdfSample::weight of it.
};

/// Density of the directions that a guide chooses with its fraction and the BSDF otherwise.
inline FloatV mixed_pdf(const FloatV& fraction, const FloatV& bsdf_pdf, const FloatV& guide_pdf) {
    const FloatV zero(0.0F);
    return (FloatV(1.0F) - fraction) * bsdf_pdf + select(fraction > zero, fraction * guide_pdf, zero);
}
/// The same at vertices k and following.
inline FloatV mixed_pdf(const GuideBatch& batch, size_t k, const FloatV& bsdf_pdf, const PathArray<float>& guide_pdf) {
    return mixed_pdf(FloatV(&batch.fraction[k], stdx::vector_aligned), bsdf_pdf,
                     FloatV(&guide_pdf[k], stdx::vector_aligned));
}

/// Shadow rays end this far (relative) before their target: two roundings of the segment's length.
inline constexpr float segment_end = 1.0F - 4.0F * rounding_bound(1);

/// Writes the lanes of `kept` behind the batch's rays, without counting them yet.
inline void append_rays(RayBatch& rays, const Triple<FloatV>& origin, const Triple<FloatV>& direction,
                        const FloatV& t_max, const FloatV::mask_type& kept) {
    compress_store(&rays.origin_x[rays.count], origin.x, kept);
    compress_store(&rays.origin_y[rays.count], origin.y, kept);
    compress_store(&rays.origin_z[rays.count], origin.z, kept);
    compress_store(&rays.direction_x[rays.count], direction.x, kept);
    compress_store(&rays.direction_y[rays.count], direction.y, kept);
    compress_store(&rays.direction_z[rays.count], direction.z, kept);
    compress_store(&rays.t_max[rays.count], t_max, kept);
}

/// Makes room for a block: the layers that samples are added to.
inline void clear_samples(SampleBuffer& samples, const AovSelection& aovs, size_t slots) {
    const auto clear_layer = [slots](AlignedArray<float>(&layer)[3]) {
        for (auto& channel : layer) std::fill_n(channel.data(), slots, 0.0F);
    };
    clear_layer(samples.radiance);
    if (aovs.caustic) clear_layer(samples.caustic);
    if (aovs.albedo || aovs.normal || aovs.depth) {
        clear_layer(samples.albedo);
        clear_layer(samples.normal);
        std::fill_n(samples.depth.data(), slots, 0.0F);
    }
}

/// Adds the contributions of the shadow rays that arrive (ShadowWave::occluded) to their samples.
inline void add_unoccluded(const AovSelection& aovs, const ShadowWave& shadows, SampleBuffer& samples) {
    for (size_t i = 0; i < shadows.rays.count; ++i) {
        if (shadows.occluded[i] != 0) continue;
        const size_t slot = shadows.slot[i];
        const Rgb contribution = shadows.contribution.get(i);
        for (int c = 0; c < 3; ++c) {
            samples.radiance[c][slot] += contribution[c];
            if (aovs.caustic && shadows.caustic[i] != 0) samples.caustic[c][slot] += contribution[c];
        }
    }
}

}  // namespace nephroid

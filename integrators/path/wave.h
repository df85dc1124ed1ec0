// The state of a wave of paths, as structures of arrays: a stage of the path tracer reads and writes whole vectors.
#pragma once

#include "accel/ray_batch.h"
#include "core/bsdf.h"
#include "core/film.h"
#include "core/simd.h"

namespace nephroid {

/// Three arrays: a vector or colour per path.
struct TripleArray {
    explicit TripleArray(size_t capacity) : x(padded_to_packets(capacity)), y(x.size()), z(x.size()) {}
    AlignedArray<float> x, y, z;

    Triple<FloatV> load(size_t i) const {
        return {FloatV(&x[i], stdx::vector_aligned), FloatV(&y[i], stdx::vector_aligned),
                FloatV(&z[i], stdx::vector_aligned)};
    }
    void store(size_t i, const Triple<FloatV>& v) {
        v.x.copy_to(&x[i], stdx::vector_aligned);
        v.y.copy_to(&y[i], stdx::vector_aligned);
        v.z.copy_to(&z[i], stdx::vector_aligned);
    }
    Triple<FloatV> gather(const UintV& index, const FloatV::mask_type& active) const {
        return {nephroid::gather(x.data(), index, active), nephroid::gather(y.data(), index, active),
                nephroid::gather(z.data(), index, active)};
    }
    /// Appends the lanes of `kept` at position i (compress_store).
    void append(size_t i, const Triple<FloatV>& v, const FloatV::mask_type& kept) {
        compress_store(&x[i], v.x, kept);
        compress_store(&y[i], v.y, kept);
        compress_store(&z[i], v.z, kept);
    }
    Vec3 get(size_t i) const { return {x[i], y[i], z[i]}; }
    void set(size_t i, const Vec3& v) {
        x[i] = v.x;
        y[i] = v.y;
        z[i] = v.z;
    }
};

/// Bits of PathWave::flags.
enum PathFlag : uint32_t {
    receiver_seen = 1,    ///< Some vertex so far was not a caster.
    on_caster_chain = 2,  ///< receiver_seen, and every vertex since the last receiver (at least one) is a caster.
};

/// Array of a value per path.
template <class T>
struct PathArray : AlignedArray<T> {
    explicit PathArray(size_t capacity) : AlignedArray<T>(padded_to_packets(capacity)) {}
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

}  // namespace nephroid

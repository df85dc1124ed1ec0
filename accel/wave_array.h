// Values of a wave of paths or rays as structures of arrays, padded so that whole vectors can be read and appended.
#pragma once

#include "accel/ray_batch.h"
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

/// Array of a value per path.
template <class T>
struct PathArray : AlignedArray<T> {
    explicit PathArray(size_t capacity) : AlignedArray<T>(padded_to_packets(capacity)) {}
};

}  // namespace nephroid

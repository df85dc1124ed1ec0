// Rays and hits as structures of arrays, so that 16 at a time go to Embree without being rearranged.
#pragma once

#include <cstdint>
#include <limits>

#include "core/aligned_array.h"
#include "core/vec.h"

namespace nephroid {

/// Widest packet that Embree traces at once; batches are padded to a multiple of it.
inline constexpr size_t packet_width = 16;

/// Capacity for n entries that are read in packets and appended to in whole vectors.
inline constexpr size_t padded_to_packets(size_t n) {
    return (n + packet_width - 1) / packet_width * packet_width + packet_width;
}
static_assert(simd_width <= packet_width);

/// `count` rays; the arrays hold padded_to_packets(capacity) entries. Directions need not be unit for shadow rays:
/// a segment from origin to origin + direction has t_max just below 1.
struct RayBatch {
    explicit RayBatch(size_t capacity)
        : origin_x(padded_to_packets(capacity)),
          origin_y(origin_x.size()),
          origin_z(origin_x.size()),
          direction_x(origin_x.size()),
          direction_y(origin_x.size()),
          direction_z(origin_x.size()),
          t_max(origin_x.size()) {}

    AlignedArray<float> origin_x, origin_y, origin_z;
    AlignedArray<float> direction_x, direction_y, direction_z;
    AlignedArray<float> t_max;  ///< In units of the direction's length; infinity: no end.
    size_t count = 0;

    void set(size_t i, const Vec3& origin, const Vec3& direction) {
        origin_x[i] = origin.x;
        origin_y[i] = origin.y;
        origin_z[i] = origin.z;
        direction_x[i] = direction.x;
        direction_y[i] = direction.y;
        direction_z[i] = direction.z;
    }
    void push(const Vec3& origin, const Vec3& direction, float end = std::numeric_limits<float>::infinity()) {
        set(count, origin, direction);
        t_max[count] = end;
        ++count;
    }
    Vec3 origin(size_t i) const { return {origin_x[i], origin_y[i], origin_z[i]}; }
    Vec3 direction(size_t i) const { return {direction_x[i], direction_y[i], direction_z[i]}; }
};

/// What each ray of a batch hit.
struct HitBatch {
    explicit HitBatch(size_t capacity)
        : object(padded_to_packets(capacity)),
          primitive(object.size()),
          u(object.size()),
          v(object.size()),
          t(object.size()) {}

    AlignedArray<uint32_t> object;     ///< Index into Scene::objects; miss; or objects.size() + sphere light index.
    AlignedArray<uint32_t> primitive;  ///< Triangle of the object's mesh.
    AlignedArray<float> u, v;          ///< Barycentric weights of vertices 1 and 2.
    AlignedArray<float> t;
};

}  // namespace nephroid

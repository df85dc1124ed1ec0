// Bounds of sixteen items side by side, so that one item of a path cut is tested against all of them at once.
//
// Positions are bounded by spheres and not by boxes: the direction from one sphere to another is a cone at the price of
// a reciprocal square root, and a patch of surface is as wide as its diagonal in most directions anyway
// (docs/pathcut.md has the comparison).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/simd.h"

namespace nephroid {

/// Items per block, and children per node, whatever the width of the machine's vectors.
inline constexpr size_t block_size = 16;
static_assert(block_size % simd_width == 0);

/// A sphere that holds a set of points; one point if the radius is zero.
template <class F>
struct PointBound {
    Triple<F> centre;  ///< World space, metres.
    F radius;          ///< Metres.
};

/// A piece of reflector: where it is, and which half vectors it accepts.
template <class F>
struct MirrorBound {
    PointBound<F> points;
    Triple<F> axis;  ///< Unit; the accepted half vectors lie within the spread of it or of its negative.
    F cos_spread;    ///< Of the shading normals' deviation plus the acceptance of Eq. 1; zero from a right angle on.
    F sin_spread;
};

struct alignas(simd_alignment) PointBlock {
    std::array<float, block_size> x{}, y{}, z{}, radius{};
};

struct alignas(simd_alignment) MirrorBlock {
    PointBlock points;
    std::array<float, block_size> axis_x{}, axis_y{}, axis_z{}, cos_spread{}, sin_spread{};
};

template <class F>
F load_lanes(const std::array<float, block_size>& values, size_t first) {
    return F(values.data() + first, stdx::vector_aligned);
}
template <class F>
Triple<F> load_lanes(const std::array<float, block_size>& x, const std::array<float, block_size>& y,
                     const std::array<float, block_size>& z, size_t first) {
    return {load_lanes<F>(x, first), load_lanes<F>(y, first), load_lanes<F>(z, first)};
}

/// Lanes `first` .. `first` + simd_width - 1.
inline PointBound<FloatV> load(const PointBlock& block, size_t first) {
    return {load_lanes<FloatV>(block.x, block.y, block.z, first), load_lanes<FloatV>(block.radius, first)};
}
inline MirrorBound<FloatV> load(const MirrorBlock& block, size_t first) {
    return {load(block.points, first), load_lanes<FloatV>(block.axis_x, block.axis_y, block.axis_z, first),
            load_lanes<FloatV>(block.cos_spread, first), load_lanes<FloatV>(block.sin_spread, first)};
}

inline PointBound<float> extract(const PointBlock& block, size_t lane) {
    return {{block.x[lane], block.y[lane], block.z[lane]}, block.radius[lane]};
}
inline MirrorBound<float> extract(const MirrorBlock& block, size_t lane) {
    return {extract(block.points, lane),
            {block.axis_x[lane], block.axis_y[lane], block.axis_z[lane]},
            block.cos_spread[lane],
            block.sin_spread[lane]};
}

inline void store(PointBlock& block, size_t lane, const PointBound<float>& bound) {
    block.x[lane] = bound.centre.x;
    block.y[lane] = bound.centre.y;
    block.z[lane] = bound.centre.z;
    block.radius[lane] = bound.radius;
}
inline void store(MirrorBlock& block, size_t lane, const MirrorBound<float>& bound) {
    store(block.points, lane, bound.points);
    block.axis_x[lane] = bound.axis.x;
    block.axis_y[lane] = bound.axis.y;
    block.axis_z[lane] = bound.axis.z;
    block.cos_spread[lane] = bound.cos_spread;
    block.sin_spread[lane] = bound.sin_spread;
}

/// The same in all lanes.
inline Triple<FloatV> broadcast(const Triple<float>& v) {
    return {FloatV(v.x), FloatV(v.y), FloatV(v.z)};
}
inline PointBound<FloatV> broadcast(const PointBound<float>& b) {
    return {broadcast(b.centre), FloatV(b.radius)};
}
inline MirrorBound<FloatV> broadcast(const MirrorBound<float>& b) {
    return {broadcast(b.points), broadcast(b.axis), FloatV(b.cos_spread), FloatV(b.sin_spread)};
}

/// A mask as bits, lane 0 lowest.
inline uint32_t lane_bits(const FloatV::mask_type& mask) {
    return static_cast<uint32_t>(mask.__to_bitset().to_ulong());
}

}  // namespace nephroid

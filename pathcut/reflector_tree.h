// All reflecting triangles that may cast caustics, in world space, and the tree that path cuts descend.
//
// Triangles lie in blocks of sixteen, field by field, in the tree's order: the last test of a cut reads one block.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/casters.h"
#include "core/scene.h"
#include "pathcut/block_tree.h"
#include "pathcut/surface_patch.h"

namespace nephroid {

/// An edge of a triangle, seen from that triangle: 4 triangle + edge, with edge k from corner k to corner k + 1
/// modulo 3.
using HalfEdge = uint32_t;
inline constexpr HalfEdge no_half_edge = std::numeric_limits<uint32_t>::max();
inline constexpr HalfEdge make_half_edge(uint32_t triangle, uint32_t edge) {
    return triangle << 2 | edge;
}
inline constexpr uint32_t triangle_of(HalfEdge h) {
    return h >> 2;
}
inline constexpr uint32_t edge_of(HalfEdge h) {
    return h & 3;
}
inline constexpr uint32_t no_triangle = std::numeric_limits<uint32_t>::max();
/// The same edges seen from the triangles across, or no_half_edge at borders, creases and edges of three triangles.
using Twins = std::array<HalfEdge, 3>;

/// Which half vectors count as reflected.
struct AcceptanceOptions {
    /// Where the normal distribution has fallen to this, a path ends to count (Eq. 1, Li et al. 2022).
    double epsilon = 0.01;
    /// If above zero, instead of Eq. 1: the largest slope in units of alpha.
    double alpha_multiple = 0.0;
    /// With alpha_multiple: of rough surfaces no more than this, but two alpha in any case. Lobes that wide overlap.
    double enough_slope = std::numeric_limits<double>::infinity();

    /// Largest accepted slope tan(theta_h) of a surface of roughness `alpha`, which counts as at least 1e-4.
    double max_slope(double alpha) const;
};

/// A triangle as the scene knows it.
struct TriangleId {
    uint32_t object = 0;
    uint32_t primitive = 0;
};

/// One triangle to be put into the tree: world space; normals unit, or all zero for the geometric normal.
struct ReflectorTriangle {
    std::array<Vec3, 3> positions;
    std::array<Vec3, 3> normals;
    float alpha = 0.0F;
    TriangleId id;
};

/// Sixteen triangles: coordinate by coordinate of the corners and of their unit normals.
struct alignas(simd_alignment) TriangleBlock {
    using Lanes = std::array<float, block_size>;
    std::array<std::array<Lanes, 3>, 3> positions{};  ///< [corner][coordinate]; zero where there is no triangle.
    std::array<std::array<Lanes, 3>, 3> normals{};
    Lanes alpha{};
    Lanes max_slope{};  ///< Infinite where everything is accepted.
};

struct ReflectorTree {
    BlockTree<MirrorBlock> tree;
    std::vector<TriangleBlock> blocks;
    std::vector<TriangleId> ids;  ///< In the tree's order.
    std::vector<Twins> twins;     ///< Of each triangle, across which the surface goes on smoothly.

    float widest_deviation = 0.0F;  ///< Of reflected directions within the largest acceptance angle: a chord.
    float smallest_spread = 0.0F;   ///< Sine of the smallest acceptance angle: no node's spread is smaller.

    size_t size() const { return ids.size(); }
    SurfacePatch patch(uint32_t triangle) const;
    Vec3 position(uint32_t triangle, size_t corner) const {
        const auto& p = blocks[triangle / block_size].positions[corner];
        return {p[0][triangle % block_size], p[1][triangle % block_size], p[2][triangle % block_size]};
    }
    Vec3 normal(uint32_t triangle, size_t corner) const {
        const auto& n = blocks[triangle / block_size].normals[corner];
        return {n[0][triangle % block_size], n[1][triangle % block_size], n[2][triangle % block_size]};
    }
    /// Barycentric coordinates as in SurfacePatch; outside of the triangle too.
    Vec3 point(uint32_t triangle, const Vec2& weights) const {
        return position(triangle, 0) * (1.0F - weights.x - weights.y) + position(triangle, 1) * weights.x +
               position(triangle, 2) * weights.y;
    }
    MirrorBound<float> bound(uint32_t triangle) const {
        return extract(tree.levels[0][triangle / block_size], triangle % block_size);
    }
    float alpha(uint32_t triangle) const { return blocks[triangle / block_size].alpha[triangle % block_size]; }
    float max_slope(uint32_t triangle) const { return blocks[triangle / block_size].max_slope[triangle % block_size]; }
    size_t bytes() const;
};

/// The triangles of all casters; triangles without area are left out, for light does not see them.
std::vector<ReflectorTriangle> reflector_triangles(const Scene& scene, const CasterReport& casters);

/// Degenerate and non-finite triangles are left out. Parallel and deterministic.
ReflectorTree build_reflector_tree(const std::vector<ReflectorTriangle>& triangles, const AcceptanceOptions& options);

}  // namespace nephroid

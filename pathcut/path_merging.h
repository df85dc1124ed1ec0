// Paths that a search has found, before they are handed on: the same path found twice becomes one.
#pragma once

#include <span>
#include <vector>

#include "pathcut/representative_path.h"

namespace nephroid {

/// A path of a receiver as it leaves the solver.
struct FoundPath {
    uint32_t receiver = 0;  ///< In the receiver tree's order.
    RepresentativePath path;
    PerVertex<ReflectorVertex> vertices;
    PerVertex<Vec3> positions;  ///< World space, metres.
    PerVertex<float> edges;     ///< Longest edges of the triangles, metres.
    float steepness = 0.0F;     ///< One reflection: |det dC/dy|, 1/m^2. Zero for more.
};

/// From a solution; receiver and light are left to the caller.
FoundPath make_found_path(const ReflectorTree& reflectors, std::span<const uint32_t> triangles,
                          const SpecularPath& path);

/// By receiver, light, length and triangles: the order in which results are handed on.
bool comes_before(const FoundPath& a, const FoundPath& b);

/// Drops every path of which a better one (exact before relaxed, then by residual) with the same receiver, light and
/// length meets all reflectors within `distance` longest edges of it. Two exact paths on different sides of a fold stay
/// both, however close: near the fold they are two solutions and carry light each. So do paths on the two sides of a
/// crease (crease_ratio). `paths` must be ordered by comes_before, and stays so. Returns how many were dropped.
size_t merge_paths(std::vector<FoundPath>& paths, double distance);

}  // namespace nephroid

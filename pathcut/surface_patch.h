// One triangle with vertex normals as a small piece of smooth surface: what the half-vector constraint is solved on.
//
// In double precision, as the whole solver: Newton's method has to resolve 1e-6 of the scene's size with slopes of 1e-4
// radians, far from the origin; float does not (lobes.md, Sec. 3).
#pragma once

#include <array>

#include "core/vec.h"

namespace nephroid {

using Vec2d = glm::dvec2;

/// Barycentric coordinates (b1, b2) are the weights of vertices 1 and 2; vertex 0 has 1 - b1 - b2. Plane coordinates
/// are metres along `axes`; functions of a point on the patch are differentiated with respect to these.
struct SurfacePatch {
    std::array<Vec3d, 3> positions;
    std::array<Vec3d, 3> normals;               ///< Unit shading normals.
    Vec3d geometric_normal;                     ///< Unit; (p1 - p0) x (p2 - p0) normalised.
    std::array<Vec3d, 2> axes;                  ///< Orthonormal basis of the plane: e1 along the longest edge, e2.
    std::array<Vec2d, 2> barycentric_gradient;  ///< d(b1, b2) / d(plane coordinate k), 1/m; zero if degenerate.
    double size = 0.0;                          ///< Longest edge, metres.
    bool degenerate = false;                    ///< No area: it has points and normals, but light does not see it.
};

/// Normals need not be unit; a zero or non-finite one stands for the geometric normal. A triangle without area (height
/// below 1e-12 of its longest edge, or non-finite positions, which become zero) is `degenerate`: its geometric normal
/// is then any across its longest edge, as close to the mean vertex normal as can be.
SurfacePatch make_surface_patch(const std::array<Vec3d, 3>& positions, const std::array<Vec3d, 3>& normals);

/// A point of the patch; outside of the triangle the linear interpolation is extended.
struct PatchPoint {
    Vec3d position;
    Vec3d normal;                            ///< Unit interpolated shading normal.
    std::array<Vec3d, 2> normal_derivative;  ///< d normal / d(plane coordinate k), 1/m (Sec. 2, lobes.md).
};

/// Where interpolation cancels the normal (opposite normals), it is the geometric normal, with derivative zero.
PatchPoint evaluate(const SurfacePatch& patch, const Vec2d& barycentrics);

/// Barycentric coordinates after a move by `delta` plane coordinates (metres).
Vec2d moved(const SurfacePatch& patch, const Vec2d& barycentrics, const Vec2d& delta);

/// Plane coordinates of the edge from vertex k to vertex k + 1 (modulo 3), metres.
Vec2d edge_vector(const SurfacePatch& patch, int k);

/// Inside the triangle or no more than `tolerance` outside, in barycentric coordinates.
bool is_inside(const Vec2d& barycentrics, double tolerance);

/// The nearest point of the triangle, in its plane.
Vec2d closest_inside(const SurfacePatch& patch, const Vec2d& barycentrics);

inline constexpr Vec2d triangle_centre{1.0 / 3.0, 1.0 / 3.0};

}  // namespace nephroid

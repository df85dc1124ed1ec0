// How strongly a surface bends: principal curvatures, from interpolated shading normals.
#pragma once

#include <array>

#include "pathcut/surface_patch.h"

namespace nephroid {

/// The second order of a surface at a point.
///
/// A curvature is 1/m and positive where the surface bends towards the normal: a ball of radius R with outward normals
/// has -1/R twice, its inside (inward normals) +1/R. Along a direction t the normal changes by -curvature * t.
struct PrincipalCurvatures {
    std::array<double, 2> curvature{};                                           ///< Larger one first.
    std::array<Vec3d, 2> direction{Vec3d(1.0, 0.0, 0.0), Vec3d(0.0, 1.0, 0.0)};  ///< Unit; their cross product: normal.
    Vec3d normal{0.0, 0.0, 1.0};                                                 ///< Unit.
};

/// The symmetric bilinear form (a, b; b, c) of a surface with the normal, in the basis (u, v) of its tangent plane:
/// (u, v, normal) is right-handed and orthonormal. Where the curvatures are equal, any directions; where a number is
/// not finite, curvature zero.
PrincipalCurvatures diagonalise(const std::array<double, 3>& form, const Vec3d& u, const Vec3d& v, const Vec3d& normal);

/// A right-handed orthonormal frame with the unit normal and curvature zero.
PrincipalCurvatures flat_at(const Vec3d& normal);

/// Of the surface whose normals the patch interpolates, at its shading normal there. Zero where the patch is
/// degenerate, where interpolation cancels the normal, and where the shading normal lies in the triangle's plane.
///
/// The triangle's plane is mapped to the tangent plane along the shading normal. The error is of first order in the
/// triangle's size, of second order where the curvature is constant (spheres, cylinders).
PrincipalCurvatures principal_curvatures(const SurfacePatch& patch, const Vec2d& barycentrics);

}  // namespace nephroid

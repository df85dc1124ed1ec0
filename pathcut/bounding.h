// Spheres and cones about the members of a tree's node.
#pragma once

#include <span>

#include "pathcut/bounds_block.h"
#include "pathcut/direction_bounds.h"

namespace nephroid {

/// A sphere about the points: about the middle of their box, with a radius that covers float's rounding.
PointBound<float> bounding_sphere(std::span<const Vec3> points);

/// The half vectors that surfaces with these normals (unit; or interpolated between them) accept, if they may be
/// `acceptance_angle` (radians) off: a cone about the mean normal, on both sides of the surface.
MirrorBound<float> bound_mirror(std::span<const Vec3> points, std::span<const Vec3> normals, double acceptance_angle);

}  // namespace nephroid

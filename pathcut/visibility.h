// Whether anything stands in the way of a specular path that the solver has found.
#pragma once

#include <span>

#include "accel/accelerator.h"
#include "pathcut/half_vector_constraint.h"

namespace nephroid {

/// A point of a path on a surface.
struct SurfacePoint {
    Vec3d position{0.0};          ///< World space, metres.
    Vec3 geometric_normal{0.0F};  ///< Unit; of a receiver on the viewer's side, of other vertices on either side.
    /// Bound of the distance between `position` and where ray queries find the surface, per coordinate, metres: the
    /// error of a SurfaceInteraction or a Receiver, or what `surface_point` makes.
    Vec3 error{0.0F};
};

/// A point that was computed in double precision on a triangle's plane. `extent` bounds the distance from the point to
/// the triangle's corners (metres; a SurfacePatch's size will do): ray queries round relative to it. `transform_error`
/// is what an instance's transform adds per coordinate, zero for meshes in world space.
SurfacePoint surface_point(const Vec3d& position, const Vec3& geometric_normal, double extent,
                           const Vec3& transform_error = Vec3(0.0F));

/// A path between a receiver and a light; refers to the vertices without owning them.
struct SpecularPathView {
    SurfacePoint receiver;                   ///< y_0.
    std::span<const SurfacePoint> vertices;  ///< y_1, next to the receiver, is the first; y_k the last.
    PathEnd light;                           ///< y_{k+1}; the centre of a sphere light.
    double light_radius = 0.0;               ///< Metres. A sphere light's own surface does not block its path.
};

inline constexpr int no_segment = -1;

/// The first blocked segment on the way from the light, or no_segment. Segment i joins y_i and y_{i+1}.
///
/// A path that arrives behind the receiver is blocked in segment 0, one with non-finite or absurdly large numbers
/// (1e18) at the light. On which sides of the other vertices the path runs is for the half-vector constraint to say:
/// their own triangles never block it, nor do those that they share an edge with (normals up to 120 degrees apart).
/// Blockers closer to an end of a segment than some roundings (1e-6 of the position's coordinates, 1e-5 of the extent
/// or of the segment's length) are not seen. Surfaces with blended alpha block by chance, but always the same path in
/// the same way.
int first_blocked_segment(const Accelerator& accelerator, const SpecularPathView& path);

inline bool is_visible(const Accelerator& accelerator, const SpecularPathView& path) {
    return first_blocked_segment(accelerator, path) == no_segment;
}

}  // namespace nephroid

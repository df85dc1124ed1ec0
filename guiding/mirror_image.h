// Where the image of a light stands behind a curved mirror, and through which point of the mirror it is seen from
// elsewhere: Eqs. 6 to 8 of Li et al. 2022.
//
// A curved mirror is treated as two spherical ones, one for each principal direction. In the plane of the normal and a
// principal direction at the reflector point y, a point has a distance d along the normal (from the tangent axis) and h
// along the tangent (from the focal axis). All is written with 1/d and h/d, so that flat mirrors (focal length
// infinite) and lights or images at infinity need no special case.
#pragma once

#include "pathcut/curvature.h"
#include "pathcut/half_vector_constraint.h"

namespace nephroid {

/// A point in homogeneous coordinates: `point` / `weight`; with weight zero the direction `point`, at infinity.
struct Emitter {
    Vec3d point{0.0};
    double weight = 1.0;
};

inline Emitter make_emitter(const PathEnd& light) {
    return {light.point, light.at_infinity ? 0.0 : 1.0};
}

/// The image in one principal direction: 1 / d_v (1/m) and h_v / d_v.
struct PrincipalImage {
    double inverse_distance = 0.0;
    double slope = 0.0;
};

/// Eq. 6. `curvature` is positive for concave mirrors (1/m); the focal length is half the radius. `normal` and
/// `tangent` are unit. Not finite where the emitter lies in the tangent plane.
inline PrincipalImage principal_image(const Emitter& emitter, const Vec3d& y, const Vec3d& normal, const Vec3d& tangent,
                                      double curvature) {
    const Vec3d from_mirror = emitter.point - emitter.weight * y;
    const double distance = glm::dot(from_mirror, normal);
    return {2.0 * curvature - emitter.weight / distance, -glm::dot(from_mirror, tangent) / distance};
}

/// The image in a spherical mirror of the given curvature, the same from everywhere: prior reflectors of a path are
/// reduced to it (Sec. 3.5), with their mean curvature.
inline Emitter spherical_image(const Emitter& emitter, const Vec3d& y, const PrincipalCurvatures& surface) {
    const double mean = 0.5 * (surface.curvature[0] + surface.curvature[1]);
    const auto& [s, t] = surface.direction;
    const PrincipalImage image_s = principal_image(emitter, y, surface.normal, s, mean);
    const PrincipalImage image_t = principal_image(emitter, y, surface.normal, t, mean);
    // y + d_v (normal + slope_s s + slope_t t), times 1 / d_v.
    return {image_s.inverse_distance * y + surface.normal + image_s.slope * s + image_t.slope * t,
            image_s.inverse_distance};
}

/// Eq. 7: how far along the principal direction the image is seen through the mirror from the point (d_p, h_p): where
/// the line from the image to it meets the tangent axis. Infinite or NaN where the point lies on the caustic itself,
/// the image's own distance before the mirror.
template <class F>
F mirror_offset(F inverse_distance, F slope, F d_p, F h_p) {
    return (h_p - d_p * slope) / (F(1) - d_p * inverse_distance);
}

}  // namespace nephroid

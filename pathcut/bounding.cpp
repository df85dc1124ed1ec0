#include "pathcut/bounding.h"

namespace nephroid {

PointBound<float> bounding_sphere(std::span<const Vec3> points) {
    Vec3 low(std::numeric_limits<float>::infinity()), high(-low);
    for (const Vec3& p : points) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const Vec3 centre = low + (high - low) * 0.5F;
    double squared_radius = 0.0;
    for (const Vec3& p : points) {
        const Vec3d to_point = Vec3d(p) - Vec3d(centre);
        squared_radius = std::max(squared_radius, glm::dot(to_point, to_point));
    }
    return {to_triple(centre), static_cast<float>(std::sqrt(squared_radius)) * (1.0F + 1e-6F)};
}

MirrorBound<float> bound_mirror(std::span<const Vec3> points, std::span<const Vec3> normals, double acceptance_angle) {
    const DirectionCone<float> cone = cone_of(normals);
    const double spread = half_angle(cone) + acceptance_angle;
    MirrorBound<float> bound{bounding_sphere(points), cone.axis, 0.0F, 1.0F};
    if (spread < 1.57) {
        bound.cos_spread = static_cast<float>(std::cos(spread));
        bound.sin_spread = static_cast<float>(std::sin(spread));
    }
    return bound;
}

}  // namespace nephroid

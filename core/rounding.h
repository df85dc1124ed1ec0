// Bounds of floating-point rounding errors, and what follows for rays: where a ray must start so that it leaves its
// surface, without any constant that depends on the scene's size.
#pragma once

#include <cmath>
#include <limits>

#include "core/vec.h"

namespace nephroid {

/// Bound of the relative error of n chained float operations: n eps / (1 - n eps) (Higham 2002).
constexpr float rounding_bound(int n) {
    constexpr float half_ulp = std::numeric_limits<float>::epsilon() * 0.5F;
    return static_cast<float>(n) * half_ulp / (1.0F - static_cast<float>(n) * half_ulp);
}

/// The next representable value after x in the direction of the sign of `towards`.
inline float nudge(float x, float towards) {
    if (towards == 0.0F || !std::isfinite(x)) return x;
    return std::nextafter(x, towards > 0.0F ? std::numeric_limits<float>::infinity()
                                            : -std::numeric_limits<float>::infinity());
}

/// Origin of a ray that leaves point p, known up to +-error per coordinate, of a surface with unit normal n on the side
/// of `direction`: outside the slab that the error box spans about the surface (Pharr et al. 2023, Sec. 6.8.6).
inline Vec3 offset_ray_origin(const Vec3& p, const Vec3& error, const Vec3& n, const Vec3& direction) {
    const float slab = glm::dot(glm::abs(n), error);
    const float side = glm::dot(n, direction) < 0.0F ? -1.0F : 1.0F;
    const Vec3 offset = n * (side * slab);
    const Vec3 origin = p + offset;
    return {nudge(origin.x, offset.x), nudge(origin.y, offset.y), nudge(origin.z, offset.z)};
}

}  // namespace nephroid

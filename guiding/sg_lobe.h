// The paper's lobe as it is cached: a spherical Gaussian towards a reflector point, and what moves it to another
// receiver point (Sec. 3.5, Li et al. 2022).
#pragma once

#include "core/frame.h"
#include "guiding/mirror_image.h"

namespace nephroid {

/// How a cached lobe is moved to the shading point.
enum class SgWarp : uint8_t {
    none,    ///< The direction is kept.
    mirror,  ///< Parallax by the mirror equation, Eqs. 6 to 8.
};

/// 60 bytes. World space, metres.
struct SgLobe {
    Vec3 reflector{0.0F};               ///< y, next to the receiver.
    Vec3 normal{0.0F, 0.0F, 1.0F};      ///< Unit, on the receiver's side.
    Vec3 tangent{1.0F, 0.0F, 0.0F};     ///< First principal direction; the second is normal x tangent.
    Vec2 image_inverse_distance{0.0F};  ///< PrincipalImage of the light in both principal directions.
    Vec2 image_slope{0.0F};
    float sharpness = 1.0F;
    float weight = 0.0F;  ///< Probability within its mixture.
};

/// The lobe's axis at the receiver point x: unit, or as it was where the mirror equation has no answer.
inline Vec3 mirror_axis(const SgLobe& lobe, const Vec3& x) {
    const Vec3 to_point = x - lobe.reflector;
    const Vec3 second_tangent = glm::cross(lobe.normal, lobe.tangent);
    const float distance = glm::dot(to_point, lobe.normal);
    const float offset_s =
        mirror_offset(lobe.image_inverse_distance.x, lobe.image_slope.x, distance, glm::dot(to_point, lobe.tangent));
    const float offset_t =
        mirror_offset(lobe.image_inverse_distance.y, lobe.image_slope.y, distance, glm::dot(to_point, second_tangent));
    const Vec3 direction = offset_s * lobe.tangent + offset_t * second_tangent - to_point;
    const float length2 = glm::dot(direction, direction);
    const bool usable = length2 > 0.0F && length2 < std::numeric_limits<float>::infinity();
    const Vec3 chosen = usable ? direction : -to_point;
    return chosen / glm::length(chosen);
}

}  // namespace nephroid

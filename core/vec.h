// Vectors and matrices: GLM under the project's names.
#pragma once

#include <glm/glm.hpp>

namespace nephroid {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using Vec4 = glm::vec4;
using Vec3d = glm::dvec3;
using Mat3 = glm::mat3;
using Mat4 = glm::mat4;

/// Linear RGB with Rec. 709 primaries: radiance, reflectance or intensity, as the name that holds it says.
using Rgb = glm::vec3;

inline constexpr float pi = 3.14159265358979323846F;
inline constexpr float inv_pi = 0.31830988618379067154F;

inline float luminance(const Rgb& c) {
    return 0.2126F * c.r + 0.7152F * c.g + 0.0722F * c.b;
}

inline float max_component(const Vec3& v) {
    return glm::max(v.x, glm::max(v.y, v.z));
}

}  // namespace nephroid

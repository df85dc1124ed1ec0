// The protective lobe of a mixture: uniform over the hemisphere above a surface, so that no direction is impossible.
#pragma once

#include "core/frame.h"
#include "core/vec.h"

namespace nephroid {

/// Uniform over the hemisphere about the unit normal; u and v in [0, 1).
inline Vec3 sample_uniform_hemisphere(const Vec3& normal, float u, float v) {
    float sine = 0.0F, cosine = 0.0F;
    sincos_turn(v, sine, cosine);
    const float radius = safe_sqrt(u * (2.0F - u));
    return to_vec3(make_frame(to_triple(normal)).to_world({radius * cosine, radius * sine, 1.0F - u}));
}

/// Per solid angle; zero below the horizon.
inline float uniform_hemisphere_pdf(const Vec3& normal, const Vec3& direction) {
    return glm::dot(normal, direction) > 0.0F ? 0.5F * inv_pi : 0.0F;
}

}  // namespace nephroid

// Directions on the unit square, areas in proportion to solid angles: x = (1 + d.z) / 2, y = azimuth / (2 pi).
// Lambert's cylindrical map, as in Mueller et al., "Practical Path Guiding" (2017).
#pragma once

#include <algorithm>
#include <cmath>

#include "core/vec.h"
#include "core/warp.h"

namespace nephroid {

/// Solid angle of the whole square.
inline constexpr float cylindrical_map_area = 4.0F * pi;

/// Both coordinates in [0, 1). `direction` is unit.
inline Vec2 direction_to_square(const Vec3& direction) {
    constexpr float largest_below_one = 0x1.fffffep-1F;
    float turn = std::atan2(direction.y, direction.x) * (0.5F * inv_pi);
    if (turn < 0.0F) turn += 1.0F;
    return {std::clamp(0.5F * (1.0F + direction.z), 0.0F, largest_below_one), std::min(turn, largest_below_one)};
}

/// Unit; p in [0, 1)^2.
inline Vec3 square_to_direction(const Vec2& p) {
    return to_vec3(square_to_uniform_sphere(1.0F - p.x, p.y));
}

}  // namespace nephroid

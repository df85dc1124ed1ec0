// Lights as the scene file has them. Emissive triangles are not listed here: they follow from the materials.
#pragma once

#include <string>

#include "core/vec.h"

namespace nephroid {

enum class LightKind : uint8_t { point, spot, directional, sphere };

/// KHR_lights_punctual, world space. A point light with a radius is a sphere light of the same intensity.
struct PunctualLight {
    std::string name;
    LightKind kind = LightKind::point;
    Vec3 position{0.0F};                ///< Metres; unused for directional lights.
    Vec3 direction{0.0F, 0.0F, -1.0F};  ///< Unit; where spot and directional lights shine to.
    Rgb intensity{1.0F};                ///< W/sr (point, spot, sphere) or W/m^2 (directional).
    float radius = 0.0F;                ///< Metres; sphere only.
    float cos_inner = 1.0F;             ///< Spot: full intensity inside this cone.
    float cos_outer = 0.70710678F;      ///< Spot: nothing outside this cone.
};

}  // namespace nephroid

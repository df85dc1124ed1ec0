// Which objects cast caustics, and why: found from materials and lights, never tagged by hand.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene.h"

namespace nephroid {

inline constexpr float max_caster_alpha = 0.1F;       ///< Rougher surfaces focus too little to be worth guiding.
inline constexpr float max_small_light_angle = 0.5F;  ///< Radius over distance, radians.

struct CasterReport {
    std::vector<uint8_t> is_caster;      ///< Per object.
    std::vector<std::string> reason;     ///< Per object: why, or why not, in words.
    std::vector<uint32_t> small_lights;  ///< Indices into Scene::lights: those that are small for some reflector.
};

/// A caster is a reflecting surface of alpha <= max_caster_alpha that a small light (point, spot, directional, or a
/// sphere below max_small_light_angle from its nearest point) shines on; `extras.caustics = "none"` excludes it.
CasterReport find_casters(const Scene& scene);

}  // namespace nephroid

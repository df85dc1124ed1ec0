// What --info and -v print about a scene.
#pragma once

#include <string>

#include "core/casters.h"
#include "core/scene.h"

namespace nephroid {

/// Contents and detected casters, receivers and lights with the reason for each, one line each.
std::string describe_scene(const Scene& scene, const CasterReport& casters);

}  // namespace nephroid

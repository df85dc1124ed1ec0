// KHR_lights_punctual. Private to the glTF loader.
#pragma once

#include "core/gltf_import.h"

namespace nephroid {

/// Adds the light that the node carries, if any, to Scene::lights.
void import_light(GltfImport& import, int node, const glm::dmat4& to_world);

}  // namespace nephroid

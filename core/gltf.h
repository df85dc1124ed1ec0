// glTF 2.0 (.gltf and .glb) to Scene.
#pragma once

#include <string>

#include "core/scene.h"

namespace nephroid {

/// Loads a glTF file. Throws Error(invalid_input) with one line that names file and element for anything malformed,
/// unsupported but required, or outside the file's folder. Everything ignored is in Scene::warnings.
/// Indices, counts and numbers of the result are valid and finite: nothing later checks them again.
Scene load_gltf(const std::string& path);

}  // namespace nephroid

// Meshes of a glTF file. Private to the glTF loader.
#pragma once

#include <vector>

#include "core/gltf_import.h"

namespace nephroid {

/// Converts the primitives of a glTF mesh on first use; returns their indices in Scene::meshes. Primitives that are not
/// triangles or are empty are left out, with a warning.
const std::vector<int>& import_mesh(GltfImport& import, int mesh);

}  // namespace nephroid

// Materials and texture slots of a glTF file. Private to the glTF loader.
#pragma once

#include "core/gltf_import.h"

namespace nephroid {

/// Converts the glTF material (-1: glTF's default material) on first use; returns its index in Scene::materials.
int import_material(GltfImport& import, int material);

}  // namespace nephroid

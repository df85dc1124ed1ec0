// The node graph of a glTF file. Private to the glTF loader.
#pragma once

#include "core/gltf_import.h"

namespace nephroid {

/// Walks the nodes of the default scene, depth first, and adds their objects, cameras and lights to the scene. Throws
/// Error(invalid_input) for nodes with several parents, cycles and transforms that are no affine maps.
void import_nodes(GltfImport& import);

}  // namespace nephroid

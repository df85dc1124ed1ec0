// Cameras of a glTF file. Private to the glTF loader.
#pragma once

#include "core/gltf_import.h"

namespace nephroid {

/// Adds the camera that the node carries, if any, to Scene::cameras. Scaling of the node is taken out, as glTF asks.
void import_camera(GltfImport& import, int node, const glm::dmat4& to_world);

}  // namespace nephroid

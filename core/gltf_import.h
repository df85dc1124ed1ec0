// State of one import: the opened document, the scene that grows from it, and what has been converted already.
// Private to the glTF loader.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/gltf_document.h"
#include "core/scene.h"

namespace nephroid {

struct GltfImport {
    GltfDocument document;
    Scene scene;
    std::set<std::string> warned;                ///< Each warning is given once.
    std::map<int, int> materials;                ///< glTF material (-1: the default) to Scene::materials.
    std::map<std::pair<int, bool>, int> images;  ///< glTF image and whether decoded from sRGB, to Scene::images.
    std::vector<Bounds> mesh_bounds;             ///< Object-space bounds, parallel to Scene::meshes.
    std::map<int, std::vector<int>> meshes;      ///< glTF mesh to Scene::meshes, one per primitive.
    size_t mesh_bytes = 0;                       ///< Memory taken by meshes so far.
    size_t image_bytes = 0;                      ///< Memory taken by images so far.
};

/// Adds "FILE: ELEMENT: PROBLEM" to the scene's warnings, once.
void warn_gltf(GltfImport& import, const std::string& element, const std::string& problem);

/// Accounts for mesh memory; throws where a small file would expand beyond what its own size justifies.
void charge_mesh_memory(GltfImport& import, size_t bytes, const std::string& element);

}  // namespace nephroid

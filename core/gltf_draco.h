// KHR_draco_mesh_compression. Private to the glTF loader.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/gltf_import.h"

namespace nephroid {

/// A decoded primitive: plain arrays, checked.
struct DracoPrimitive {
    size_t vertex_count = 0;
    std::vector<uint32_t> indices;  ///< Three per triangle, below vertex_count.
    /// Per requested attribute that the compressed data hold: vertex_count times its number of components.
    std::map<std::string, std::vector<float>> attributes;
};

/// Whether the primitive is compressed.
bool has_draco(const tinygltf::Primitive& primitive);

/// Decodes the primitive and those of its attributes that `components` names (with their number of components).
/// `element` is for messages. Throws Error(invalid_input) for anything malformed.
DracoPrimitive decode_draco(GltfImport& import, const tinygltf::Primitive& primitive,
                            const std::map<std::string, int>& components, const std::string& element);

}  // namespace nephroid

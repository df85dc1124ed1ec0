// A glTF file that has been opened and checked, before it is turned into a scene. Private to the glTF loader.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/tinygltf_include.h"

namespace nephroid {

/// The document's structure is in `model`, but its bytes are not: tinygltf would copy the BIN chunk and follow any URI.
/// All indices in `model` are valid. `model.images` holds URI, buffer view and name only.
struct GltfDocument {
    std::string file;  ///< As given by the user.
    tinygltf::Model model;
    std::vector<uint8_t> file_bytes;                ///< The whole file where it is a GLB.
    std::vector<std::vector<uint8_t>> loaded;       ///< Content of the buffers that have a URI.
    std::vector<std::span<const uint8_t>> buffers;  ///< Exactly byteLength bytes each.
    size_t source_bytes = 0;                        ///< All bytes read: what expansion is measured against.
};

/// Reads the file and its buffers; throws Error(invalid_input). Ignored things go to `warnings`.
GltfDocument open_gltf(const std::string& path, Warnings& warnings);

/// Bytes of a buffer view; throws where it reaches past its buffer.
std::span<const uint8_t> buffer_view_bytes(const GltfDocument& document, int buffer_view);

/// A number or default from an extension or extras object.
double number_or(const tinygltf::Value& object, const char* key, double fallback);

/// The extension of that name, or nullptr.
const tinygltf::Value* find_extension(const tinygltf::ExtensionMap& extensions, const char* name);

}  // namespace nephroid

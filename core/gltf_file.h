// Bytes of a glTF asset: the file itself, the parts of a GLB container, and what URIs point to.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace nephroid {

/// JSON and binary chunk of a GLB container; views into its bytes.
struct GlbParts {
    std::string_view json;
    std::span<const uint8_t> binary;  ///< Empty where the file has no BIN chunk.
};

/// Whole content of a regular file. `file` and `element` are for the error message.
std::vector<uint8_t> read_gltf_bytes(const std::filesystem::path& path, const std::string& file,
                                     const std::string& element);

/// Whether the bytes begin with the magic number of GLB.
bool is_glb(std::span<const uint8_t> bytes);

/// Splits a GLB container; throws Error(invalid_input) where header or chunk lengths do not fit the bytes.
GlbParts split_glb(std::span<const uint8_t> bytes, const std::string& file);

/// Bytes behind a URI of a buffer or image: a data URI, or a file inside the folder of `file`. Anything outside of that
/// folder (absolute paths, "..", links that lead out, other schemes) is refused.
std::vector<uint8_t> read_uri(const std::string& uri, const std::string& file, const std::string& element);

}  // namespace nephroid

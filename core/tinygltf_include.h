// tiny_gltf.h with the one configuration that all translation units share: its classes depend on these macros.
// No file access and no picture decoding: the loader reads buffers and images itself. Private to the glTF loader.
#pragma once

#include <nlohmann/json.hpp>

#define TINYGLTF_NO_FS
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_INCLUDE_JSON
#include <tiny_gltf.h>

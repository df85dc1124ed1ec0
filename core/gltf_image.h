// Images of a glTF file. Private to the glTF loader.
#pragma once

#include "core/gltf_import.h"

namespace nephroid {

/// Decodes the glTF image on first use; returns its index in Scene::images. `srgb` says that its colours are
/// sRGB-encoded: pictures with more than 8 bits are linearised here, 8-bit ones when they are sampled.
int import_image(GltfImport& import, int image, bool srgb);

}  // namespace nephroid

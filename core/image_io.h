// Picture files in and out, through OpenImageIO.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "core/texture.h"

namespace nephroid {

/// Reads a picture file. 8-bit files keep 8 bits, all others become float. At most 4 channels are kept.
/// Throws Error(invalid_input) where it is missing, unreadable, or has more than 2^28 values.
Image read_image(const std::string& path);

/// The same from an encoded file in memory (glTF buffer views, data URIs); `name` is used in messages.
Image decode_image(std::span<const uint8_t> encoded, const std::string& name);

}  // namespace nephroid

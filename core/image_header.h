// What a picture file says of itself, read before a decoder allocates memory for it.
#pragma once

#include <cstdint>
#include <span>

namespace nephroid {

enum class PictureFormat : uint8_t { unknown, png, jpeg, openexr, radiance_hdr };

/// Announced size; zero where the header is malformed or the file visibly truncated.
struct PictureSize {
    uint64_t width = 0;
    uint64_t height = 0;
};

/// The format by the file's first bytes.
PictureFormat detect_picture_format(std::span<const uint8_t> bytes);

/// The size that the header announces.
PictureSize read_picture_size(std::span<const uint8_t> bytes, PictureFormat format);

}  // namespace nephroid

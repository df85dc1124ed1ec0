// Images in memory and the way a material reads them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"

namespace nephroid {

/// A picture with 1 to 4 interleaved channels, row 0 at the top. 8-bit pictures stay 8-bit in memory.
struct Image {
    enum class Storage : uint8_t { uint8, float32 };

    std::string name;  ///< File name or glTF element, for messages.
    int width = 0;
    int height = 0;
    int channels = 0;
    Storage storage = Storage::uint8;
    std::vector<uint8_t> bytes;  ///< width * height * channels values where storage is uint8.
    std::vector<float> floats;   ///< The same where storage is float32; linear.
};

enum class WrapMode : uint8_t { repeat, mirrored_repeat, clamp_to_edge };

/// How a material slot reads an image. image < 0: the slot has no texture and the factor alone counts.
struct TextureReference {
    int image = -1;  ///< Index into Scene::images.
    int uv_set = 0;  ///< 0 or 1: TEXCOORD_0 or TEXCOORD_1.
    WrapMode wrap_u = WrapMode::repeat;
    WrapMode wrap_v = WrapMode::repeat;
    bool nearest = false;  ///< Nearest texel instead of bilinear interpolation.
    bool srgb = false;     ///< 8-bit colour channels are sRGB-encoded (base colour, emission).
    /// KHR_texture_transform: uv' = uv_matrix * uv + uv_offset (column-major).
    glm::mat2 uv_matrix{1.0F};
    Vec2 uv_offset{0.0F};
};

/// Texel value at uv (after the reference's transform), linear; missing channels are 0, missing alpha 1.
Vec4 sample_texture(const Image& image, const TextureReference& reference, Vec2 uv);

}  // namespace nephroid

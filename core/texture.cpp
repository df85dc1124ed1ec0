#include "core/texture.h"

#include <array>
#include <cmath>
#include <cstddef>

namespace nephroid {

namespace {

using ByteTable = std::array<float, 256>;

ByteTable make_linear_table() {
    ByteTable table{};
    for (size_t i = 0; i < table.size(); ++i) table[i] = static_cast<float>(i) / 255.0F;
    return table;
}

ByteTable make_srgb_table() {
    ByteTable table = make_linear_table();
    for (float& value : table) {
        value = value <= 0.04045F ? value / 12.92F : std::pow((value + 0.055F) / 1.055F, 2.4F);
    }
    return table;
}

// Filled before main: a function-local static would cost a check for every texel.
const ByteTable linear_table = make_linear_table();
const ByteTable srgb_table = make_srgb_table();

/// Texture coordinate to [0, 1]. Coordinates that are too large to have a fraction, or not finite, become 0.
float wrap_coordinate(float t, WrapMode mode) {
    if (!(std::abs(t) < 1e7F)) t = 0.0F;
    if (mode == WrapMode::repeat) return t - std::floor(t);
    if (mode == WrapMode::clamp_to_edge) return glm::clamp(t, 0.0F, 1.0F);
    const float period = t - 2.0F * std::floor(0.5F * t);
    return period > 1.0F ? 2.0F - period : period;
}

/// The two texels beside a wrapped coordinate along one axis, and the weight of the second.
struct TexelPair {
    int first = 0;
    int second = 0;
    float weight = 0.0F;
};

TexelPair find_texels(float t, int size, WrapMode mode) {
    const float position = wrap_coordinate(t, mode) * static_cast<float>(size) - 0.5F;
    const float base = std::floor(position);
    TexelPair pair{static_cast<int>(base), static_cast<int>(base) + 1, position - base};
    // Beyond the edges lies the other edge with repeat, and the same edge with both other modes.
    const bool repeat = mode == WrapMode::repeat;
    if (pair.first < 0) pair.first = repeat ? size - 1 : 0;
    if (pair.second >= size) pair.second = repeat ? 0 : size - 1;
    return pair;
}

int find_nearest(float t, int size, WrapMode mode) {
    return glm::min(static_cast<int>(wrap_coordinate(t, mode) * static_cast<float>(size)), size - 1);
}

/// Texel with a number of channels that is known when compiling. Missing channels are 0, missing alpha is 1.
template <int channels>
Vec4 load_texel(const uint8_t* texel, const ByteTable& table) {
    Vec4 value(0.0F, 0.0F, 0.0F, 1.0F);
    for (int c = 0; c < channels; ++c) value[c] = c == 3 ? linear_table[texel[c]] : table[texel[c]];
    return value;
}

template <int channels>
Vec4 load_texel(const float* texel, const ByteTable&) {
    Vec4 value(0.0F, 0.0F, 0.0F, 1.0F);
    for (int c = 0; c < channels; ++c) value[c] = texel[c];
    return value;
}

template <int channels, typename T>
Vec4 sample(const T* texels, const Image& image, const TextureReference& reference, const Vec2& uv) {
    const ByteTable& table = reference.srgb ? srgb_table : linear_table;
    const auto row = [&](int y) { return texels + ptrdiff_t{y} * image.width * channels; };
    if (reference.nearest) {
        const int x = find_nearest(uv.x, image.width, reference.wrap_u);
        const int y = find_nearest(uv.y, image.height, reference.wrap_v);
        return load_texel<channels>(row(y) + ptrdiff_t{x} * channels, table);
    }
    const TexelPair x = find_texels(uv.x, image.width, reference.wrap_u);
    const TexelPair y = find_texels(uv.y, image.height, reference.wrap_v);
    const ptrdiff_t left = ptrdiff_t{x.first} * channels;
    const ptrdiff_t right = ptrdiff_t{x.second} * channels;
    const T* top = row(y.first);
    const T* bottom = row(y.second);
    const float bottom_right = x.weight * y.weight;
    const float bottom_left = y.weight - bottom_right;
    const float top_right = x.weight - bottom_right;
    const float top_left = 1.0F - x.weight - bottom_left;
    return load_texel<channels>(top + left, table) * top_left + load_texel<channels>(top + right, table) * top_right +
           load_texel<channels>(bottom + left, table) * bottom_left +
           load_texel<channels>(bottom + right, table) * bottom_right;
}

template <typename T>
Vec4 sample_channels(const T* texels, const Image& image, const TextureReference& reference, const Vec2& uv) {
    switch (image.channels) {
        case 1:
            return sample<1>(texels, image, reference, uv);
        case 2:
            return sample<2>(texels, image, reference, uv);
        case 3:
            return sample<3>(texels, image, reference, uv);
        default:
            return sample<4>(texels, image, reference, uv);
    }
}

}  // namespace

Vec4 sample_texture(const Image& image, const TextureReference& reference, Vec2 uv) {
    const Vec2 transformed = reference.uv_matrix * uv + reference.uv_offset;
    if (image.storage == Image::Storage::uint8) {
        return sample_channels(image.bytes.data(), image, reference, transformed);
    }
    return sample_channels(image.floats.data(), image, reference, transformed);
}

}  // namespace nephroid

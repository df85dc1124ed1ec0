#include "core/texture.h"

#include <array>
#include <cmath>

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

/// Missing channels are 0, missing alpha is 1.
Vec4 load_bytes(const uint8_t* texel, int channels, const ByteTable& table) {
    if (channels == 4) return {table[texel[0]], table[texel[1]], table[texel[2]], linear_table[texel[3]]};
    if (channels == 3) return {table[texel[0]], table[texel[1]], table[texel[2]], 1.0F};
    if (channels == 2) return {table[texel[0]], table[texel[1]], 0.0F, 1.0F};
    return {table[texel[0]], 0.0F, 0.0F, 1.0F};
}

Vec4 load_floats(const float* texel, int channels) {
    Vec4 value(0.0F, 0.0F, 0.0F, 1.0F);
    for (int c = 0; c < channels; ++c) value[c] = texel[c];
    return value;
}

Vec4 load_texel(const Image& image, const ByteTable& table, int x, int y) {
    const size_t offset = (static_cast<size_t>(y) * static_cast<size_t>(image.width) + static_cast<size_t>(x)) *
                          static_cast<size_t>(image.channels);
    if (image.storage == Image::Storage::uint8) return load_bytes(image.bytes.data() + offset, image.channels, table);
    return load_floats(image.floats.data() + offset, image.channels);
}

}  // namespace

Vec4 sample_texture(const Image& image, const TextureReference& reference, Vec2 uv) {
    uv = reference.uv_matrix * uv + reference.uv_offset;
    const ByteTable& table = reference.srgb ? srgb_table : linear_table;
    if (reference.nearest) {
        return load_texel(image, table, find_nearest(uv.x, image.width, reference.wrap_u),
                          find_nearest(uv.y, image.height, reference.wrap_v));
    }
    const TexelPair x = find_texels(uv.x, image.width, reference.wrap_u);
    const TexelPair y = find_texels(uv.y, image.height, reference.wrap_v);
    const Vec4 top =
        glm::mix(load_texel(image, table, x.first, y.first), load_texel(image, table, x.second, y.first), x.weight);
    const Vec4 bottom =
        glm::mix(load_texel(image, table, x.first, y.second), load_texel(image, table, x.second, y.second), x.weight);
    return glm::mix(top, bottom, y.weight);
}

}  // namespace nephroid

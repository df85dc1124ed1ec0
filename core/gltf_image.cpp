#include "core/gltf_image.h"

#include <cmath>

#include "core/gltf_error.h"
#include "core/gltf_file.h"
#include "core/image_io.h"

namespace nephroid {

namespace {

Image decode(GltfImport& import, const tinygltf::Image& image, const std::string& element) {
    const std::string name = import.document.file + ": " + element;
    if (image.bufferView >= 0) return decode_image(buffer_view_bytes(import.document, image.bufferView), name);
    if (image.uri.empty()) {
        fail_gltf(import.document.file, element, "it has neither a URI nor a buffer view; re-export the file");
    }
    const std::vector<uint8_t> encoded = read_uri(image.uri, import.document.file, element);
    import.document.source_bytes += encoded.size();
    return decode_image(encoded, name);
}

/// Grey becomes red = green = blue: glTF reads single channels of the RGB picture.
template <typename T>
std::vector<T> expand_grey(const std::vector<T>& values, size_t channels) {
    std::vector<T> result;
    result.reserve(values.size() / channels * (channels + 2));
    for (size_t i = 0; i < values.size(); i += channels) {
        result.insert(result.end(), 3, values[i]);
        if (channels == 2) result.push_back(values[i + 1]);
    }
    return result;
}

void expand_grey(Image& image) {
    if (image.channels > 2) return;
    const auto channels = static_cast<size_t>(image.channels);
    image.bytes = expand_grey(image.bytes, channels);
    image.floats = expand_grey(image.floats, channels);
    image.channels += 2;
}

float linear_from_srgb(float encoded) {
    return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

void linearise(Image& image) {
    const auto channels = static_cast<size_t>(image.channels);
    for (size_t i = 0; i < image.floats.size(); ++i) {
        if (i % channels < 3) image.floats[i] = linear_from_srgb(image.floats[i]);
    }
}

size_t replace_non_finite(Image& image) {
    size_t replaced = 0;
    for (float& value : image.floats) {
        if (std::isfinite(value)) continue;
        value = 0.0F;
        ++replaced;
    }
    return replaced;
}

void charge_image_memory(GltfImport& import, const Image& image, const std::string& element) {
    constexpr size_t always_allowed = size_t{1} << 29U;
    constexpr size_t largest_ratio = 64;
    const size_t channels_later = image.channels > 2 ? static_cast<size_t>(image.channels) : 4;
    const size_t bytes = image.bytes.size() + image.floats.size() * sizeof(float);
    import.image_bytes += bytes / static_cast<size_t>(image.channels) * channels_later;
    if (import.image_bytes > always_allowed + largest_ratio * import.document.source_bytes) {
        fail_gltf(import.document.file, element,
                  "the pictures take too much memory for a file of this size; scale them down");
    }
}

}  // namespace

int import_image(GltfImport& import, int index, bool srgb) {
    // Only pictures of more than 8 bits differ by encoding, but which these are shows when they are decoded.
    for (const bool linearised : {false, true}) {
        const auto found = import.images.find({index, linearised});
        if (found == import.images.end()) continue;
        const Image& image = import.scene.images[static_cast<size_t>(found->second)];
        if (image.storage == Image::Storage::uint8 || linearised == srgb) return found->second;
    }
    const std::string element = element_name("image", static_cast<size_t>(index));
    Image image = decode(import, import.document.model.images[static_cast<size_t>(index)], element);
    charge_image_memory(import, image, element);
    expand_grey(image);
    const size_t replaced = replace_non_finite(image);
    if (replaced > 0) {
        warn_gltf(import, element, std::to_string(replaced) + " values are not finite; replaced by 0");
    }
    const bool linearised = srgb && image.storage == Image::Storage::float32;
    if (linearised) linearise(image);
    const auto result = static_cast<int>(import.scene.images.size());
    import.scene.images.push_back(std::move(image));
    import.images[{index, linearised}] = result;
    return result;
}

}  // namespace nephroid

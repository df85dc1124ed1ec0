#include "core/image_io.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/image_header.h"

namespace nephroid {

namespace {

constexpr uint64_t max_values = uint64_t{1} << 28U;
/// No supported format describes more values with one byte.
constexpr uint64_t max_values_per_byte = 65536;

[[noreturn]] void fail_image(const std::string& name, const std::string& problem) {
    // Errors that nobody fetches are printed by OpenImageIO itself.
    OIIO::geterror();
    throw Error(ExitCode::invalid_input, name + ": " + problem);
}

std::string first_line(const std::string& text) {
    return text.substr(0, std::min(text.find('\n'), size_t{200}));
}

const char* plugin_name(PictureFormat format) {
    switch (format) {
        case PictureFormat::png:
            return "png";
        case PictureFormat::jpeg:
            return "jpeg";
        case PictureFormat::openexr:
            return "openexr";
        case PictureFormat::radiance_hdr:
            return "hdr";
        case PictureFormat::unknown:
            break;
    }
    return "";
}

void check_size(uint64_t width, uint64_t height, uint64_t channels, size_t file_size, const std::string& name) {
    if (width == 0 || height == 0 || channels == 0)
        fail_image(name, "its header is malformed or the file truncated; save the picture again");
    const uint64_t limit = std::min(max_values, max_values_per_byte * file_size);
    if (width > limit || height > limit || width * height > limit / channels) {
        fail_image(name, "its size of " + std::to_string(width) + " x " + std::to_string(height) +
                             " is too large for the file or for memory; scale the picture down");
    }
}

/// Channels to keep: colour and a true alpha channel, but nothing else that an EXR may hold.
int kept_channels(const OIIO::ImageSpec& spec) {
    if (spec.nchannels <= 3) return spec.nchannels;
    return spec.alpha_channel == 3 ? 4 : 3;
}

Image read_pixels(OIIO::ImageInput& input, size_t file_size, const std::string& name) {
    const OIIO::ImageSpec& spec = input.spec();
    check_size(static_cast<uint64_t>(std::max(spec.width, 0)), static_cast<uint64_t>(std::max(spec.height, 0)),
               static_cast<uint64_t>(std::max(spec.nchannels, 0)), file_size, name);
    if (spec.depth > 1 || spec.deep) fail_image(name, "volumes and deep pictures are not supported");
    Image image;
    image.name = name;
    image.width = spec.width;
    image.height = spec.height;
    image.channels = kept_channels(spec);
    const size_t values =
        static_cast<size_t>(image.width) * static_cast<size_t>(image.height) * static_cast<size_t>(image.channels);
    void* data = nullptr;
    const bool is_8_bit = spec.format == OIIO::TypeDesc::UINT8;
    if (is_8_bit) {
        image.storage = Image::Storage::uint8;
        image.bytes.resize(values);
        data = image.bytes.data();
    } else {
        image.storage = Image::Storage::float32;
        image.floats.resize(values);
        data = image.floats.data();
    }
    const OIIO::TypeDesc type = is_8_bit ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT;
    if (!input.read_image(0, 0, 0, image.channels, type, data)) {
        fail_image(name, "it cannot be decoded (" + first_line(input.geterror()) + "); save the picture again");
    }
    return image;
}

Image decode(std::span<const uint8_t> encoded, const std::string& name) {
    const PictureFormat format = detect_picture_format(encoded);
    if (format == PictureFormat::unknown) {
        fail_image(name, "it is not a PNG, JPEG, OpenEXR or Radiance HDR picture; convert it");
    }
    const PictureSize size = read_picture_size(encoded, format);
    check_size(size.width, size.height, 1, encoded.size(), name);

    const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(plugin_name(format));
    if (input == nullptr) fail_image(name, std::string("OpenImageIO was built without ") + plugin_name(format));
    // OpenImageIO takes a pointer to non-const but only reads.
    OIIO::Filesystem::IOMemReader memory(const_cast<uint8_t*>(encoded.data()), encoded.size());
    OIIO::Filesystem::IOProxy* proxy = &memory;
    OIIO::ImageSpec config;
    config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, static_cast<void*>(&proxy));
    // glTF's colours are not premultiplied by alpha, and have to stay so.
    config.attribute("oiio:UnassociatedAlpha", 1);
    OIIO::ImageSpec opened;
    if (!input->open(std::string("picture.") + plugin_name(format), opened, config)) {
        fail_image(name, "it cannot be opened (" + first_line(input->geterror()) + "); save the picture again");
    }
    Image image = read_pixels(*input, encoded.size(), name);
    input->close();
    return image;
}

}  // namespace

Image read_image(const std::string& path) {
    std::error_code failed;
    if (!std::filesystem::is_regular_file(path, failed)) {
        fail_image(path, "there is no such picture file; check the name");
    }
    const uintmax_t size = std::filesystem::file_size(path, failed);
    if (failed || size > UINT32_MAX) fail_image(path, "it cannot be read or is larger than 4 GiB");
    std::vector<uint8_t> encoded(static_cast<size_t>(size));
    std::ifstream stream(path, std::ios::binary);
    stream.read(reinterpret_cast<char*>(encoded.data()), static_cast<std::streamsize>(encoded.size()));
    if (static_cast<size_t>(stream.gcount()) != encoded.size())
        fail_image(path, "it cannot be read; check permissions");
    return decode_image(encoded, path);
}

Image decode_image(std::span<const uint8_t> encoded, const std::string& name) {
    try {
        return decode(encoded, name);
    } catch (const Error&) {
        throw;
    } catch (const std::exception& failure) {
        fail_image(name, "it cannot be decoded (" + first_line(failure.what()) + "); save the picture again");
    }
}

}  // namespace nephroid

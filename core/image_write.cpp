#include "core/image_write.h"

#include <OpenImageIO/imageio.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "core/error.h"

namespace nephroid {

namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
    throw Error(ExitCode::output_failed, path + ": output: " + what);
}

/// Opens, writes and closes; removes the temporary file where any step fails.
void write_file(const std::string& path, const OIIO::ImageSpec& spec, OIIO::TypeDesc type, const void* data) {
    const std::string temporary = temporary_path(path);
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(temporary);
    if (!output) fail(path, "no writer for this format (" + OIIO::geterror() + "); use .exr or .png");
    const bool written = output->open(temporary, spec) && output->write_image(type, data);
    const std::string message = written ? std::string() : output->geterror();
    if (!output->close() || !written) {
        std::remove(temporary.c_str());
        fail(path, "cannot be written (" + (message.empty() ? output->geterror() : message) +
                       "); check space and permissions");
    }
    commit_file(temporary, path);
}

float srgb_encode(float linear) {
    return linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1.0F / 2.4F) - 0.055F;
}

float exposure_of(const std::vector<float>& rgb) {
    std::vector<float> luminances(rgb.size() / 3);
    for (size_t i = 0; i < luminances.size(); ++i)
        luminances[i] = luminance({rgb[i * 3], rgb[i * 3 + 1], rgb[i * 3 + 2]});
    if (luminances.empty()) return 1.0F;
    const auto position = luminances.begin() + static_cast<std::ptrdiff_t>((luminances.size() * 95 - 1) / 100);
    std::nth_element(luminances.begin(), position, luminances.end());
    return *position > 0.0F ? 0.6F / *position : 1.0F;
}

/// Identity below 0.6, then an exponential shoulder towards 1 with matching slope.
float compress_highlight(float x) {
    constexpr float knee = 0.6F;
    return x <= knee ? std::max(x, 0.0F) : 1.0F - (1.0F - knee) * std::exp(-(x - knee) / (1.0F - knee));
}

}  // namespace

std::string temporary_path(const std::string& path) {
    const std::filesystem::path target(path);
    const std::string name =
        "." + target.stem().string() + "." + std::to_string(::getpid()) + ".tmp" + target.extension().string();
    return (target.parent_path() / name).string();
}

void commit_file(const std::string& temporary, const std::string& path) {
    // Without the flush a crash of the machine could leave the new name on an empty file.
    const int descriptor = ::open(temporary.c_str(), O_RDONLY | O_CLOEXEC);
    const bool flushed = descriptor >= 0 && ::fsync(descriptor) == 0;
    if (descriptor >= 0) ::close(descriptor);
    if (!flushed || std::rename(temporary.c_str(), path.c_str()) != 0) {
        const std::string reason = std::strerror(errno);
        std::remove(temporary.c_str());
        fail(path, "cannot be replaced (" + reason + "); check space and permissions");
    }
}

void check_output_path(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    if (extension != ".exr" && extension != ".png") fail(path, "unknown ending '" + extension + "'; use .exr or .png");
    if (std::filesystem::is_directory(path)) fail(path, "is a folder; name a file");
    const std::string temporary = temporary_path(path);
    std::FILE* file = std::fopen(temporary.c_str(), "wb");
    if (file == nullptr)
        fail(path, std::string("cannot be created (") + std::strerror(errno) + "); check folder and permissions");
    std::fclose(file);
    std::remove(temporary.c_str());
}

void write_exr(const std::string& path, int image_width, int image_height, const PixelRegion& crop,
               const std::vector<ImageLayer>& layers, const std::vector<ImageAttribute>& attributes) {
    size_t channel_count = 0;
    OIIO::ImageSpec spec(crop.width(), crop.height(), 0, OIIO::TypeDesc::FLOAT);
    for (const ImageLayer& layer : layers) {
        for (const char channel : layer.channels) {
            spec.channelnames.push_back(layer.name.empty() ? std::string(1, channel) : layer.name + "." + channel);
        }
        channel_count += layer.channels.size();
    }
    spec.nchannels = static_cast<int>(channel_count);
    spec.x = crop.x0;
    spec.y = crop.y0;
    spec.full_width = image_width;
    spec.full_height = image_height;
    spec.attribute("compression", "zip");
    for (const ImageAttribute& attribute : attributes) spec.attribute(attribute.name, attribute.value);

    const size_t pixels = static_cast<size_t>(crop.width()) * static_cast<size_t>(crop.height());
    std::vector<float> interleaved(pixels * channel_count);
    size_t offset = 0;
    for (const ImageLayer& layer : layers) {
        const size_t n = layer.channels.size();
        for (size_t p = 0; p < pixels; ++p) {
            std::copy_n(&layer.values[p * n], n, &interleaved[p * channel_count + offset]);
        }
        offset += n;
    }
    write_file(path, spec, OIIO::TypeDesc::FLOAT, interleaved.data());
}

void write_png(const std::string& path, int width, int height, const std::vector<float>& rgb) {
    const float exposure = exposure_of(rgb);
    std::vector<uint8_t> bytes(rgb.size());
    for (size_t i = 0; i < rgb.size(); ++i) {
        const float encoded = srgb_encode(compress_highlight(exposure * rgb[i]));
        bytes[i] = static_cast<uint8_t>(std::lround(255.0F * std::clamp(encoded, 0.0F, 1.0F)));
    }
    write_png(path, width, height, bytes);
}

void write_png(const std::string& path, int width, int height, const std::vector<uint8_t>& rgb) {
    OIIO::ImageSpec spec(width, height, 3, OIIO::TypeDesc::UINT8);
    spec.attribute("oiio:ColorSpace", "sRGB");
    write_file(path, spec, OIIO::TypeDesc::UINT8, rgb.data());
}

}  // namespace nephroid

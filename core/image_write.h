// Pictures to files, whole or not at all: written beside the target under a temporary name, then renamed.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/film.h"

namespace nephroid {

/// One group of channels of an EXR file: `name` "" is the default layer.
struct ImageLayer {
    std::string name;
    std::string channels;       ///< One letter per channel: "RGB", "XYZ", "Z", "Y".
    std::vector<float> values;  ///< Interleaved, data window only.
};

struct ImageAttribute {
    std::string name;
    std::string value;
};

/// 32-bit float EXR with the crop as data window inside a display window of the whole image.
/// Throws Error(output_failed).
void write_exr(const std::string& path, int image_width, int image_height, const PixelRegion& crop,
               const std::vector<ImageLayer>& layers, const std::vector<ImageAttribute>& attributes);

/// 8-bit sRGB picture for looking at: exposed so that the 95th percentile of the luminance becomes 0.6 (photographs of
/// unknown units), highlights compressed smoothly above 0.6. Throws Error(output_failed).
void write_png(const std::string& path, int width, int height, const std::vector<float>& rgb);

/// 8-bit picture of bytes that are sRGB already, RGB interleaved. Throws Error(output_failed).
void write_png(const std::string& path, int width, int height, const std::vector<uint8_t>& rgb);

/// Throws Error(output_failed) unless a file can be created at that path and its ending is .exr or .png: checked
/// before rendering, so that hours of work are not lost to a typing error.
void check_output_path(const std::string& path);

/// Path beside `path` with the same ending, unique to this process.
std::string temporary_path(const std::string& path);

/// Flushes the temporary file to disk and renames it to path. Throws Error(output_failed).
void commit_file(const std::string& temporary, const std::string& path);

}  // namespace nephroid

#include "core/image_header.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

namespace nephroid {

namespace {

bool starts_with(std::span<const uint8_t> bytes, std::string_view magic) {
    return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

uint32_t read_big_endian(std::span<const uint8_t> bytes, size_t offset, size_t size) {
    uint32_t value = 0;
    for (size_t i = 0; i < size; ++i) value = value << 8U | bytes[offset + i];
    return value;
}

uint32_t read_little_endian(std::span<const uint8_t> bytes, size_t offset) {
    uint32_t value = 0;
    for (size_t i = 4; i-- > 0;) value = value << 8U | bytes[offset + i];
    return value;
}

/// Whether the chunks of a PNG fill it up to an IEND chunk. Past the end of the data libpng jumps over destructors.
bool has_all_png_chunks(std::span<const uint8_t> bytes) {
    constexpr size_t signature_size = 8;
    constexpr size_t chunk_overhead = 12;  // Length, type and checksum.
    size_t offset = signature_size;
    while (bytes.size() - offset >= chunk_overhead) {
        const size_t length = read_big_endian(bytes, offset, 4);
        if (length > bytes.size() - offset - chunk_overhead) return false;
        if (starts_with(bytes.subspan(offset + 4), "IEND")) return true;
        offset += length + chunk_overhead;
    }
    return false;
}

/// Width and height are the first two numbers of the IHDR chunk, which comes first.
PictureSize read_png_size(std::span<const uint8_t> bytes) {
    constexpr size_t width_offset = 16;
    constexpr size_t height_offset = 20;
    if (bytes.size() < height_offset + 4 || !has_all_png_chunks(bytes)) return {};
    return {read_big_endian(bytes, width_offset, 4), read_big_endian(bytes, height_offset, 4)};
}

bool is_frame_header(uint8_t marker) {
    // SOF0 to SOF15 without DHT, JPG and DAC, which share their range.
    return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

/// Steps from marker segment to marker segment until a frame header.
PictureSize read_jpeg_size(std::span<const uint8_t> bytes) {
    size_t offset = 2;
    while (offset + 9 <= bytes.size()) {
        if (bytes[offset] != 0xFF) return {};
        const uint8_t marker = bytes[offset + 1];
        if (marker == 0xFF) {
            ++offset;
            continue;
        }
        if (is_frame_header(marker))
            return {read_big_endian(bytes, offset + 7, 2), read_big_endian(bytes, offset + 5, 2)};
        const size_t length = read_big_endian(bytes, offset + 2, 2);
        if (length < 2) return {};
        offset += 2 + length;
    }
    return {};
}

/// A zero-terminated string in the EXR header; empty where there is none.
std::string_view read_exr_string(std::span<const uint8_t> bytes, size_t& offset) {
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(offset);
    const auto end = std::find(begin, bytes.end(), uint8_t{0});
    if (end == bytes.end()) {
        offset = bytes.size();
        return {};
    }
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()) + offset, static_cast<size_t>(end - begin));
    offset += text.size() + 1;
    return text;
}

/// Extent of a box of four signed integers: xMin, yMin, xMax, yMax.
PictureSize box_size(std::span<const uint8_t> bytes, size_t offset) {
    const auto number = [&](size_t i) {
        return int64_t{static_cast<int32_t>(read_little_endian(bytes, offset + 4 * i))};
    };
    const int64_t width = number(2) - number(0) + 1;
    const int64_t height = number(3) - number(1) + 1;
    if (width <= 0 || height <= 0) return {};
    return {static_cast<uint64_t>(width), static_cast<uint64_t>(height)};
}

/// Largest of data window, display window and tiles, over the attributes of all parts: each costs memory.
PictureSize read_exr_size(std::span<const uint8_t> bytes) {
    PictureSize size;
    const auto include = [&](const PictureSize& other) {
        size = {std::max(size.width, other.width), std::max(size.height, other.height)};
    };
    constexpr uint32_t multi_part_flag = 0x1000;
    if (bytes.size() < 8) return {};
    const bool multi_part = (read_little_endian(bytes, 4) & multi_part_flag) != 0;
    size_t offset = 8;
    while (offset < bytes.size()) {
        const std::string_view name = read_exr_string(bytes, offset);
        if (name.empty()) {  // End of a header; of all headers, unless another one follows.
            if (!multi_part || offset >= bytes.size() || bytes[offset] == 0) break;
            continue;
        }
        const std::string_view type = read_exr_string(bytes, offset);
        if (offset + 4 > bytes.size()) return {};
        const size_t length = read_little_endian(bytes, offset);
        offset += 4;
        if (length > bytes.size() - offset) return {};
        if (type == "box2i" && length >= 16) {
            const PictureSize box = box_size(bytes, offset);
            if (box.width == 0) return {};
            include(box);
        }
        if (type == "tiledesc" && length >= 8) {
            include({read_little_endian(bytes, offset), read_little_endian(bytes, offset + 4)});
        }
        offset += length;
    }
    return size;
}

/// The resolution line, e.g. "-Y 512 +X 1024", follows the first empty line.
PictureSize read_hdr_size(std::span<const uint8_t> bytes) {
    constexpr size_t longest_header = 65536;
    const std::string text(reinterpret_cast<const char*>(bytes.data()), std::min(bytes.size(), longest_header));
    const size_t line = text.find("\n\n");
    if (line == std::string::npos) return {};
    const char* cursor = text.c_str() + line + 2;
    PictureSize size;
    for (uint64_t* extent : {&size.height, &size.width}) {
        cursor += std::strcspn(cursor, "0123456789\n");
        char* end = nullptr;
        *extent = std::strtoull(cursor, &end, 10);
        cursor = end;
    }
    return size;
}

}  // namespace

PictureFormat detect_picture_format(std::span<const uint8_t> bytes) {
    using namespace std::string_view_literals;
    if (starts_with(bytes, "\x89PNG\r\n\x1a\n"sv)) return PictureFormat::png;
    if (starts_with(bytes, "\xff\xd8\xff"sv)) return PictureFormat::jpeg;
    if (starts_with(bytes, "\x76\x2f\x31\x01"sv)) return PictureFormat::openexr;
    if (starts_with(bytes, "#?RADIANCE"sv) || starts_with(bytes, "#?RGBE"sv)) return PictureFormat::radiance_hdr;
    return PictureFormat::unknown;
}

PictureSize read_picture_size(std::span<const uint8_t> bytes, PictureFormat format) {
    switch (format) {
        case PictureFormat::png:
            return read_png_size(bytes);
        case PictureFormat::jpeg:
            return read_jpeg_size(bytes);
        case PictureFormat::openexr:
            return read_exr_size(bytes);
        case PictureFormat::radiance_hdr:
            return read_hdr_size(bytes);
        case PictureFormat::unknown:
            break;
    }
    return {};
}

}  // namespace nephroid

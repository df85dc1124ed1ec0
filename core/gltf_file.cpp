#include "core/gltf_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>

#include "core/gltf_error.h"

namespace nephroid {

namespace fs = std::filesystem;

namespace {

constexpr uint32_t glb_magic = 0x46546C67;
constexpr uint32_t chunk_json = 0x4E4F534A;
constexpr uint32_t chunk_binary = 0x004E4942;

uint32_t read_u32(std::span<const uint8_t> bytes, size_t offset) {
    return static_cast<uint32_t>(bytes[offset]) | static_cast<uint32_t>(bytes[offset + 1]) << 8U |
           static_cast<uint32_t>(bytes[offset + 2]) << 16U | static_cast<uint32_t>(bytes[offset + 3]) << 24U;
}

int hex_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

std::string percent_decode(std::string_view text) {
    std::string result;
    result.reserve(text.size());
    for (size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%' && i + 2 < text.size() && hex_digit(text[i + 1]) >= 0 && hex_digit(text[i + 2]) >= 0) {
            result.push_back(static_cast<char>(hex_digit(text[i + 1]) * 16 + hex_digit(text[i + 2])));
            i += 2;
        } else {
            result.push_back(text[i]);
        }
    }
    return result;
}

std::array<int8_t, 256> base64_values() {
    constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::array<int8_t, 256> values{};
    values.fill(-1);
    for (size_t i = 0; i < alphabet.size(); ++i) {
        values[static_cast<unsigned char>(alphabet[i])] = static_cast<int8_t>(i);
    }
    return values;
}

std::vector<uint8_t> base64_decode(std::string_view text, const std::string& file, const std::string& element) {
    static const std::array<int8_t, 256> values = base64_values();
    while (!text.empty() && text.back() == '=') text.remove_suffix(1);
    std::vector<uint8_t> result;
    result.reserve(text.size() / 4 * 3 + 3);
    uint32_t accumulator = 0;
    unsigned bits = 0;
    for (const char c : text) {
        const int value = values[static_cast<unsigned char>(c)];
        if (value < 0) fail_gltf(file, element, "the data URI is not valid base64; re-export the file");
        accumulator = accumulator << 6U | static_cast<uint32_t>(value);
        bits += 6;
        if (bits >= 8) {
            bits -= 8;
            result.push_back(static_cast<uint8_t>(accumulator >> bits & 0xFFU));
        }
    }
    return result;
}

std::vector<uint8_t> decode_data_uri(std::string_view uri, const std::string& file, const std::string& element) {
    const size_t comma = uri.find(',');
    if (comma == std::string_view::npos) fail_gltf(file, element, "the data URI has no comma; re-export the file");
    const std::string_view header = uri.substr(0, comma);
    const std::string_view payload = uri.substr(comma + 1);
    if (header.ends_with(";base64")) return base64_decode(payload, file, element);
    const std::string text = percent_decode(payload);
    return {text.begin(), text.end()};
}

bool has_scheme(std::string_view uri) {
    const size_t colon = uri.find(':');
    if (colon == std::string_view::npos || colon == 0) return false;
    return std::all_of(uri.begin(), uri.begin() + static_cast<std::ptrdiff_t>(colon), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '+' || c == '.' ||
               c == '-';
    });
}

bool is_inside(const fs::path& path, const fs::path& folder) {
    return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

/// The file that a relative URI names, with symbolic links resolved, refused where it lies outside the scene's folder.
fs::path resolve_inside_folder(const std::string& uri, const std::string& file, const std::string& element) {
    const std::string shown = "'" + printable(uri) + "'";
    const std::string decoded = percent_decode(uri);
    if (decoded.empty()) fail_gltf(file, element, "the URI is empty; re-export the file");
    if (has_scheme(uri) || has_scheme(decoded)) {
        fail_gltf(file, element, "the URI " + shown + " is not a local file; copy it beside the scene");
    }
    if (decoded.find('\0') != std::string::npos || decoded.find('\\') != std::string::npos) {
        fail_gltf(file, element, "the URI " + shown + " is not a relative path with '/'; re-export the file");
    }
    const std::string outside = "the file " + shown + " lies outside the scene's folder; copy it beside the scene";
    const fs::path relative(decoded);
    if (relative.is_absolute()) fail_gltf(file, element, outside);
    std::error_code failed;
    const fs::path folder = fs::canonical(fs::absolute(file).parent_path(), failed);
    if (failed) fail_gltf(file, element, "the scene's folder cannot be read: " + failed.message());
    const fs::path target = fs::weakly_canonical(folder / relative, failed);
    if (failed) fail_gltf(file, element, "the file " + shown + " cannot be read: " + failed.message());
    if (!is_inside(target, folder)) fail_gltf(file, element, outside);
    return target;
}

}  // namespace

std::vector<uint8_t> read_gltf_bytes(const fs::path& path, const std::string& file, const std::string& element) {
    const std::string shown = "'" + printable(path.filename().string()) + "'";
    std::error_code failed;
    if (!fs::exists(path, failed)) fail_gltf(file, element, "there is no file " + shown + "; check the name");
    // Opening a pipe or device could wait forever.
    if (!fs::is_regular_file(path, failed)) fail_gltf(file, element, shown + " is not a file; check the name");
    const uintmax_t size = fs::file_size(path, failed);
    if (failed) fail_gltf(file, element, shown + " cannot be read: " + failed.message());
    if (size > UINT32_MAX) fail_gltf(file, element, shown + " is larger than 4 GiB; split the scene");
    std::vector<uint8_t> bytes(static_cast<size_t>(size));
    std::ifstream stream(path, std::ios::binary);
    if (!stream) fail_gltf(file, element, shown + " cannot be opened; check its permissions");
    stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (static_cast<size_t>(stream.gcount()) != bytes.size()) fail_gltf(file, element, shown + " cannot be read whole");
    return bytes;
}

bool is_glb(std::span<const uint8_t> bytes) {
    return bytes.size() >= 4 && read_u32(bytes, 0) == glb_magic;
}

GlbParts split_glb(std::span<const uint8_t> bytes, const std::string& file) {
    constexpr size_t header_size = 12;
    constexpr size_t chunk_header_size = 8;
    const std::string element = "GLB header";
    if (bytes.size() < header_size) fail_gltf(file, element, "the file is truncated; copy it again");
    const uint32_t version = read_u32(bytes, 4);
    if (version != 2) {
        fail_gltf(file, element, "version " + std::to_string(version) + " is not supported; export glTF 2.0");
    }
    const size_t length = read_u32(bytes, 8);
    if (length > bytes.size()) {
        fail_gltf(file, element,
                  "it announces " + std::to_string(length) + " bytes but the file has " + std::to_string(bytes.size()) +
                      "; copy it again");
    }
    if (length < header_size) fail_gltf(file, element, "its length is too small; re-export the file");

    GlbParts parts;
    size_t offset = header_size;
    for (size_t index = 0; offset < length; ++index) {
        const std::string chunk = element_name("GLB chunk", index);
        if (length - offset < chunk_header_size) fail_gltf(file, chunk, "it is truncated; re-export the file");
        const size_t size = read_u32(bytes, offset);
        const uint32_t type = read_u32(bytes, offset + 4);
        offset += chunk_header_size;
        if (size > length - offset) fail_gltf(file, chunk, "it reaches past the end of the file; re-export the file");
        const std::span<const uint8_t> content = bytes.subspan(offset, size);
        if (index == 0) {
            if (type != chunk_json) fail_gltf(file, chunk, "the first chunk is not JSON; re-export the file");
            parts.json = {reinterpret_cast<const char*>(content.data()), content.size()};
        } else if (index == 1 && type == chunk_binary) {
            parts.binary = content;
        }
        offset += size;
    }
    if (parts.json.empty()) fail_gltf(file, element, "there is no JSON chunk; re-export the file");
    return parts;
}

std::vector<uint8_t> read_uri(const std::string& uri, const std::string& file, const std::string& element) {
    if (uri.starts_with("data:")) return decode_data_uri(uri, file, element);
    return read_gltf_bytes(resolve_inside_folder(uri, file, element), file, element);
}

}  // namespace nephroid

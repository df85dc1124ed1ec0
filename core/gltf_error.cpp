#include "core/gltf_error.h"

namespace nephroid {

void fail_gltf(const std::string& file, const std::string& element, const std::string& problem) {
    throw Error(ExitCode::invalid_input, file + ": " + element + ": " + problem);
}

std::string printable(const std::string& text) {
    constexpr size_t max_bytes = 100;
    std::string result = text.substr(0, max_bytes);
    for (char& c : result) {
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
    }
    // A cut must not leave half a UTF-8 sequence behind.
    if (text.size() > max_bytes) {
        while (!result.empty() && (static_cast<unsigned char>(result.back()) & 0xC0U) == 0x80U) result.pop_back();
        if (!result.empty() && static_cast<unsigned char>(result.back()) >= 0xC0U) result.pop_back();
    }
    return result;
}

std::string element_name(const char* kind, size_t index) {
    return std::string(kind) + " " + std::to_string(index);
}

}  // namespace nephroid

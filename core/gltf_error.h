// How glTF files are refused: one line that names file and element.
#pragma once

#include <string>

#include "core/error.h"

namespace nephroid {

/// Throws Error(invalid_input) "FILE: ELEMENT: PROBLEM". `problem` says what is wrong and, after a semicolon, what to
/// do.
[[noreturn]] void fail_gltf(const std::string& file, const std::string& element, const std::string& problem);

/// Text from the file as it may appear in a message or a name: no control characters, at most 100 bytes.
std::string printable(const std::string& text);

/// "accessor 3"
std::string element_name(const char* kind, size_t index);

}  // namespace nephroid

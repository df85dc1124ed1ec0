// Structural checks of a glTF document before anything reads it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace nephroid {

/// Bounds nesting and number of values of the JSON text, so that no parser runs out of stack or memory on it.
void check_json_shape(std::string_view text, const std::string& file);

/// Checks the type of every property that the loader reads, that numbers are finite as floats, and that every index
/// names an existing element. Throws Error(invalid_input) which names the element.
void check_gltf_structure(const nlohmann::json& document, const std::string& file);

}  // namespace nephroid

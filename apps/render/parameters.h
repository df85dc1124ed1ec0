// Integrators' own parameters (`--set key=value`): one table that parsing, --list-parameters and statistics read.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace nephroid {

/// Numbers that a parameter may be.
struct NumberRange {
    double least = 0.0;
    double most = 0.0;
    bool integer = false;
};

struct ParameterDescription {
    std::string key;
    std::string values;  ///< Allowed values, for people.
    std::string default_value;
    std::string meaning;               ///< What it does and what it trades.
    std::vector<std::string> choices;  ///< All allowed values that are words.
    std::optional<NumberRange> range;  ///< All allowed values that are numbers.
};

/// Key -> value, every key present.
using Parameters = std::map<std::string, std::string>;

/// Names of the integrators that exist, and those that are planned.
bool is_integrator(const std::string& name);
bool is_planned_integrator(const std::string& name);

const std::vector<ParameterDescription>& parameters_of(const std::string& integrator);

/// Defaults, overridden by what assignments such as preset=paper imply, overridden by the assignments "key=value"
/// themselves, whatever their order. Throws Error(usage) for unknown keys and values.
Parameters resolve_parameters(const std::string& integrator, const std::vector<std::string>& assignments);

void print_parameters();

/// "key=value key=value ...", sorted by key.
std::string to_text(const Parameters& parameters);

/// A parameter whose description has a range, as a number.
double number_of(const Parameters& parameters, const std::string& key);

}  // namespace nephroid

#include "apps/render/parameters.h"

#include <algorithm>
#include <cstdio>

#include "core/error.h"

namespace nephroid {

namespace {

const std::map<std::string, std::vector<ParameterDescription>>& table() {
    static const std::map<std::string, std::vector<ParameterDescription>> parameters = {
        {"path",
         {{"sampler",
           "sobol|independent",
           "sobol",
           "sample points: stratified (less noise) or independent (for statistics that assume independence)",
           {"sobol", "independent"}}}},
    };
    return parameters;
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
    return text;
}

}  // namespace

bool is_integrator(const std::string& name) {
    return table().contains(name);
}

bool is_planned_integrator(const std::string& name) {
    static const std::vector<std::string> planned = {"bdpt", "ppg", "guided", "sms", "snee"};
    return std::find(planned.begin(), planned.end(), name) != planned.end();
}

const std::vector<ParameterDescription>& parameters_of(const std::string& integrator) {
    return table().at(integrator);
}

Parameters resolve_parameters(const std::string& integrator, const std::vector<std::string>& assignments) {
    const auto& descriptions = parameters_of(integrator);
    Parameters parameters;
    for (const ParameterDescription& description : descriptions)
        parameters[description.key] = description.default_value;
    for (const std::string& assignment : assignments) {
        const size_t equals = assignment.find('=');
        const std::string element = "--set " + assignment + ": ";
        if (equals == std::string::npos) throw Error(ExitCode::usage, element + "has no '='; write key=value");
        const std::string key = assignment.substr(0, equals);
        const std::string value = assignment.substr(equals + 1);
        const auto description = std::find_if(descriptions.begin(), descriptions.end(),
                                              [&](const ParameterDescription& d) { return d.key == key; });
        if (description == descriptions.end()) {
            throw Error(ExitCode::usage, element + "integrator " + integrator + " has no parameter '" + key +
                                             "'; see --list-parameters");
        }
        if (std::find(description->choices.begin(), description->choices.end(), value) == description->choices.end()) {
            throw Error(ExitCode::usage, element + "unknown value; use one of " + joined(description->choices));
        }
        parameters[key] = value;
    }
    return parameters;
}

void print_parameters() {
    for (const auto& [integrator, descriptions] : table()) {
        for (const ParameterDescription& d : descriptions) {
            std::printf("%-8s %s=%s (default %s)\n         %s\n", integrator.c_str(), d.key.c_str(), d.values.c_str(),
                        d.default_value.c_str(), d.meaning.c_str());
        }
    }
}

}  // namespace nephroid

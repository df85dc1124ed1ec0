#include "apps/render/parameters.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "core/error.h"

namespace nephroid {

namespace {

ParameterDescription sampler_parameter() {
    return {"sampler",
            "sobol|independent",
            "sobol",
            "sample points: stratified (less noise) or independent (for statistics that assume independence)",
            {"sobol", "independent"},
            {}};
}

ParameterDescription adaptive_parameter(const std::string& default_value) {
    return {
        "adaptive",
        "on|off",
        default_value,
        "on: a sample is the mean of more paths where one path deviates more, as earlier samples tell: less noise in "
        "the same time, and samples that take up to twice as long",
        {"on", "off"},
        {}};
}

std::vector<ParameterDescription> guided_parameters() {
    return {
        {"preset",
         "default|paper",
         "default",
         "paper: Li et al. 2022 exactly; other parameters may still be set",
         {"default", "paper"},
         {}},
        {"lobe",
         "slope|sg",
         "slope",
         "the reflector's own profile mapped to directions by its curvature, or the paper's spherical Gaussians "
         "(noisier)",
         {"slope", "sg"},
         {}},
        {"warp",
         "newton|implicit|mirror|none",
         "newton",
         "how lobes move from the cached to the shading point. slope: a Newton step, the derivative (faster, noisier "
         "far from cached points) or none; sg: the paper's mirror equation or none",
         {"newton", "implicit", "mirror", "none"},
         {}},
        {"newton",
         "on|off",
         "on",
         "on: specular points by Newton's method; off: triangles' centres (noisier; the paper's Fig. 13)",
         {"on", "off"},
         {}},
        {"selection",
         "minima|triangles",
         "minima",
         "which paths become lobes: one for each exact solution and local minimum of the slope, or one for each "
         "accepted triangle (the paper; many more lobes, slower samples)",
         {"minima", "triangles"},
         {}},
        {"bounces",
         "1..4",
         "2",
         "reflections of the longest guided paths: more find more light and take longer before rendering starts; "
         "long_paths=photons knows only one and any number",
         {},
         NumberRange{1.0, 4.0, true}},
        {"long_paths",
         "photons|search",
         "photons",
         "light of two and more reflections: lobes fitted to photons, or the paths themselves (up to `bounces`; "
         "later to start)",
         {"photons", "search"},
         {}},
        {"photons",
         "0..10000",
         "32",
         "for each cached point: they tell where cached points are missing, where long paths come from and how much to "
         "guide; more is less noise per sample and a later start. 0: none",
         {},
         NumberRange{0.0, 1e4, false}},
        {"refinements",
         "0..100",
         "2",
         "rounds of added cached points, where photons are covered worst: fewer dots and a later start",
         {},
         NumberRange{0.0, 100.0, true}},
        {"slope_limit",
         "0..100",
         "6",
         "smallest slopes up to so many alpha become lobes, of rough casters up to 0.12 or two alpha: higher covers "
         "more of the dim surroundings of caustics and takes longer; 0: by epsilon",
         {},
         NumberRange{0.0, 100.0, false}},
        {"epsilon",
         "0..1",
         "0.01",
         "with slope_limit=0: where a glossy lobe ends to count (Eq. 1); smaller keeps more of its tail, and more "
         "lobes",
         {},
         NumberRange{1e-12, 1.0, false}},
        {"guide_fraction",
         "auto|0..0.99",
         "auto",
         "probability of the guide against the BSDF: higher is less noise in caustics and more elsewhere; auto: from "
         "the light that each cached point expects of both, then from what samples find",
         {"auto"},
         NumberRange{0.0, 0.99, false}},
        {"combine",
         "auto|off|1|2|4|8|16|32|64",
         "auto",
         "splats of light paths aimed at casters beside the camera's paths, weighted against each other: a light path "
         "for every so many samples. auto: where photons tell that it pays; light that the guide misses then has a "
         "second way to the picture, and every sample takes longer",
         {"auto", "off", "1", "2", "4", "8", "16", "32", "64"},
         {}},
        {"merge_distance",
         "0..100",
         "0.1",
         "paths closer than this, in triangle edges, share a lobe: higher is fewer lobes",
         {},
         NumberRange{0.0, 100.0, false}},
        {"cached_points",
         "1..10000000",
         "10000",
         "about so many points of the picture get a mixture: more is less noise per sample and a later start",
         {},
         NumberRange{1.0, 1e7, true}},
        {"search_seconds",
         "0.001..100000",
         "5",
         "fewer cached points where finding their paths of one reflection would take about so many processor seconds: "
         "for rough casters; below 512 none are searched, and lobes come from photons alone; counted, not timed, so "
         "that the picture is the same on every machine",
         {},
         NumberRange{1e-3, 1e5, false}},
        {"search_share",
         "0.01..1",
         "0.3",
         "with --time: the search for paths ends after this share of it, with fewer cached points or shorter paths; "
         "more is less noise per sample and fewer samples",
         {},
         NumberRange{0.01, 1.0, false}},
        adaptive_parameter("on"),
        sampler_parameter(),
    };
}

std::vector<ParameterDescription> ppg_parameters() {
    return {
        {"preset",
         "2019|2017",
         "2019",
         "2019: Mueller's course notes; 2017: Mueller et al. as published; other parameters may still be set",
         {"2019", "2017"},
         {}},
        {"split_count",
         "1..1000000000",
         "4000",
         "c: a leaf of space with more than c sqrt(samples per pixel / 4) path vertices is halved; smaller follows the "
         "light closer, and is noisier and larger",
         {},
         NumberRange{1.0, 1e9, false}},
        {"spatial_filter",
         "stochastic|nearest",
         "stochastic",
         "stochastic: neighbouring leaves learn from each other (smoother, blurs at edges)",
         {"stochastic", "nearest"},
         {}},
        {"directional_filter",
         "box|nearest",
         "box",
         "box: neighbouring directions learn from each other (smoother, slower to train)",
         {"box", "nearest"},
         {}},
        {"bsdf_fraction",
         "learned|0.01..1",
         "learned",
         "probability of the BSDF against the tree: higher is safer where the tree is wrong; learned: in each leaf",
         {"learned"},
         NumberRange{0.01, 1.0, false}},
        {"passes",
         "combine|discard",
         "combine",
         "combine: the last four passes, weighted by the inverse of their variance (less noise, a bias of less than "
         "that); discard: the last pass alone (unbiased)",
         {"combine", "discard"},
         {}},
        {"quad_share",
         "0.0001..1",
         "0.01",
         "rho: directions with more than this share of a leaf's light are divided; smaller is finer and larger",
         {},
         NumberRange{1e-4, 1.0, false}},
        {"quad_depth",
         "1..20",
         "20",
         "most levels of directions: fewer is coarser and faster",
         {},
         NumberRange{1.0, 20.0, true}},
        sampler_parameter(),
    };
}

const std::map<std::string, std::vector<ParameterDescription>>& table() {
    static const std::map<std::string, std::vector<ParameterDescription>> parameters = {
        {"path", {adaptive_parameter("off"), sampler_parameter()}},
        {"bdpt",
         {{"emission",
           "power|casters",
           "power",
           "where small lights send their light paths: everywhere, or mostly to casters (less noise in caustics of "
           "casters that look small from the light, more elsewhere)",
           {"power", "casters"},
           {}},
          sampler_parameter()}},
        {"guided", guided_parameters()},
        {"ppg", ppg_parameters()},
    };
    return parameters;
}

/// What an assignment implies for parameters that are not assigned.
const std::map<std::string, Parameters>& implications() {
    static const std::map<std::string, Parameters> values = {
        {"lobe=sg",
         {{"warp", "mirror"},
          {"guide_fraction", "0.5"},
          {"slope_limit", "0"},
          {"long_paths", "search"},
          {"combine", "off"},
          {"adaptive", "off"}}},
        {"preset=paper",
         {{"lobe", "sg"},
          {"warp", "mirror"},
          {"guide_fraction", "0.5"},
          {"slope_limit", "0"},
          {"long_paths", "search"},
          {"combine", "off"},
          {"adaptive", "off"},
          {"selection", "triangles"}}},
        {"preset=2017",
         {{"split_count", "12000"},
          {"spatial_filter", "nearest"},
          {"directional_filter", "nearest"},
          {"bsdf_fraction", "0.5"},
          {"passes", "discard"}}},
    };
    return values;
}

bool is_allowed(const ParameterDescription& description, const std::string& value) {
    const auto& choices = description.choices;
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return true;
    if (!description.range) return false;
    double number = 0.0;
    const char* end = value.data() + value.size();
    const auto [rest, error] = std::from_chars(value.data(), end, number);
    const NumberRange& range = *description.range;
    return error == std::errc() && rest == end && number >= range.least && number <= range.most &&
           (!range.integer || number == std::floor(number));
}

/// Throws Error(usage) where values exclude each other.
void check_combination(const Parameters& parameters) {
    if (!parameters.contains("lobe")) return;
    const std::string& lobe = parameters.at("lobe");
    const std::string& warp = parameters.at("warp");
    const bool for_sg = warp == "mirror", for_slope = warp == "newton" || warp == "implicit";
    if ((lobe == "sg" && for_slope) || (lobe == "slope" && for_sg)) {
        throw Error(ExitCode::usage, "--set warp=" + warp + ": not for lobe=" + lobe + "; use " +
                                         (lobe == "sg" ? "mirror or none" : "newton, implicit or none"));
    }
    if (lobe == "sg" && parameters.at("long_paths") == "photons") {
        throw Error(ExitCode::usage, "--set long_paths=photons: not for lobe=sg; use search");
    }
    if (lobe == "sg" && parameters.at("guide_fraction") == "auto") {
        throw Error(ExitCode::usage, "--set guide_fraction=auto: not for lobe=sg; use a number, the paper's is 0.5");
    }
}

}  // namespace

bool is_integrator(const std::string& name) {
    return table().contains(name);
}

bool is_planned_integrator(const std::string& name) {
    static const std::vector<std::string> planned = {"sms", "snee"};
    return std::find(planned.begin(), planned.end(), name) != planned.end();
}

const std::vector<ParameterDescription>& parameters_of(const std::string& integrator) {
    return table().at(integrator);
}

Parameters resolve_parameters(const std::string& integrator, const std::vector<std::string>& assignments) {
    const auto& descriptions = parameters_of(integrator);
    Parameters assigned;
    for (const std::string& assignment : assignments) {
        const size_t equals = assignment.find('=');
        const std::string element = "--set " + assignment + ": ";
        if (equals == std::string::npos) throw Error(ExitCode::usage, element + "has no '='; write key=value");
        const std::string key = assignment.substr(0, equals);
        const auto description = std::find_if(descriptions.begin(), descriptions.end(),
                                              [&](const ParameterDescription& d) { return d.key == key; });
        if (description == descriptions.end()) {
            throw Error(ExitCode::usage, element + "integrator " + integrator + " has no parameter '" + key +
                                             "'; see --list-parameters");
        }
        assigned[key] = assignment.substr(equals + 1);
        if (!is_allowed(*description, assigned[key])) {
            throw Error(ExitCode::usage, element + "not an allowed value; use " + description->values);
        }
    }
    Parameters parameters;
    for (const ParameterDescription& description : descriptions)
        parameters[description.key] = description.default_value;
    for (const auto& [cause, implied] : implications()) {
        const size_t equals = cause.find('=');
        const auto found = assigned.find(cause.substr(0, equals));
        if (found == assigned.end() || found->second != cause.substr(equals + 1)) continue;
        for (const auto& [key, value] : implied) parameters[key] = value;
    }
    for (const auto& [key, value] : assigned) parameters[key] = value;
    check_combination(parameters);
    return parameters;
}

double number_of(const Parameters& parameters, const std::string& key) {
    return std::stod(parameters.at(key));
}

std::string to_text(const Parameters& parameters) {
    std::string text;
    for (const auto& [key, value] : parameters) text += (text.empty() ? "" : " ") + key + "=" + value;
    return text;
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

#include "apps/render/options.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <thread>

#include "apps/command.h"
#include "apps/render/quality.h"
#include "core/error.h"

namespace nephroid {

namespace {

[[noreturn]] void usage_error(const std::string& option, const std::string& what) {
    throw Error(ExitCode::usage, option + ": " + what);
}

/// Exactly `count` integers separated by `separator`, nothing else.
std::optional<std::vector<int>> parse_integers(const std::string& text, char separator, size_t count) {
    std::vector<int> values;
    std::istringstream stream(text);
    std::string item;
    while (std::getline(stream, item, separator)) {
        size_t used = 0;
        try {
            values.push_back(std::stoi(item, &used));
        } catch (const std::exception&) {
            return std::nullopt;
        }
        if (used != item.size()) return std::nullopt;
    }
    if (values.size() != count || text.empty() || text.back() == separator) return std::nullopt;
    return values;
}

void parse_size(const std::string& text, Options& options) {
    constexpr int largest = 65536;
    const auto values = parse_integers(text, 'x', 2);
    if (!values || (*values)[0] < 1 || (*values)[1] < 1 || (*values)[0] > largest || (*values)[1] > largest) {
        usage_error("--size " + text, "is not WIDTHxHEIGHT with 1 to 65536 pixels each; write e.g. 1280x720");
    }
    options.width = (*values)[0];
    options.height = (*values)[1];
}

void parse_crop(const std::string& text, Options& options) {
    const auto values = parse_integers(text, ',', 4);
    if (!values) usage_error("--crop " + text, "is not x0,y0,x1,y1 in pixels; write e.g. 100,50,200,150");
    options.crop = PixelRegion{(*values)[0], (*values)[1], (*values)[2], (*values)[3]};
}

void parse_inspect(const std::string& text, Options& options) {
    const auto values = parse_integers(text, ',', 2);
    if (!values) usage_error("--inspect " + text, "is not x,y in pixels; write e.g. 320,200");
    options.inspect = Options::Pixel{(*values)[0], (*values)[1]};
}

/// What a picture of directions cannot heed is refused, not ignored.
void check_inspect(const Options& options) {
    const auto& aovs = options.aovs;
    const bool has_aov = aovs.albedo || aovs.normal || aovs.depth || aovs.caustic || aovs.variance || aovs.spp;
    for (const auto& [given, name] : {std::pair(options.time.has_value(), "--time"),
                                      {options.noise.has_value(), "--noise"},
                                      {has_aov, "--aov"},
                                      {!options.reference.empty(), "--reference"},
                                      {!options.stats.empty(), "--stats"},
                                      {!options.checkpoint.empty(), "--checkpoint"},
                                      {options.info, "--info"}}) {
        if (given) usage_error("--inspect", std::string("does not go with ") + name + "; leave one of them out");
    }
}

void parse_aovs(const std::string& text, Options& options) {
    std::istringstream stream(text);
    std::string name;
    while (std::getline(stream, name, ',')) {
        if (name == "albedo")
            options.aovs.albedo = true;
        else if (name == "normal")
            options.aovs.normal = true;
        else if (name == "depth")
            options.aovs.depth = true;
        else if (name == "caustic")
            options.aovs.caustic = true;
        else if (name == "variance")
            options.aovs.variance = true;
        else if (name == "spp")
            options.aovs.spp = true;
        else
            usage_error("--aov " + name, "unknown; use albedo, normal, depth, caustic, variance, spp");
    }
}

void check_integrator(const Options& options) {
    if (is_integrator(options.integrator)) return;
    if (is_planned_integrator(options.integrator)) {
        usage_error("--integrator " + options.integrator, "is not in this version yet; use path, bdpt, ppg or guided");
    }
    usage_error("--integrator " + options.integrator, "unknown; use path, bdpt, ppg or guided");
}

void check_ranges(const Options& options) {
    if (options.time && !(*options.time > 0.0)) usage_error("--time", "must be above 0 seconds");
    if (options.noise && !(*options.noise > 0.0)) usage_error("--noise", "must be above 0");
    if (!(options.env_scale >= 0.0F) || !std::isfinite(options.env_scale))
        usage_error("--env-scale", "must be at least 0");
    if (!(options.checkpoint_every > 0.0)) usage_error("--checkpoint-every", "must be above 0 seconds");
    if (options.resume && options.checkpoint.empty())
        usage_error("--resume", "needs --checkpoint FILE to continue from");
}

// What was asked for in so many words comes first.
void apply_quality(Options& options) {
    const Quality& quality = quality_named(options.quality);
    if (!options.spp && !options.time && !options.noise) options.spp = quality.spp;
    if (options.integrator != "guided") return;
    options.assignments.insert(options.assignments.begin(), quality.guided.begin(), quality.guided.end());
}

}  // namespace

std::optional<Options> parse_options(int argc, char** argv) {
    Options options;
    std::string size, crop, aov;
    std::optional<std::string> inspect;
    bool quiet = false;
    bool verbose = false;
    bool list_parameters = false;

    CLI::App app("Renders a glTF scene: unbiased, offline, made for caustics.", "render");
    // A later option overrides an earlier one, so that scripts can append.
    app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    app.add_option("scene", options.scene, "glTF file, .gltf or .glb");
    app.add_option("-o,--output", options.outputs,
                   ".exr (32-bit float) or .png (tone-mapped); may be given twice [SCENE.exr]")
        ->take_all()
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->allow_extra_args(false);
    app.add_option("-i,--integrator", options.integrator, "path, bdpt, ppg or guided [guided]");
    app.add_option("--spp", options.spp, "stop at N samples per pixel [as --quality]")->check(CLI::Range(1, 1 << 30));
    app.add_option("--time", options.time, "stop after SECONDS, everything counted from process start");
    app.add_option("--noise", options.noise, "stop at relative noise REL");
    app.add_option("--seed", options.seed, "seed of all random numbers [0]");
    app.add_option("--threads", options.threads, "number of threads [all]")->check(CLI::Range(1, 4096));
    app.add_option("--size", size, "image size WxH [from the camera's shape, 1280 wide]");
    app.add_option("--crop", crop, "render only pixels x0,y0,x1,y1 (end exclusive)");
    app.add_option("--camera", options.camera, "camera by name or index [first]");
    app.add_option("--max-depth", options.max_depth, "at most N surface scatterings on a path [12]")
        ->check(CLI::Range(1, 1000));
    app.add_option("--env", options.env, "lat-long EXR/HDR environment light");
    app.add_option("--env-scale", options.env_scale, "factor on the environment [1]");
    app.add_option("--aov", aov, "extra EXR layers: albedo,normal,depth,caustic,variance,spp");
    app.add_option("--reference", options.reference, "measure the error against this EXR after every pass");
    app.add_option("--stats", options.stats, "write statistics to this JSON file");
    app.add_option("--checkpoint", options.checkpoint, "save the render's state to this file");
    app.add_option("--checkpoint-every", options.checkpoint_every, "seconds between checkpoints [60]");
    app.add_flag("--resume", options.resume, "continue from the checkpoint");
    app.add_option("--quality", options.quality,
                   "draft, standard or final: 16, 64 or 1024 samples, and how much guided prepares [standard]");
    app.add_option("--set", options.assignments, "integrator parameter key=value; may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->allow_extra_args(false);
    app.add_flag("--list-parameters", list_parameters, "print all integrators' parameters");
    app.add_flag("--info", options.info, "print what the scene holds and which caustics were detected; render nothing");
    app.add_option("--inspect", inspect,
                   "show how directions are sampled at what pixel x,y sees, against the light that arrives there: "
                   "OUT.inspect*.exr and .png; render nothing else");
    app.add_flag("-q", quiet, "no output but errors and warnings");
    app.add_flag("-v", verbose, "more output");
    app.set_version_flag("--version", std::string("nephroid render " NEPHROID_VERSION));

    if (!parse_command_line(app, argc, argv)) return std::nullopt;
    if (list_parameters) {
        print_parameters();
        return std::nullopt;
    }
    if (options.scene.empty()) usage_error("command line", "no scene given; see --help");
    if (!size.empty()) parse_size(size, options);
    if (!crop.empty()) parse_crop(crop, options);
    if (!aov.empty()) parse_aovs(aov, options);
    check_ranges(options);
    if (inspect) {
        parse_inspect(*inspect, options);
        check_inspect(options);
        if (options.integrator == "ppg") {
            usage_error("--inspect", "ppg has learned nothing before it renders; use -i guided or path");
        }
    }
    if (!options.info) check_integrator(options);
    apply_quality(options);
    if (options.threads == 0) options.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    if (quiet) options.verbosity = Verbosity::quiet;
    if (verbose) options.verbosity = Verbosity::verbose;
    return options;
}

}  // namespace nephroid

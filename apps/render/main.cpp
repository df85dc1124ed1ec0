// render: glTF in, EXR out.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "apps/command.h"
#include "apps/render/info.h"
#include "apps/render/inspect.h"
#include "apps/render/options.h"
#include "apps/render/output.h"
#include "apps/render/process.h"
#include "core/casters.h"
#include "core/environment.h"
#include "core/fingerprint.h"
#include "core/gltf.h"
#include "core/image_io.h"
#include "core/image_write.h"
#include "core/scene_fingerprint.h"
#include "integrators/bdpt/bdpt_integrator.h"
#include "integrators/driver.h"
#include "integrators/guided/guided_integrator.h"
#include "integrators/path/path_integrator.h"
#include "integrators/ppg/ppg_integrator.h"
#include "pathcut/densify.h"

namespace nephroid {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

Scene load_scene(const Options& options) {
    Scene scene = load_gltf(options.scene);
    if (!options.env.empty()) scene.environment = load_environment(options.env, options.env_scale, scene.warnings);
    flatten_single_use_meshes(scene);
    densify_objects(scene);
    return scene;
}

Camera choose_camera(const Scene& scene, const Options& options, Warnings& warnings) {
    if (options.camera.empty()) {
        if (!scene.cameras.empty()) return scene.cameras.front();
        const Bounds bounds = world_bounds(scene);
        warnings.push_back(options.scene + ": cameras: none in the scene; using a framed default view");
        return bounds.empty() ? Camera() : framing_camera(bounds.min, bounds.max);
    }
    for (const Camera& camera : scene.cameras) {
        if (camera.name == options.camera) return camera;
    }
    const bool is_index =
        std::all_of(options.camera.begin(), options.camera.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (is_index && options.camera.size() < 7 && std::stoul(options.camera) < scene.cameras.size()) {
        return scene.cameras[std::stoul(options.camera)];
    }
    throw Error(ExitCode::invalid_input, options.scene + ": camera '" + options.camera +
                                             "': not in the scene; see --info for names and indices");
}

struct ImageSize {
    int width, height;
};

ImageSize choose_size(const Camera& camera, const Options& options) {
    if (options.width) return {*options.width, *options.height};
    float aspect = camera.kind == CameraKind::orthographic ? camera.xmag / camera.ymag : camera.aspect;
    if (!(aspect > 0.01F && aspect < 100.0F)) aspect = 16.0F / 9.0F;
    constexpr int default_width = 1280;
    return {default_width, std::max(1, static_cast<int>(std::lround(default_width / aspect)))};
}

PixelRegion choose_crop(const ImageSize& size, const Options& options) {
    const PixelRegion whole{0, 0, size.width, size.height};
    if (!options.crop) return whole;
    const PixelRegion& crop = *options.crop;
    if (crop.x0 < 0 || crop.y0 < 0 || crop.x1 > size.width || crop.y1 > size.height || crop.width() < 1 ||
        crop.height() < 1) {
        throw Error(ExitCode::usage, "--crop: empty or outside the image of " + std::to_string(size.width) + "x" +
                                         std::to_string(size.height) + " pixels; choose a region inside");
    }
    return crop;
}

/// RGB of the crop from a reference picture of the crop's or the whole image's size.
std::vector<float> load_reference(const Options& options, const ImageSize& size, const PixelRegion& crop) {
    if (options.reference.empty()) return {};
    const Image image = read_image(options.reference);
    const bool whole = image.width == size.width && image.height == size.height;
    const bool same = image.width == crop.width() && image.height == crop.height();
    if (image.storage != Image::Storage::float32 || image.channels < 3 || !(whole || same)) {
        throw Error(ExitCode::invalid_input,
                    options.reference +
                        ": reference: not a float RGB picture of the image's size; render it with the same --size");
    }
    std::vector<float> rgb;
    rgb.reserve(static_cast<size_t>(crop.width()) * static_cast<size_t>(crop.height()) * 3);
    const int x0 = same ? 0 : crop.x0;
    const int y0 = same ? 0 : crop.y0;
    for (int y = 0; y < crop.height(); ++y) {
        for (int x = 0; x < crop.width(); ++x) {
            const size_t pixel =
                static_cast<size_t>(y0 + y) * static_cast<size_t>(image.width) + static_cast<size_t>(x0 + x);
            for (size_t c = 0; c < 3; ++c) rgb.push_back(image.floats[pixel * static_cast<size_t>(image.channels) + c]);
        }
    }
    return rgb;
}

/// Everything that a sample's value depends on, so that a checkpoint is continued only where it belongs.
uint64_t settings_fingerprint(const Scene& scene, const Camera& camera, const ImageSize& size, const PixelRegion& crop,
                              const Options& options, const Parameters& parameters) {
    Fingerprint fingerprint;
    fingerprint.add(std::string(NEPHROID_VERSION) + " " + options.integrator);
    for (const auto& [key, value] : parameters) fingerprint.add(key + "=" + value);
    for (const int value : {size.width, size.height, crop.x0, crop.y0, crop.x1, crop.y1}) fingerprint.add_value(value);
    fingerprint.add_value(options.seed);
    fingerprint.add_value(options.max_depth);
    const AovSelection& a = options.aovs;
    for (const bool layer : {a.albedo, a.normal, a.depth, a.caustic, a.variance, options.noise.has_value()}) {
        fingerprint.add_value(layer);
    }
    add_camera(camera, fingerprint);
    add_scene(scene, fingerprint);
    return fingerprint.value();
}

/// Time kept for writing: measured rates of the EXR and PNG writers with a margin.
double writing_seconds(const PixelRegion& crop, const AovSelection& aovs, size_t outputs) {
    const double layers = 1.0 + aovs.albedo + aovs.normal + aovs.depth + aovs.caustic + aovs.variance + aovs.spp;
    const double pixels = static_cast<double>(crop.width()) * static_cast<double>(crop.height());
    return 0.05 + pixels * layers * static_cast<double>(outputs) * 3e-7;
}

void print_warnings(Warnings& warnings) {
    for (const std::string& warning : warnings) std::fprintf(stderr, "warning: %s\n", warning.c_str());
    warnings.clear();
}

/// `seconds_left`: until the render has to end; none: there is no limit.
GuidedSettings guided_settings(const Parameters& parameters, std::optional<double> seconds_left) {
    GuidedSettings settings;
    if (seconds_left) {
        const std::chrono::duration<double> seconds(std::max(*seconds_left, 0.0) *
                                                    number_of(parameters, "search_share"));
        settings.search_end = Clock::now() + std::chrono::duration_cast<Clock::duration>(seconds);
    }
    settings.cached_points = static_cast<uint32_t>(number_of(parameters, "cached_points"));
    settings.search_seconds = number_of(parameters, "search_seconds");
    settings.bounces = static_cast<int>(number_of(parameters, "bounces"));
    settings.photons = number_of(parameters, "photons");
    settings.refinements = static_cast<uint32_t>(number_of(parameters, "refinements"));
    settings.long_paths = parameters.at("long_paths") == "photons" ? LongPaths::photons : LongPaths::search;
    settings.lobe = parameters.at("lobe") == "slope" ? LobeKind::slope : LobeKind::spherical_gaussian;
    settings.acceptance.epsilon = number_of(parameters, "epsilon");
    settings.acceptance.alpha_multiple = number_of(parameters, "slope_limit");
    settings.merge_distance = number_of(parameters, "merge_distance");
    settings.newton = parameters.at("newton") == "on";
    settings.selection = parameters.at("selection") == "minima" ? Selection::local_minima : Selection::every_triangle;
    const std::string& warp = parameters.at("warp");
    settings.sg_warp = warp == "mirror" ? SgWarp::mirror : SgWarp::none;
    settings.slope_warp = warp == "newton"     ? SlopeWarp::newton
                          : warp == "implicit" ? SlopeWarp::implicit
                                               : SlopeWarp::none;
    if (parameters.at("guide_fraction") != "auto") {
        settings.guide_fraction = static_cast<float>(number_of(parameters, "guide_fraction"));
    }
    const std::string& combine = parameters.at("combine");
    if (combine != "auto") settings.light_path_per = combine == "off" ? 0 : static_cast<uint32_t>(std::stoul(combine));
    settings.adaptive = parameters.at("adaptive") == "on";
    return settings;
}

PpgSettings ppg_settings(const Parameters& parameters) {
    PpgSettings settings;
    settings.tree.split_count = number_of(parameters, "split_count");
    settings.tree.stochastic_spatial_filter = parameters.at("spatial_filter") == "stochastic";
    settings.tree.box_directional_filter = parameters.at("directional_filter") == "box";
    if (parameters.at("bsdf_fraction") != "learned") {
        settings.tree.bsdf_fraction = static_cast<float>(number_of(parameters, "bsdf_fraction"));
    }
    settings.tree.directions.share = number_of(parameters, "quad_share");
    settings.tree.directions.depth = static_cast<int>(number_of(parameters, "quad_depth"));
    settings.earlier_samples =
        parameters.at("passes") == "combine" ? EarlierSamples::combined : EarlierSamples::discarded;
    return settings;
}

std::unique_ptr<Integrator> make_integrator(const std::string& name, const Parameters& parameters,
                                            const RenderContext& context, const CasterReport& casters,
                                            const GuidedView& view, std::optional<double> seconds_left) {
    if (name == "guided") {
        return std::make_unique<GuidedIntegrator>(context, casters, view, guided_settings(parameters, seconds_left));
    }
    if (name == "bdpt") {
        return std::make_unique<BdptIntegrator>(context, casters, BdptView{view.width, view.height, view.crop},
                                                BdptSettings{parameters.at("emission") == "casters"});
    }
    if (name == "ppg") return std::make_unique<PpgIntegrator>(context, ppg_settings(parameters));
    if (parameters.at("adaptive") == "on") return std::make_unique<PathIntegrator>(context, view.crop);
    return std::make_unique<PathIntegrator>(context);
}

ExitCode render(const Options& options, Clock::time_point process_start) {
    const Clock::time_point load_start = Clock::now();
    const Parameters parameters =
        options.info ? Parameters() : resolve_parameters(options.integrator, options.assignments);
    std::vector<std::string> outputs = options.outputs;
    if (outputs.empty()) outputs.push_back(std::filesystem::path(options.scene).stem().string() + ".exr");
    if (!options.info) {
        for (const std::string& output : outputs) check_output_path(output);
        if (options.inspect) check_output_path(inspection_path(outputs.front()));
    }

    Scene scene = load_scene(options);
    const CasterReport casters = find_casters(scene);
    if (options.info) {
        print_warnings(scene.warnings);
        std::fputs(describe_scene(scene, casters).c_str(), stdout);
        return ExitCode::done;
    }
    const Camera camera = choose_camera(scene, options, scene.warnings);
    const ImageSize size = choose_size(camera, options);
    const PixelRegion crop = choose_crop(size, options);
    print_warnings(scene.warnings);
    Progress progress(options.verbosity);
    progress.verbose(describe_scene(scene, casters));

    DriverSettings settings;
    settings.spp = options.spp;
    settings.seconds = options.time;
    settings.noise = options.noise;
    settings.threads = options.threads;
    settings.process_start = process_start;
    settings.reserved_seconds = writing_seconds(crop, options.aovs, outputs.size());
    settings.reference = load_reference(options, size, crop);
    settings.checkpoint = options.checkpoint;
    settings.checkpoint_every = options.checkpoint_every;
    settings.resume = options.resume;
    if (!options.checkpoint.empty()) {
        settings.fingerprint = settings_fingerprint(scene, camera, size, crop, options, parameters);
    }
    const double load_seconds = seconds_since(load_start);

    const Clock::time_point build_start = Clock::now();
    const Accelerator accelerator(scene, options.threads);
    Surfaces surfaces(scene);
    surfaces.set_casters(casters.is_caster);
    const LightSet lights(scene);
    const double build_seconds = seconds_since(build_start);
    if (lights.empty())
        std::fprintf(stderr, "warning: %s: lights: none; the picture will be black\n", options.scene.c_str());

    const RenderContext context{scene,
                                accelerator,
                                surfaces,
                                lights,
                                make_camera_rays(camera, size.width, size.height),
                                options.max_depth,
                                options.seed,
                                parameters.at("sampler") == "sobol" ? SamplerKind::sobol : SamplerKind::independent,
                                options.aovs};
    std::optional<InspectedVertex> inspected;
    if (options.inspect) inspected = vertex_to_inspect(options, context, crop);
    const Clock::time_point precompute_start = Clock::now();
    std::optional<double> seconds_left;
    if (options.time) seconds_left = *options.time - seconds_since(process_start);
    const std::unique_ptr<Integrator> integrator = make_integrator(options.integrator, parameters, context, casters,
                                                                   {size.width, size.height, crop}, seconds_left);
    const double precompute_seconds = seconds_since(precompute_start);
    if (inspected) {
        inspect_vertex(options, parameters, context, *integrator, *inspected, outputs.front());
        return ExitCode::done;
    }
    Film film(size.width, size.height, crop, options.aovs, options.noise.has_value());
    const RenderResult result = run_render(*integrator, film, settings, progress);
    if (film.nonfinite_samples() > 0) {
        std::fprintf(stderr, "warning: %s: %llu samples were not finite and count as black\n", options.scene.c_str(),
                     static_cast<unsigned long long>(film.nonfinite_samples()));
    }

    RenderReport report{options,       parameters,         result, film,          load_seconds,
                        build_seconds, precompute_seconds, 0.0,    process_start, integrator->statistics()};
    const Clock::time_point write_start = Clock::now();
    write_outputs(report, outputs);
    report.write_seconds = seconds_since(write_start);
    if (!options.stats.empty()) write_statistics(report, options.stats);
    if (options.verbosity != Verbosity::quiet) {
        std::fprintf(stderr, "%s: %u spp in %.2f s (stopped by %s)\n", outputs.front().c_str(), film.min_spp(),
                     seconds_since(process_start), result.stop_reason.c_str());
    }
    return result.stop_reason == "interrupted" ? ExitCode::interrupted : ExitCode::done;
}

int run(int argc, char** argv) {
    const Clock::time_point process_start = process_start_time();
    install_interrupt_handlers();
    return run_command("render", "free memory or reduce the scene or image size", [&] {
        const std::optional<Options> options = parse_options(argc, argv);
        return options ? render(*options, process_start) : ExitCode::done;
    });
}

}  // namespace

}  // namespace nephroid

int main(int argc, char** argv) {
    return nephroid::run(argc, argv);
}

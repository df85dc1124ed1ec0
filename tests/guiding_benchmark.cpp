// Relative standard deviation of one sample at points of the picture that see a caustic, by scheme, as JSON. Not a
// test.
//
//   guiding_benchmark SCENE.glb [--size WxH] [--points N] [--samples N] [--cached-points N] [--schemes
//   path,paper,slope] [--reflections 1|2] [--fraction B] [--fresh-photons N]
//
// Light by one reflection alone. Every scheme's second moment is measured with the same broad proposal (lobes found for
// the point itself, half of the samples over the whole hemisphere): measured with its own samples, a scheme that misses
// part of the light looks good. Schemes: path (cosine), paper and slope with lobes of the point itself (exact) and of a
// cache of the whole picture (cached), the way the renderer uses them. The paper's search takes very long where rough
// reflectors are finely tessellated: leave it out there. The fraction of slope lobes is chosen for all of the scene's
// light, of which this is a part: --fraction sets it, to see the lobes alone.
//
// With --reflections 2, light by two reflections and the default settings: as rendered, its part if the second
// direction were perfect, and path tracing (tests/two_reflections.h).
//
// With --fresh-photons, only light of two and more reflections, by so many photons a cached point that no lobe was
// fitted to: a sample's second moment over the squared mean at a fraction of one half, and the share of the light for
// which the guide's density is less than twice the BSDF's.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.h"
#include "core/gltf.h"
#include "core/rounding.h"
#include "core/warp.h"
#include "integrators/guided/guided_integrator.h"
#include "integrators/guided/lobe_weight.h"
#include "integrators/guided/photon_coverage.h"
#include "pathcut/densify.h"
#include "tests/two_reflections.h"

using namespace nephroid;

namespace {

struct Options {
    std::string scene;
    int width = 320;
    int height = 240;
    uint32_t points = 128;
    uint32_t samples = 8192;
    uint32_t cached_points = 10000;
    std::vector<std::string> schemes{"path", "paper", "slope"};
    int reflections = 1;
    std::optional<float> fraction;  ///< Of slope lobes; none: as rendered.
    uint32_t fresh_photons = 0;

    bool measures(const std::string& scheme) const {
        return std::find(schemes.begin(), schemes.end(), scheme) != schemes.end();
    }
};

/// The way a scheme draws directions at one point.
struct Scheme {
    std::string name;
    std::function<float(const Vec3&)> pdf;  ///< Together with the BSDF (cosine).
};

/// At one point, by lobes of its own and of the picture's cache.
template <class Mixture>
struct PointMixtures {
    std::unique_ptr<Mixture> exact, cached;
};

struct PointResult {
    double irradiance = 0.0;
    std::vector<double> deviation;  ///< By scheme.
};

float cosine_pdf(const Receiver& receiver, const Vec3& w) {
    return std::max(glm::dot(receiver.geometric_normal, w), 0.0F) * inv_pi;
}

template <class Mixture>
Scheme guided_scheme(const std::string& name, const Receiver& receiver, const MixtureCache<Mixture>& mixtures,
                     std::unique_ptr<Mixture>& mixture) {
    std::array<FoundPoint, Mixture::most_points> found;
    const size_t count = mixtures.cache.lookup.find(receiver.position, receiver.geometric_normal, found);
    mixture = std::make_unique<Mixture>(mixtures.cache, mixtures.options);
    mixture->clear();
    if (count > 0) {
        mixture->add(std::span(found).first(count), diffuse_guide_vertex(receiver.position, receiver.geometric_normal));
    }
    mixture->prepare();
    const float fraction = count > 0 ? mixture->fraction(0) : 0.0F;
    return {name, [&receiver, &mixture, fraction](const Vec3& w) {
                return (1.0F - fraction) * cosine_pdf(receiver, w) +
                       (fraction > 0.0F ? fraction * mixture->pdf(0, w) : 0.0F);
            }};
}

nlohmann::json summary(std::vector<std::pair<double, double>> deviation_and_weight) {
    std::sort(deviation_and_weight.begin(), deviation_and_weight.end());
    const auto quantile = [&](double q) {
        return deviation_and_weight[static_cast<size_t>(q * static_cast<double>(deviation_and_weight.size() - 1))]
            .first;
    };
    double squares = 0.0, energy = 0.0;
    for (const auto& [deviation, irradiance] : deviation_and_weight) {
        squares += deviation * deviation * irradiance * irradiance;
        energy += irradiance * irradiance;
    }
    return {{"median", quantile(0.5)}, {"p90", quantile(0.9)}, {"energy_weighted", std::sqrt(squares / energy)}};
}

class Benchmark {
  public:
    Benchmark(const Options& options, const Scene& scene)
        : options_(options),
          casters_(find_casters(scene)),
          accelerator_(scene, 2),
          surfaces_(scene),
          lights_(scene),
          context_{scene,
                   accelerator_,
                   surfaces_,
                   lights_,
                   make_camera_rays(scene.cameras.front(), options.width, options.height),
                   3,
                   0,
                   SamplerKind::sobol,
                   {}} {
        surfaces_.set_casters(casters_.is_caster);
    }

    nlohmann::json run() {
        GuidedSettings slope, paper = paper_settings();
        slope.bounces = paper.bounces = 1;
        slope.cached_points = paper.cached_points = options_.cached_points;
        slope.guide_fraction = options_.fraction;
        const std::vector<Receiver> points = shading_points();
        const GuidedPaths found = paths_to(points, slope);
        // The proposal of all measurements: always needed.
        const SlopeCachePointer exact = slope_cache(points, slope);
        const auto slope_cached = options_.measures("slope") ? slope_cache(cached(slope), slope) : nullptr;
        const auto paper_exact = options_.measures("paper") ? paper_cache(points, paper) : nullptr;
        const auto paper_cached = options_.measures("paper") ? paper_cache(cached(paper), paper) : nullptr;

        std::vector<PointResult> results;
        std::vector<std::string> names;
        for (const Receiver& point : points) {
            PointMixtures<SlopeMixtures> mixtures;
            PointMixtures<SgMixtures> paper_mixtures;
            const Scheme proposal = guided_scheme("slope exact", point, *exact, mixtures.exact);
            if (mixtures.exact->lobe_count(0) == 0) continue;
            std::vector<Scheme> schemes;
            if (options_.measures("path")) {
                schemes.push_back({"path", [&point](const Vec3& w) { return cosine_pdf(point, w); }});
            }
            if (paper_exact) {
                schemes.push_back(guided_scheme("paper exact", point, *paper_exact, paper_mixtures.exact));
                schemes.push_back(guided_scheme("paper cached", point, *paper_cached, paper_mixtures.cached));
            }
            if (slope_cached) {
                schemes.push_back(proposal);
                schemes.push_back(guided_scheme("slope cached", point, *slope_cached, mixtures.cached));
            }
            PointResult result = measure(point, found.lights.front(), *mixtures.exact, schemes);
            if (!(result.irradiance > 0.0)) continue;
            results.push_back(std::move(result));
            names.clear();
            for (const Scheme& scheme : schemes) names.push_back(scheme.name);
        }
        return summaries(names, results);
    }

    nlohmann::json run_two_reflections() {
        GuidedSettings settings;
        settings.cached_points = options_.cached_points;
        settings.guide_fraction = options_.fraction;
        const GuidedIntegrator integrator(context_, casters_, view(), settings);
        if (integrator.guide() == nullptr) return {{"scene", options_.scene}, {"points", 0}};
        const GuidedPaths prepared = prepare_paths(context_, casters_, settings);
        std::vector<PointResult> results;
        for (const Receiver& point : shading_points()) {
            const testing::TwoReflections at = testing::measure_two_reflections(
                context_, *integrator.guide(), point, prepared.lights.front(), options_.samples);
            if (at.irradiance > 0.0) results.push_back({at.irradiance, {at.guided, at.guided_at_point, at.path}});
        }
        return summaries({"guided", "guided, second direction perfect", "path"}, results);
    }

    nlohmann::json run_fresh_photons() {
        GuidedSettings settings;
        settings.cached_points = options_.cached_points;
        context_.max_depth = 12;  // As `render` has it.
        GuidedPaths found = paths_to(cached(settings), settings);
        GuidedStatistics statistics;
        const MadeSlopeCache made = make_slope_cache(context_, found, {}, settings, statistics);
        RenderContext other = context_;
        other.seed = 78;
        const auto count = options_.fresh_photons * static_cast<uint32_t>(found.receivers.size());
        const auto photons = trace_caustic_photons(other, found, count, context_.max_depth - 1);
        return {{"scene", options_.scene}, {"fresh_photons", fresh_summary(made.cache, photons)}};
    }

  private:
    static nlohmann::json fresh_summary(const SlopeCache& cache, const std::vector<CausticPhoton>& photons) {
        const auto coverage = measure_coverage(cache, SlopeMixtureOptions(), photons);
        const std::vector<float> irradiance = irradiance_at_points(cache, photons, coverage);
        double moment = 0.0, smooth = 0.0, left = 0.0, all = 0.0;
        size_t number = 0;
        for (size_t i = 0; i < photons.size(); ++i) {
            const PhotonCoverage& at = coverage[i];
            if (photons[i].reflections < 2 || !(at.bsdf_pdf > 0.0F)) continue;
            const double own = double{photons[i].power};
            moment += own * double{at.sample_value(photons[i], 0.5F)};
            smooth += own * double{irradiance[at.nearest]};
            left += at.guide_pdf < 2.0F * at.bsdf_pdf ? own : 0.0;
            all += own;
            ++number;
        }
        if (number == 0) return {{"photons", 0}};
        return {{"photons", number}, {"second_moment", moment / smooth}, {"left_to_bsdf", left / all}};
    }

    nlohmann::json summaries(const std::vector<std::string>& names, const std::vector<PointResult>& results) const {
        nlohmann::json json{{"scene", options_.scene}, {"points", results.size()}};
        for (size_t s = 0; s < names.size(); ++s) {
            std::vector<std::pair<double, double>> values;
            for (const PointResult& r : results) values.emplace_back(r.deviation[s], r.irradiance);
            if (!values.empty()) json["relative_deviation"][names[s]] = summary(values);
        }
        return json;
    }

    using SlopeCachePointer = std::unique_ptr<MixtureCache<SlopeMixtures>>;
    using PaperCachePointer = std::unique_ptr<MixtureCache<SgMixtures>>;

    /// Points of the picture other than cached ones, of rough surfaces.
    std::vector<Receiver> shading_points() const {
        RenderContext other = context_;
        other.seed = 77;
        std::vector<Receiver> points = choose_receivers(other, view(), options_.points);
        std::erase_if(points, [](const Receiver& r) { return r.alpha <= max_caster_alpha; });
        return points;
    }
    GuidedView view() const { return {options_.width, options_.height, {0, 0, options_.width, options_.height}}; }
    std::vector<Receiver> cached(const GuidedSettings& settings) const {
        return choose_receivers(context_, view(), settings.cached_points);
    }
    GuidedPaths paths_to(const std::vector<Receiver>& receivers, const GuidedSettings& settings) const {
        GuidedStatistics statistics;
        return find_guided_paths(context_, casters_, receivers, settings, statistics);
    }
    SlopeCachePointer slope_cache(const std::vector<Receiver>& receivers, const GuidedSettings& settings) const {
        GuidedPaths found = paths_to(receivers, settings);
        GuidedStatistics statistics;
        return std::make_unique<MixtureCache<SlopeMixtures>>(
            make_slope_cache(context_, found, {}, settings, statistics).cache, SlopeMixtureOptions());
    }
    PaperCachePointer paper_cache(const std::vector<Receiver>& receivers, const GuidedSettings& settings) const {
        return std::make_unique<MixtureCache<SgMixtures>>(
            make_sg_cache(context_, paths_to(receivers, settings), settings), SgMixtureOptions());
    }

    PointResult measure(const Receiver& point, const PathLight& light, const SlopeMixtures& proposal,
                        const std::vector<Scheme>& schemes) const {
        PointResult result;
        std::vector<double> squares(schemes.size(), 0.0);
        double sum = 0.0;
        for (uint32_t i = 0; i < options_.samples; ++i) {
            const auto [choice, unused] = sample_2d(SamplerKind::sobol, 1U, i, 0);
            const auto [u, v] = sample_2d(SamplerKind::sobol, 1U, i, 1);
            const Vec3 w =
                choice < 0.5F
                    ? proposal.sample(0, std::min(2.0F * choice, 0.999999F), u, v)
                    : to_vec3(
                          make_frame(to_triple(point.geometric_normal)).to_world(square_to_cosine_hemisphere(u, v)));
            const float cosine = glm::dot(point.geometric_normal, w);
            if (!(cosine > 0.0F)) continue;
            const double pdf = 0.5 * double{proposal.pdf(0, w)} + 0.5 * double{cosine_pdf(point, w)};
            const double integrand = double{reflected_radiance(context_, point, light, w)} * double{cosine};
            if (!(integrand > 0.0)) continue;
            sum += integrand / pdf;
            for (size_t s = 0; s < schemes.size(); ++s) {
                squares[s] += integrand * integrand / (pdf * std::max(double{schemes[s].pdf(w)}, 1e-30));
            }
        }
        const double n = options_.samples;
        result.irradiance = sum / n;
        for (const double s : squares) {
            result.deviation.push_back(std::sqrt(std::max(s / n / (result.irradiance * result.irradiance) - 1.0, 0.0)));
        }
        return result;
    }

    Options options_;
    CasterReport casters_;
    Accelerator accelerator_;
    Surfaces surfaces_;
    LightSet lights_;
    RenderContext context_;
};

void parse_size(const std::string& text, Options& options) {
    int used = 0;
    const int count = std::sscanf(text.c_str(), "%5dx%5d%n", &options.width, &options.height, &used);
    if (count != 2 || static_cast<size_t>(used) != text.size() || options.width < 1 || options.height < 1) {
        throw Error(ExitCode::usage, "--size " + text + ": is not WIDTHxHEIGHT; write e.g. 320x240");
    }
}

/// Nothing where only help was asked for.
std::optional<Options> parse_options(int argc, char** argv) {
    Options options;
    std::string size;
    const CLI::Range counts(1, 100'000'000);
    CLI::App app("Prints the relative standard deviation of one sample at points that see a caustic, as JSON.",
                 "guiding_benchmark");
    app.add_option("scene", options.scene, "glTF file, .gltf or .glb")->required();
    app.add_option("--size", size, "film WxH: which part of the scene the camera sees [320x240]");
    app.add_option("--points", options.points, "about so many points of the picture [128]")->check(counts);
    app.add_option("--samples", options.samples, "directions at each point [8192]")->check(counts);
    app.add_option("--cached-points", options.cached_points, "of the picture's cache [10000]")->check(counts);
    app.add_option("--schemes", options.schemes, "which to measure, with commas between [path,paper,slope]")
        ->delimiter(',')
        ->check(CLI::IsMember({"path", "paper", "slope"}));
    app.add_option("--reflections", options.reflections, "of the light [1]")->check(CLI::Range(1, 2));
    app.add_option("--fraction", options.fraction, "of the guide, for slope lobes [as rendered]")
        ->check(CLI::Range(0.01, 0.99));
    app.add_option("--fresh-photons", options.fresh_photons, "a cached point: measures light of several reflections")
        ->check(CLI::Range(1, 4096));
    if (!parse_command_line(app, argc, argv)) return std::nullopt;
    if (!size.empty()) parse_size(size, options);
    return options;
}

nlohmann::json measure_scene(const Options& options) {
    Scene scene = load_gltf(options.scene);
    flatten_single_use_meshes(scene);
    densify_objects(scene);
    if (scene.cameras.empty()) {
        throw Error(ExitCode::invalid_input, options.scene + ": cameras: there is none; add one to the scene");
    }
    Benchmark benchmark(options, scene);
    if (options.fresh_photons > 0) return benchmark.run_fresh_photons();
    return options.reflections == 1 ? benchmark.run() : benchmark.run_two_reflections();
}

}  // namespace

int main(int argc, char** argv) {
    return run_command("guiding_benchmark", "ask for fewer points", [&] {
        const std::optional<Options> options = parse_options(argc, argv);
        if (options) std::printf("%s\n", measure_scene(*options).dump(2).c_str());
        return ExitCode::done;
    });
}

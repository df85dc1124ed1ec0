// Relative standard deviation of one sample at points of the picture that see a caustic, by scheme, as JSON. Not a
// test.
//
//   guiding_benchmark SCENE.glb [--size WxH] [--points N] [--samples N] [--cached-points N]
//
// Light by one reflection alone. Every scheme's second moment is measured with the same broad proposal (lobes found for
// the point itself, half of the samples over the whole hemisphere): measured with its own samples, a scheme that misses
// part of the light looks good. Schemes: path (cosine), sg and slope with lobes of the point itself (exact) and of a
// cache of the whole picture (cached), the way the renderer uses them.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/gltf.h"
#include "core/rounding.h"
#include "core/warp.h"
#include "integrators/guided/guided_integrator.h"
#include "integrators/guided/lobe_weight.h"
#include "pathcut/densify.h"

using namespace nephroid;

namespace {

struct Options {
    std::string scene;
    int width = 320;
    int height = 240;
    uint32_t points = 128;
    uint32_t samples = 8192;
    uint32_t cached_points = 10000;
};

/// The way a scheme draws directions at one point.
struct Scheme {
    std::string name;
    std::function<float(const Vec3&)> pdf;  ///< Together with the BSDF (cosine).
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
    if (count > 0) mixture->add(std::span(found).first(count), receiver.position, receiver.geometric_normal);
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
        GuidedSettings slope, sg = paper_settings();
        slope.bounces = sg.bounces = 1;
        slope.cached_points = sg.cached_points = options_.cached_points;
        const std::vector<Receiver> points = shading_points();
        const auto slope_exact = slope_cache(points, slope), slope_cached = slope_cache(cached(slope), slope);
        const auto sg_exact = sg_cache(points, sg), sg_cached = sg_cache(cached(sg), sg);
        const GuidedPaths found = paths_to(points, slope);
        std::vector<PointResult> results;
        std::vector<std::string> names;
        for (const Receiver& point : points) {
            std::unique_ptr<SlopeMixtures> mixture, warped;
            std::unique_ptr<SgMixtures> sg_mixture, sg_warped;
            const std::vector<Scheme> schemes{{"path", [&point](const Vec3& w) { return cosine_pdf(point, w); }},
                                              guided_scheme("sg exact", point, sg_exact, sg_mixture),
                                              guided_scheme("sg cached", point, sg_cached, sg_warped),
                                              guided_scheme("slope exact", point, slope_exact, mixture),
                                              guided_scheme("slope cached", point, slope_cached, warped)};
            if (mixture->lobe_count(0) == 0) continue;
            names.clear();
            for (const Scheme& scheme : schemes) names.push_back(scheme.name);
            results.push_back(measure(point, found.lights.front(), *mixture, schemes));
            if (!(results.back().irradiance > 0.0)) results.pop_back();
        }
        nlohmann::json json{{"scene", options_.scene}, {"points", results.size()}};
        for (size_t s = 0; s < names.size(); ++s) {
            std::vector<std::pair<double, double>> values;
            for (const PointResult& r : results) values.emplace_back(r.deviation[s], r.irradiance);
            if (!values.empty()) json["relative_deviation"][names[s]] = summary(values);
        }
        return json;
    }

  private:
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
    MixtureCache<SlopeMixtures> slope_cache(const std::vector<Receiver>& receivers,
                                            const GuidedSettings& settings) const {
        return {make_slope_cache(context_, paths_to(receivers, settings), settings), SlopeMixtureOptions()};
    }
    MixtureCache<SgMixtures> sg_cache(const std::vector<Receiver>& receivers, const GuidedSettings& settings) const {
        return {make_sg_cache(context_, paths_to(receivers, settings), settings), SgMixtureOptions()};
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

bool parse(int argc, char** argv, Options& options) {
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        const auto number = [&] { return static_cast<uint32_t>(i + 1 < argc ? std::stoul(argv[++i]) : 0); };
        if (argument == "--points") {
            options.points = number();
        } else if (argument == "--samples") {
            options.samples = number();
        } else if (argument == "--cached-points") {
            options.cached_points = number();
        } else if (argument == "--size" && i + 1 < argc) {
            if (std::sscanf(argv[++i], "%5dx%5d", &options.width, &options.height) != 2) return false;
        } else if (options.scene.empty()) {
            options.scene = argument;
        } else {
            return false;
        }
    }
    return !options.scene.empty();
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    try {
        if (!parse(argc, argv, options)) {
            std::fprintf(stderr,
                         "error: command line: guiding_benchmark SCENE.glb [--size WxH] [--points N] [--samples N] "
                         "[--cached-points N]\n");
            return 2;
        }
        Scene scene = load_gltf(options.scene);
        flatten_single_use_meshes(scene);
        densify_objects(scene);
        std::printf("%s\n", Benchmark(options, scene).run().dump(2).c_str());
    } catch (const std::exception& error) {
        std::fprintf(stderr, "error: guiding_benchmark: %s\n", error.what());
        return 1;
    }
    return 0;
}

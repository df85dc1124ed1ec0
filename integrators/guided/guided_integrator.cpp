#include "integrators/guided/guided_integrator.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "integrators/guided/combined_worker.h"
#include "integrators/guided/fraction_recorder.h"
#include "integrators/guided/highlights.h"
#include "integrators/guided/splatted_rays.h"
#include "integrators/path/recorded_worker.h"
#include "integrators/stopwatch.h"

namespace nephroid {

namespace {

/// Costs about a tenth of the samples and takes nearly all bright dots away: docs/guiding.md.
constexpr uint32_t usual_light_path_per = 16;
/// Where lobes are poor: most light comes by two and more reflections.
constexpr uint32_t often_light_path_per = 2;
constexpr double mostly_long = 0.5;

/// Share of the photons that must land where the picture looks.
constexpr double least_served = 1.0 / 256.0;

/// Of the photons' light: by two and more reflections.
double long_share(std::span<const CausticPhoton> photons) {
    double power = 0.0, by_long_paths = 0.0;
    for (const CausticPhoton& photon : photons) {
        power += double{photon.power};
        if (photon.reflections > 1) by_long_paths += double{photon.power};
    }
    return power > 0.0 ? by_long_paths / power : 0.0;
}

uint32_t light_path_per_for(std::span<const CausticPhoton> photons) {
    return long_share(photons) > mostly_long ? often_light_path_per : usual_light_path_per;
}

/// Fewer points than that with all of their paths are worse than many with lobes fitted to photons: a hundred lights.
constexpr uint32_t fewest_searched = 512;

/// Whether all lobes may come from photons.
bool photons_suffice(const GuidedSettings& settings) {
    return settings.lobe == LobeKind::slope && settings.long_paths == LongPaths::photons && settings.photons > 0.0;
}

template <class Mixture>
std::optional<GuideFacts> facts_of(const MixtureCache<Mixture>& mixtures, const Vec3& position, const Vec3& normal) {
    std::array<FoundPoint, Mixture::most_points> found;
    const size_t count = mixtures.cache.lookup.find(position, normal, found);
    if (count == 0) return std::nullopt;
    Mixture mixture(mixtures.cache, mixtures.options);
    mixture.clear();
    mixture.add(std::span(found).first(count), diffuse_guide_vertex(position, normal));
    mixture.prepare();
    return GuideFacts{std::sqrt(found[0].squared_distance), mixture.lobe_count(0), mixture.heaviest(0)};
}

}  // namespace

GuidedIntegrator::GuidedIntegrator(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                                   const GuidedSettings& settings)
    : context_(context) {
    const bool has_casters =
        std::find(casters.is_caster.begin(), casters.is_caster.end(), 1) != casters.is_caster.end();
    // A path through a caster scatters twice.
    if (!has_casters || casters.small_lights.empty() || context.max_depth < 2) return;
    if (settings.guide_fraction && *settings.guide_fraction <= 0.0F) return;
    Stopwatch stopwatch;
    GuidedPaths found = prepare_paths(context, casters, settings);
    statistics_.seconds_hierarchy = stopwatch.lap();
    Highlights highlights;
    if (settings.lobe == LobeKind::slope) highlights = find_highlights(context, found, view, settings);
    film_guide_ = std::move(highlights.film);
    statistics_.seconds_highlights = stopwatch.lap();
    const uint32_t wanted = wanted_points(view, settings);
    const uint32_t affordable = affordable_points(context, found, view, settings);
    found.is_searched = !photons_suffice(settings) || affordable >= std::min(fewest_searched, wanted);
    found.receivers = choose_receivers(context, view, found.is_searched ? affordable : wanted);
    statistics_.seconds_receivers = stopwatch.lap();
    search_paths(context, settings, found, statistics_);
    stopwatch.lap();
    const auto keep = [&]<class Mixture>(std::unique_ptr<MixtureCache<Mixture>>& kept, typename Mixture::Cache cache,
                                         const typename Mixture::Options& options) {
        statistics_.cached_points = cache.points.size();
        statistics_.lobes = cache.lobes.size();
        statistics_.bytes = cache.bytes();
        if (!cache.lobes.empty()) kept = std::make_unique<MixtureCache<Mixture>>(std::move(cache), options);
    };
    std::vector<CausticPhoton> photons;
    if (settings.lobe == LobeKind::slope) {
        SlopeMixtureOptions options;
        options.warp = settings.slope_warp;
        MadeSlopeCache made = make_slope_cache(context, found, highlights.mirrors, settings, statistics_);
        photons = std::move(made.photons);
        keep(slope_lobes_, std::move(made.cache), options);
        if (slope_lobes_ && !settings.guide_fraction) {
            fractions_ = std::make_unique<FractionLearner>(slope_lobes_->cache, std::move(made.expected));
        }
    } else {
        SgMixtureOptions options;
        options.warp = settings.sg_warp;
        keep(spherical_gaussians_, make_sg_cache(context, found, settings), options);
        statistics_.seconds_lobes = stopwatch.lap();
    }
    if (settings.adaptive && guide() != nullptr) {
        adaptive_ = std::make_unique<AdaptiveSampling>(view.crop);
        for (const FilmGuide::Pixel& pixel : film_guide_.pixels()) {
            adaptive_->start_with(pixel.x, pixel.y, pixel.positions);
        }
    }
    if (fractions_ && adaptive_) both_ = std::make_unique<LearnerPair>(*fractions_, *adaptive_);
    const uint32_t light_path_per =
        settings.light_path_per.value_or(light_paths_pay(casters) ? light_path_per_for(photons) : 0);
    if (light_path_per > 0) add_light_tracing(casters, view, light_path_per, photons);
}

// Photons are light paths, so they tell what light paths will do: pay, where enough of them land on what is seen. A
// perfect mirror's caustic of a light of no size has no other way to the picture.
bool GuidedIntegrator::light_paths_pay(const CasterReport& casters) const {
    for (size_t i = 0; i < casters.is_caster.size(); ++i) {
        if (casters.is_caster[i] == 0) continue;
        const Material& material = context_.surfaces.material(static_cast<uint32_t>(i));
        if (material.roughness * material.roughness < delta_alpha) return true;
    }
    const GuidedStatistics& s = statistics_;
    if (guide() == nullptr) return s.cached_points == 0;  // There was no time to look for a caustic.
    return s.photons == 0 || static_cast<double>(s.served_photons) > least_served * static_cast<double>(s.photons);
}

void GuidedIntegrator::add_light_tracing(const CasterReport& casters, const GuidedView& view, uint32_t one_in,
                                         std::span<const CausticPhoton> photons) {
    LightEmission emission(context_.scene, context_.lights, casters, EmissionAim::casters_only);
    if (!emission.emits()) return;
    emission.learn(splatted_rays(context_, photons, view.crop));
    const auto samples = static_cast<float>(light_paths_per_sample(view.width, view.height, view.crop));
    light_tracing_ = std::make_unique<LightTracing>(
        LightTracing{context_, std::move(emission), CameraProjection(context_.camera_rays), view.crop,
                     samples / static_cast<float>(one_in), false, one_in, guide(), adaptive_.get()});
}

const DirectionalGuide* GuidedIntegrator::guide() const {
    if (slope_lobes_) return &slope_lobes_->guide;
    return spherical_gaussians_ ? &spherical_gaussians_->guide : nullptr;
}

std::unique_ptr<IntegratorWorker> GuidedIntegrator::make_worker() const {
    const FilmGuide* film_guide = film_guide_.empty() ? nullptr : &film_guide_;
    if (fractions_ && light_tracing_) {
        return std::make_unique<RecordedWorker<CombinedWorker, FractionRecorder>>(*fractions_, film_guide,
                                                                                  *light_tracing_);
    }
    if (fractions_) {
        return std::make_unique<RecordedWorker<PathWorker, FractionRecorder>>(*fractions_, context_, guide(),
                                                                              film_guide, nullptr, adaptive_.get());
    }
    if (light_tracing_) return std::make_unique<CombinedWorker>(film_guide, *light_tracing_);
    return std::make_unique<PathWorker>(context_, guide(), film_guide, nullptr, adaptive_.get());
}

Learner* GuidedIntegrator::learner() const {
    if (both_) return both_.get();
    if (fractions_) return fractions_.get();
    return adaptive_.get();
}

std::optional<GuideFacts> GuidedIntegrator::facts_at(const Vec3& position, const Vec3& normal) const {
    if (slope_lobes_) return facts_of(*slope_lobes_, position, normal);
    if (spherical_gaussians_) return facts_of(*spherical_gaussians_, position, normal);
    return std::nullopt;
}

std::optional<IntegratorStatistics> GuidedIntegrator::statistics() const {
    const GuidedStatistics& s = statistics_;
    return IntegratorStatistics{"guiding",
                                {{"cached_points", s.cached_points},
                                 {"added_points", s.added_points},
                                 {"reflector_points", s.reflector_points},
                                 {"photons", s.photons},
                                 {"served_photons", s.served_photons},
                                 {"light_path_per", light_tracing_ ? uint64_t{light_tracing_->one_in} : 0},
                                 {"lobes", s.lobes},
                                 {"bytes", s.bytes},
                                 {"path_cuts_visited", s.search.nodes_visited},
                                 {"leaf_path_cuts", s.search.leaf_cuts},
                                 {"newton_solves", s.search.solves},
                                 {"newton_converged", s.search.exact + s.search.relaxed},
                                 {"representative_paths", s.paths},
                                 {"points_cut_short", s.search.cut_short},
                                 {"highlight_pixels", film_guide_.pixels().size()},
                                 {"lessons", fractions_ ? fractions_->lessons() : 0}},
                                {{"seconds_hierarchy", s.seconds_hierarchy},
                                 {"seconds_highlights", s.seconds_highlights},
                                 {"seconds_receivers", s.seconds_receivers},
                                 {"seconds_search", s.seconds_search},
                                 {"seconds_solve", s.seconds_solve},
                                 {"seconds_lobes", s.seconds_lobes},
                                 {"seconds_photons", s.seconds_photons},
                                 {"seconds_fractions", s.seconds_fractions},
                                 {"seconds_lessons", fractions_ ? fractions_->seconds() : 0.0},
                                 {"mean_fraction", slope_lobes_ ? mean_fraction(slope_lobes_->cache.points) : 0.0},
                                 {"mean_camera_paths", adaptive_ ? adaptive_->mean_paths() : 1.0}}};
}

}  // namespace nephroid

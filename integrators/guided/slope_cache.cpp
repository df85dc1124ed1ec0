#include "integrators/guided/slope_cache.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <utility>

#include "integrators/guided/guide_fraction.h"
#include "integrators/guided/reflector_points.h"
#include "integrators/guided/slope_lobe_maker.h"
#include "integrators/guided/uncovered_photons.h"
#include "integrators/stopwatch.h"

namespace nephroid {

namespace {

/// Lobes that bring less than this share of a point's light are dropped: they cost more time than they take noise away.
constexpr float least_weight_share = 0.003F;

/// Until moments have told a better one.
constexpr float trial_fraction = 0.5F;

/// At most so many points are added in a round, as a share of those before.
constexpr float most_added = 0.25F;

/// Photons of two and more reflections for each cached point, and how many times the paths of all photons these may
/// take.
constexpr double long_photons_per_point = 8.0;
constexpr uint32_t most_long_paths = 4;

/// Below that (second_moment_of_long_paths) light of several reflections is left to the BSDF. Measured: the plane of
/// alpha .05 .0005, where lobes of two reflections add noise, the next scene .7, the Ring 660.
constexpr double least_long_moment = 0.05;

/// Where dots bring less than that (PoorlyCovered::excess), another round takes more time than noise away.
constexpr double least_excess = 8.0;

/// The same for points on reflectors, and for those of them where the camera sees lamps mirrored twice.
constexpr float most_reflector_points = 0.0625F, most_mirrors = 0.03125F;

/// Of all paths of a receiver.
std::vector<CachedSlopeLobe<float>> lobes_of(const SlopeLobeMaker& maker, const GuidedPaths& found, size_t index) {
    std::vector<CachedSlopeLobe<float>> lobes;
    float total = 0.0F;
    for (const RepresentativePath& path : found.paths.of_receiver(index)) {
        const CachedSlopeLobe<float> lobe = maker.lobe_of(found.receivers[index], path);
        if (!(lobe.weight > 0.0F)) continue;
        lobes.push_back(lobe);
        total += lobe.weight;
    }
    std::erase_if(lobes, [&](const auto& lobe) { return lobe.weight < least_weight_share * total; });
    return lobes;
}

/// The first `most` that are further than their footprints from each other.
void add_apart(std::span<const Receiver> points, size_t most, std::vector<Receiver>& chosen) {
    const size_t first = chosen.size();
    for (const Receiver& point : points) {
        if (chosen.size() - first >= most) return;
        const auto is_near = [&](const Receiver& other) {
            return glm::length(other.position - point.position) < 0.5F * other.footprint;
        };
        if (std::none_of(chosen.begin() + static_cast<std::ptrdiff_t>(first), chosen.end(), is_near)) {
            chosen.push_back(point);
        }
    }
}

/// A cache in the making.
class SlopeCacheMaker {
  public:
    SlopeCacheMaker(const RenderContext& context, GuidedPaths& found, std::span<const Receiver> mirrors,
                    const GuidedSettings& settings, GuidedStatistics& statistics)
        : context_(context),
          found_(found),
          mirrors_(mirrors),
          settings_(settings),
          statistics_(statistics),
          maker_(context, found) {
        options_.warp = settings.slope_warp;
    }

    MadeSlopeCache run() {
        make_lobes();
        rebuild();
        statistics_.seconds_lobes = stopwatch_.lap();
        if (cache_.points.empty() || settings_.photons == 0.0 || is_over()) return made();
        trace_photons();
        if (found_.is_searched) {
            add_points();
            if (guides_long_light_) add_reflector_points();
        }
        if (wants_photon_lobes()) add_photon_lobes();
        if (!settings_.guide_fraction) choose_fractions();
        return made();
    }

  private:
    MadeSlopeCache made() { return {std::move(cache_), std::move(expected_), std::move(photons_)}; }

    /// Of the receivers that have none yet.
    void make_lobes() {
        const size_t before = lobes_.size();
        lobes_.resize(found_.receivers.size());
        tbb::parallel_for(before, lobes_.size(), [&](size_t i) { lobes_[i] = lobes_of(maker_, found_, i); });
    }

    void rebuild() {
        std::vector<CachedSlopeLobe<float>> all;
        cache_ = {};
        for (size_t i = 0; i < lobes_.size(); ++i) {
            cache_.points.push_back(make_cached_point(found_.receivers[i], all.size(), lobes_[i].size()));
            cache_.points[i].fraction = lobes_[i].empty() ? 0.0F : settings_.guide_fraction.value_or(trial_fraction);
            all.insert(all.end(), lobes_[i].begin(), lobes_[i].end());
        }
        cache_.lobes = LineArray<CachedSlopeLobe>(all);
        cache_.lookup = CachedPointLookup(cache_.points);
        cache_.leads_on = has_long_paths(found_);
        cache_.serves_reflectors = statistics_.reflector_points > 0;
    }

    void trace_photons() {
        const auto count = static_cast<uint32_t>(settings_.photons * static_cast<double>(found_.receivers.size()));
        photons_ = trace_caustic_photons(context_, found_, count, context_.max_depth - 1);
        coverage_ = measure_coverage(cache_, options_, photons_);
        guides_long_light_ =
            settings_.bounces > 1 && second_moment_of_long_paths(cache_, photons_, coverage_) > least_long_moment;
        if (wants_photon_lobes()) trace_long_photons(count);
        statistics_.photons = photons_.size();
        statistics_.served_photons = static_cast<size_t>(
            std::count_if(coverage_.begin(), coverage_.end(), [](const auto& at) { return at.bsdf_pdf > 0.0F; }));
        statistics_.seconds_photons = stopwatch_.lap();
    }

    /// Photons of several reflections are few, and they alone tell of such light: as many as lobes need.
    void trace_long_photons(uint32_t count) {
        std::vector<uint32_t> useful;
        for (uint32_t i = 0; i < photons_.size(); ++i) {
            if (photons_[i].reflections > 1 && coverage_[i].bsdf_pdf > 0.0F) useful.push_back(i);
        }
        const double enough = long_photons_per_point * static_cast<double>(found_.receivers.size());
        add_long_photons(context_, found_, useful, count, context_.max_depth - 1, enough, most_long_paths * count,
                         photons_);
        const std::span<const CausticPhoton> added = std::span(photons_).subspan(coverage_.size());
        const auto more = measure_coverage(cache_, options_, added);
        coverage_.insert(coverage_.end(), more.begin(), more.end());
    }

    void add_points() {
        for (uint32_t round = 0; round < settings_.refinements && !is_over(); ++round) {
            const PoorlyCovered poor = poorly_covered(cache_, photons_, coverage_, most(most_added));
            if (poor.points.empty() || poor.excess < least_excess) return;
            statistics_.added_points += poor.points.size();
            add(poor.points);
        }
    }

    void add_reflector_points() {
        if (is_over()) return;
        std::vector<Receiver> more =
            choose_reflector_points(context_, photons_, coverage_, most(most_reflector_points));
        add_apart(mirrors_, most(most_mirrors), more);
        statistics_.reflector_points = more.size();
        add(more);
    }

    size_t most(float share) const { return static_cast<size_t>(share * static_cast<float>(found_.receivers.size())); }

    void add(const std::vector<Receiver>& more) {
        if (more.empty()) return;
        add_receivers(context_, settings_, more, found_, statistics_);
        stopwatch_.lap();
        make_lobes();
        rebuild();
        coverage_ = measure_coverage(cache_, options_, photons_);
        statistics_.seconds_lobes += stopwatch_.lap();
    }

    void add_photon_lobes() {
        if (is_over()) return;
        const UncoveredPhotons uncovered(cache_, photons_, coverage_, !found_.is_searched);
        tbb::parallel_for(size_t{0}, lobes_.size(), [&](size_t i) {
            const auto more = uncovered.lobes_at(cache_.points[i]);
            lobes_[i].insert(lobes_[i].end(), more.begin(), more.end());
        });
        const size_t before = cache_.lobes.size();
        rebuild();
        cache_.leads_on = cache_.leads_on || cache_.lobes.size() > before;
        coverage_ = measure_coverage(cache_, options_, photons_);
        statistics_.seconds_photons += stopwatch_.lap();
    }

    void choose_fractions() {
        const std::vector<GuideTrial> trials =
            try_guide(context_, found_.receivers, cache_, options_, photons_, coverage_);
        expected_.resize(trials.size());
        for (size_t i = 0; i < trials.size(); ++i) {
            expected_[i] = trials[i].moments;
            cache_.points[i].other_radiance = trials[i].other_radiance;
            if (!lobes_[i].empty()) cache_.points[i].fraction = least_variance_fraction(expected_[i], trial_fraction);
        }
        statistics_.seconds_fractions = stopwatch_.lap();
    }

    bool wants_photon_lobes() const {
        return (guides_long_light_ && settings_.long_paths == LongPaths::photons) || !found_.is_searched;
    }

    bool is_over() const { return settings_.search_end && std::chrono::steady_clock::now() >= *settings_.search_end; }

    const RenderContext& context_;
    GuidedPaths& found_;
    std::span<const Receiver> mirrors_;
    const GuidedSettings& settings_;
    GuidedStatistics& statistics_;
    SlopeLobeMaker maker_;
    SlopeMixtureOptions options_;
    Stopwatch stopwatch_;
    SlopeCache cache_;
    std::vector<std::vector<CachedSlopeLobe<float>>> lobes_;  ///< Of each cached point.
    std::vector<CausticPhoton> photons_;
    std::vector<PhotonCoverage> coverage_;
    std::vector<OddsMoments> expected_;
    bool guides_long_light_ = false;  ///< Light of several reflections is asked for, and worth it.
};

}  // namespace

MadeSlopeCache make_slope_cache(const RenderContext& context, GuidedPaths& found, std::span<const Receiver> mirrors,
                                const GuidedSettings& settings, GuidedStatistics& statistics) {
    return SlopeCacheMaker(context, found, mirrors, settings, statistics).run();
}

}  // namespace nephroid

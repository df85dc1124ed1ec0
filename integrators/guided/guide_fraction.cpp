#include "integrators/guided/guide_fraction.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "core/rounding.h"
#include "core/warp.h"
#include "integrators/path/path_worker.h"

namespace nephroid {

namespace {

/// What a few paths tell about one cached point.
struct TrialSums {
    OddsMoments moments{};       ///< Of the estimate.
    double root_radiance = 0.0;  ///< Mean square root of what BSDF sampling finds off the lobes.
};

constexpr uint32_t path_count = 64;
constexpr size_t shared_points = 16;
constexpr size_t averaged_points = 256;  ///< For what photons tell.
/// Above so many times the BSDF's density, trial paths find the light well enough.
constexpr float most_covered = 32.0F;
constexpr uint32_t trial_seed = 0x6c8e9cf5U;

/// Tries fractions at one cached point after the other.
class FractionTrial {
  public:
    FractionTrial(const RenderContext& context, const SlopeCache& cache, const SlopeMixtureOptions& options)
        : lookup_(cache.lookup),
          mixtures_(cache, options),
          worker_(context, nullptr),
          rays_(path_count),
          seed_(context.seed ^ trial_seed) {}

    /// Second moments of one sample's estimate of the irradiance at a diffuse receiver, (W/m^2)^2 of luminance; zero
    /// where there are no lobes.
    TrialSums run(const Receiver& receiver, uint32_t index) {
        std::array<FoundPoint, SlopeMixtures::most_points> found;
        const size_t count = lookup_.find(receiver.position, receiver.geometric_normal, found);
        TrialSums sums;
        if (count == 0) return sums;
        mixtures_.clear();
        mixtures_.add(std::span(found).first(count),
                      diffuse_guide_vertex(receiver.position, receiver.geometric_normal));
        mixtures_.prepare();
        if (mixtures_.fraction(0) == 0.0F) return sums;
        other_count_ = 0;
        choose_directions(receiver, index);
        worker_.incident_radiance(rays_, seeds_, 0, samples_);
        for (size_t i = 0; i < rays_.count; ++i) add_sample(receiver, i, sums);
        if (other_count_ > 0) sums.root_radiance /= other_count_;
        return sums;
    }

  private:
    void choose_directions(const Receiver& receiver, uint32_t index) {
        const Frame<float> frame = make_frame(to_triple(receiver.geometric_normal));
        rays_.count = 0;
        for (uint32_t i = 0; i < path_count; ++i) {
            const uint32_t point_seed = pixel_seed(index, 0U, seed_);
            const auto [u, v] = sample_2d(SamplerKind::sobol, point_seed, i, 0);
            const float choice = sample_1d(SamplerKind::sobol, point_seed, i, 1);
            const Vec3 direction = choice < 0.5F ? mixtures_.sample(0, std::min(2.0F * choice, 0.999999F), u, v)
                                                 : to_vec3(frame.to_world(square_to_cosine_hemisphere(u, v)));
            if (!(glm::dot(receiver.geometric_normal, direction) > 0.0F)) continue;
            seeds_[rays_.count] = pixel_seed(index, i + 1, seed_);
            rays_.push(offset_ray_origin(receiver.position, receiver.error, receiver.geometric_normal, direction),
                       direction);
        }
    }

    void add_sample(const Receiver& receiver, size_t i, TrialSums& sums) {
        const float radiance = luminance(samples_.radiance_of(i));
        const Vec3 direction = rays_.direction(i);
        const double cosine = double{glm::dot(receiver.geometric_normal, direction)};
        const double integrand = double{radiance} * cosine;
        const float bsdf_pdf = static_cast<float>(cosine) * inv_pi, guide_pdf = mixtures_.pdf(0, direction);
        if (bsdf_pdf > guide_pdf) {
            // Roots, because single dots of light would tell too much about the rest.
            sums.root_radiance += std::sqrt(std::max(double{radiance}, 0.0));
            ++other_count_;
        }
        const double both = double{bsdf_pdf} + double{guide_pdf};
        const double moment = integrand * integrand / (0.5 * both * both);
        if (std::isfinite(moment)) sums.moments[odds_bin(guide_pdf, bsdf_pdf)] += moment;
    }

    const CachedPointLookup& lookup_;
    SlopeMixtures mixtures_;
    PathWorker worker_;
    RayBatch rays_;
    std::array<uint32_t, path_count> seeds_{};
    SampleBuffer samples_;
    uint32_t seed_;
    int other_count_ = 0;
};

/// Moments of the light that the guide leaves to the BSDF, which a few trial paths would not see: the mean over the
/// cached points around, for few photons tell of it either. Points lie along a Morton curve, but for the last ones,
/// which were added.
std::vector<OddsMoments> uncovered_moments(const SlopeCache& cache, const std::vector<CausticPhoton>& photons,
                                           const std::vector<PhotonCoverage>& coverage) {
    const size_t count = cache.points.size();
    std::vector<OddsMoments> up_to(count + 1);
    for (size_t i = 0; i < photons.size(); ++i) {
        const PhotonCoverage& at = coverage[i];
        if (!(most_covered * at.bsdf_pdf > at.guide_pdf)) continue;
        const double flux = double{photons[i].power} / double{cached_area(cache.points[at.nearest])};
        // Of radiance times cosine, where a trial path's w has its square over the sampling density and both together.
        const double moment = path_count * flux * double{photons[i].radiance} * double{at.bsdf_pdf * pi} /
                              (double{at.guide_pdf} + double{at.bsdf_pdf});
        up_to[at.nearest + 1][odds_bin(at.guide_pdf, at.bsdf_pdf)] += moment;
    }
    for (size_t i = 0; i < count; ++i) {
        for (size_t k = 0; k < odds_bins; ++k) up_to[i + 1][k] += up_to[i][k];
    }
    std::vector<OddsMoments> means(count);
    for (size_t i = 0; i < count; ++i) {
        const size_t first = i - std::min(i, averaged_points / 2), end = std::min(count, i + averaged_points / 2 + 1);
        for (size_t k = 0; k < odds_bins; ++k) {
            means[i][k] = (up_to[end][k] - up_to[first][k]) / static_cast<double>(end - first);
        }
    }
    return means;
}

}  // namespace

std::vector<GuideTrial> try_guide(const RenderContext& context, std::span<const Receiver> receivers,
                                  const SlopeCache& cache, const SlopeMixtureOptions& options,
                                  const std::vector<CausticPhoton>& photons,
                                  const std::vector<PhotonCoverage>& coverage) {
    tbb::enumerable_thread_specific<std::unique_ptr<FractionTrial>> threads;
    std::vector<TrialSums> trials(receivers.size());
    tbb::parallel_for(size_t{0}, receivers.size(), [&](size_t i) {
        auto& trial = threads.local();
        if (!trial) trial = std::make_unique<FractionTrial>(context, cache, options);
        trials[i] = trial->run(receivers[i], static_cast<uint32_t>(i));
    });
    const std::vector<OddsMoments> uncovered = uncovered_moments(cache, photons, coverage);
    std::vector<GuideTrial> results(receivers.size());
    for (size_t i = 0; i < receivers.size(); ++i) {
        std::array<FoundPoint, shared_points> found;
        const size_t count = cache.lookup.find(receivers[i].position, receivers[i].geometric_normal, found);
        OddsMoments& sums = results[i].moments = trials[i].moments;
        for (const FoundPoint& near : std::span(found).first(count)) {
            for (size_t k = 0; k < sums.size(); ++k) sums[k] += trials[near.index].moments[k];
        }
        for (size_t k = 0; k < sums.size(); ++k) sums[k] += static_cast<double>(count + 1) * uncovered[i][k];
        results[i].other_radiance = static_cast<float>(trials[i].root_radiance * trials[i].root_radiance);
    }
    return results;
}

}  // namespace nephroid

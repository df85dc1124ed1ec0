// Learns while rendering how much to guide at each cached point: the fraction of least variance, from what the
// camera's paths find. It knows what trial paths before rendering cannot: light that is too rare for them, what guided
// paths do after their first scattering, and what light paths take over.
//
// Fractions change at lessons alone, between passes, so that every sample's density is what all sides believe it to be
// and its expectation is right. Nothing of a sample enters its own fraction.
#pragma once

#include <vector>

#include "core/exact_float_sums.h"
#include "guiding/odds_moments.h"
#include "guiding/slope_mixture.h"
#include "integrators/learner.h"

namespace nephroid {

class FractionLearner final : public Learner {
  public:
    /// Keeps a reference to the cache, whose fractions it changes. `expected`: of each cached point
    /// (guide_fraction.h); empty: nothing is.
    FractionLearner(SlopeCache& cache, std::vector<OddsMoments> expected);

    /// A sample that found light, where the guide of the cached point had a say: its w, by odds_bin. Thread-safe.
    void record(uint32_t point, uint32_t bin, float moment) {
        moments_.add(odds_bins * size_t{point} + bin, moment);
        std::atomic_ref<uint64_t>(counts_[point]).fetch_add(1, std::memory_order_relaxed);
    }

    std::optional<uint32_t> next_lesson(uint32_t samples) const override;
    void learn(uint32_t samples) override;
    EarlierSamples earlier_samples() const override { return EarlierSamples::kept; }
    std::vector<uint8_t> state() const override;
    void restore(const std::vector<uint8_t>& state) override;

    uint64_t lessons() const { return lessons_; }
    double seconds() const { return seconds_; }  ///< Of lessons, this run only.

  private:
    OddsMoments bsdf_moments_around(size_t point) const;
    float fraction_at(uint32_t point) const;

    SlopeCache& cache_;
    std::vector<OddsMoments> expected_;
    ExactFloatSums moments_;         ///< By point and bin.
    std::vector<uint64_t> counts_;   ///< Samples that found light, by point.
    std::vector<OddsMoments> seen_;  ///< While learning: moments_.
    uint64_t lessons_ = 0;
    double seconds_ = 0.0;
};

/// Guide fraction of the points that have lobes; 0: none has.
double mean_fraction(const std::vector<CachedPoint>& points);

}  // namespace nephroid

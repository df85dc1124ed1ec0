#include "integrators/guided/fraction_learner.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <numeric>
#include <span>
#include <utility>

#include "core/byte_stream.h"
#include "integrators/stopwatch.h"

namespace nephroid {

namespace {

/// Fractions are known well enough by then, and recording is not free.
constexpr uint32_t last_lesson = 64;

/// Cached points that learn together: one sees few samples, and a bright one must not decide alone.
constexpr size_t shared_points = 16;

/// The same for directions that the BSDF prefers: what they find is smoother in space, but for bright samples so rare
/// that most neighbourhoods have not met theirs yet. Points lie along a Morton curve, but for the last ones.
constexpr size_t averaged_points = 256;

/// A point whose moment by the guide is more than so many times the median of its neighbourhood counts as so many: some
/// of it is one bright sample.
constexpr double most_over_median = 4.0;

/// What was expected before rendering counts as so many samples of a neighbourhood.
constexpr double samples_expected = 64.0;

/// From here on the guide prefers the direction.
constexpr size_t first_guide_bin = odds_bins / 2;

double total_of(const OddsMoments& moments) {
    return std::accumulate(moments.begin(), moments.end(), 0.0);
}

/// Of the values, which may be none; they are left as they are.
double median(std::span<const double> values) {
    std::array<double, shared_points> sorted{};
    std::copy(values.begin(), values.end(), sorted.begin());
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.begin() + static_cast<std::ptrdiff_t>(values.size()));
    return *middle;
}

double guide_total_of(const OddsMoments& moments) {
    return std::accumulate(moments.begin() + first_guide_bin, moments.end(), 0.0);
}

void add_scaled(OddsMoments& sum, const OddsMoments& moments, double scale) {
    for (size_t bin = 0; bin < odds_bins; ++bin) sum[bin] += scale * moments[bin];
}

/// Adds the moments at a scale of their own: as those of so many samples of weight one.
void add_share(OddsMoments& sum, const OddsMoments& moments, double samples) {
    const double total = total_of(moments);
    if (total > 0.0) add_scaled(sum, moments, samples / total);
}

}  // namespace

double mean_fraction(const std::vector<CachedPoint>& points) {
    double sum = 0.0, count = 0.0;
    for (const CachedPoint& point : points) {
        if (point.lobe_count == 0) continue;
        sum += double{point.fraction};
        count += 1.0;
    }
    return count > 0.0 ? sum / count : 0.0;
}

FractionLearner::FractionLearner(SlopeCache& cache, std::vector<OddsMoments> expected)
    : cache_(cache), expected_(std::move(expected)), counts_(cache.points.size()) {
    moments_.resize(odds_bins * cache.points.size());
}

std::optional<uint32_t> FractionLearner::next_lesson(uint32_t samples) const {
    if (samples >= last_lesson) return std::nullopt;
    return std::bit_ceil(samples + 1);
}

void FractionLearner::learn(uint32_t) {
    Stopwatch stopwatch;
    seen_.resize(counts_.size());
    tbb::parallel_for(size_t{0}, seen_.size(), [&](size_t i) {
        for (size_t bin = 0; bin < odds_bins; ++bin) seen_[i][bin] = moments_.sum(odds_bins * i + bin);
    });
    tbb::parallel_for(size_t{0}, cache_.points.size(), [&](size_t i) {
        CachedPoint& point = cache_.points[i];
        if (point.lobe_count > 0) point.fraction = fraction_at(static_cast<uint32_t>(i));
    });
    ++lessons_;
    seconds_ += stopwatch.lap();
}

// Of the BSDF's bins. One point never counts for more than all others.
OddsMoments FractionLearner::bsdf_moments_around(size_t point) const {
    const size_t first = point - std::min(point, averaged_points / 2);
    const size_t end = std::min(seen_.size(), point + averaged_points / 2 + 1);
    OddsMoments sum{};
    double samples = 0.0, total = 0.0, most = 0.0;
    size_t brightest = first;
    for (size_t i = first; i < end; ++i) {
        add_scaled(sum, seen_[i], 1.0);
        samples += static_cast<double>(counts_[i]);
        const double here = total_of(seen_[i]) - guide_total_of(seen_[i]);
        total += here;
        if (!(here > most)) continue;
        most = here;
        brightest = i;
    }
    if (most > total - most) add_scaled(sum, seen_[brightest], (total - most) / most - 1.0);
    OddsMoments mean{};
    for (size_t bin = 0; bin < first_guide_bin && samples > 0.0; ++bin) mean[bin] = std::max(sum[bin], 0.0) / samples;
    return mean;
}

float FractionLearner::fraction_at(uint32_t point) const {
    const CachedPoint& at = cache_.points[point];
    std::array<FoundPoint, shared_points> found;
    const auto near = std::span(found).first(cache_.lookup.find(at.position, at.normal, found));
    std::array<double, shared_points> totals{};
    double samples = 0.0;
    for (size_t i = 0; i < near.size(); ++i) {
        totals[i] = guide_total_of(seen_[near[i].index]);
        samples += static_cast<double>(counts_[near[i].index]);
    }
    const double most = most_over_median * median(std::span(totals).first(near.size()));
    OddsMoments seen{};
    for (size_t i = 0; i < near.size(); ++i) {
        add_scaled(seen, seen_[near[i].index], totals[i] > most ? most / totals[i] : 1.0);
    }
    const OddsMoments around = bsdf_moments_around(point);
    for (size_t bin = 0; bin < first_guide_bin; ++bin) seen[bin] = samples * around[bin];
    OddsMoments moments{};
    add_share(moments, seen, samples);
    if (!expected_.empty()) add_share(moments, expected_[point], samples_expected);
    return least_variance_fraction(moments, at.fraction);
}

std::vector<uint8_t> FractionLearner::state() const {
    ByteWriter writer;
    writer.value(lessons_);
    writer.array(moments_.sums());
    writer.array(counts_);
    std::vector<float> fractions;
    for (const CachedPoint& point : cache_.points) fractions.push_back(point.fraction);
    writer.array(fractions);
    return writer.take();
}

// With a time limit, the cache that was made this time may have other points: they learn anew.
void FractionLearner::restore(const std::vector<uint8_t>& state) {
    ByteReader reader(state);
    const auto lessons = reader.value<uint64_t>();
    std::vector<ExactFloatSums::Sum> sums;
    std::vector<uint64_t> counts;
    std::vector<float> fractions;
    reader.array(sums);
    reader.array(counts);
    reader.array(fractions);
    if (fractions.size() != cache_.points.size()) return;
    lessons_ = lessons;
    moments_.sums() = std::move(sums);
    counts_ = std::move(counts);
    for (size_t i = 0; i < fractions.size(); ++i) cache_.points[i].fraction = fractions[i];
}

}  // namespace nephroid

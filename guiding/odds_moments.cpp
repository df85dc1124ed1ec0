#include "guiding/odds_moments.h"

#include <cmath>
#include <numeric>

namespace nephroid {

namespace {

/// r of a bin: at the middle of its odds.
double guide_share(size_t bin) {
    const double odds = std::exp2(2.0 * static_cast<double>(bin) - 7.0);
    return odds / (1.0 + odds);
}

/// Derivative of the second moment by the fraction; it rises.
double slope(const OddsMoments& moments, double fraction) {
    double sum = 0.0;
    for (size_t bin = 0; bin < odds_bins; ++bin) {
        const double r = guide_share(bin);
        const double density = fraction * r + (1.0 - fraction) * (1.0 - r);
        sum -= moments[bin] * (2.0 * r - 1.0) / (density * density);
    }
    return sum;
}

}  // namespace

double second_moment(const OddsMoments& moments, double fraction) {
    double sum = 0.0;
    for (size_t bin = 0; bin < odds_bins; ++bin) {
        const double r = guide_share(bin);
        sum += moments[bin] / (fraction * r + (1.0 - fraction) * (1.0 - r));
    }
    return sum;
}

// The moment is convex in the fraction.
float least_variance_fraction(const OddsMoments& moments, float otherwise) {
    if (!(std::accumulate(moments.begin(), moments.end(), 0.0) > 0.0)) return otherwise;
    double low = double{least_guide_fraction}, high = double{largest_guide_fraction};
    constexpr int halvings = 12;
    for (int i = 0; i < halvings; ++i) {
        const double middle = 0.5 * (low + high);
        (slope(moments, middle) < 0.0 ? low : high) = middle;
    }
    return static_cast<float>(0.5 * (low + high));
}

}  // namespace nephroid

#include "tests/statistics.h"

#include <algorithm>
#include <cstdio>

#include "core/frame.h"
#include "core/sampler.h"

namespace nephroid::testing {

double chi_square_tail(double chi2, double degrees_of_freedom) {
    const double k = 2.0 / (9.0 * degrees_of_freedom);
    return normal_tail((std::cbrt(chi2 / degrees_of_freedom) - (1.0 - k)) / std::sqrt(k));
}

double critical_z(double significance) {
    double low = 0.0;
    double high = 40.0;
    for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (2.0 * normal_tail(middle) > significance ? low : high) = middle;
    }
    return high;
}

namespace {

constexpr int angle_bins = 48;
constexpr int azimuth_bins = 24;
constexpr int subdivisions = 12;  // Per bin and axis, midpoint rule.

/// Bins in y = log(1 - cos): the first holds everything closer than the smallest angle.
struct Bins {
    double log_smallest;
    double step;

    explicit Bins(double smallest_angle)
        : log_smallest(std::log(0.5 * smallest_angle * smallest_angle)),
          step((std::log(2.0) - log_smallest) / (angle_bins - 1)) {}
    int index(double one_minus_cos) const {
        if (!(one_minus_cos > 0.0)) return 0;
        const double y = (std::log(one_minus_cos) - log_smallest) / step;
        return std::clamp(static_cast<int>(std::floor(y)) + 1, 0, angle_bins - 1);
    }
    double lower(int i) const { return i == 0 ? 0.0 : std::exp(log_smallest + step * (i - 1)); }
};

double integrate_bin(const std::function<double(const Vec3&)>& pdf, const Frame<double>& frame, const Bins& bins, int i,
                     int j) {
    double sum = 0.0;
    const double begin = bins.lower(i);
    const double width = bins.lower(i + 1) - begin;
    for (int a = 0; a < subdivisions; ++a) {
        const double one_minus_cos = begin + width * (a + 0.5) / subdivisions;
        const double radius = std::sqrt(std::max(one_minus_cos * (2.0 - one_minus_cos), 0.0));
        for (int b = 0; b < subdivisions; ++b) {
            const double phi = 2.0 * M_PI * (j + (b + 0.5) / subdivisions) / azimuth_bins;
            const Triple<double> d =
                frame.to_world({radius * std::cos(phi), radius * std::sin(phi), 1.0 - one_minus_cos});
            sum += pdf(Vec3(d.x, d.y, d.z));
        }
    }
    return sum * width * 2.0 * M_PI / azimuth_bins / (subdivisions * subdivisions);
}

}  // namespace

ChiSquareResult chi_square_directions(const std::function<DirectionDraw(Vec2 u, float u_choice)>& sample,
                                      const std::function<double(const Vec3&)>& pdf, const Vec3& focus,
                                      double smallest_angle, int draws) {
    const Frame<double> frame = make_frame(normalized(Triple<double>{focus.x, focus.y, focus.z}));
    const Bins bins(smallest_angle);
    std::vector<double> observed(angle_bins * azimuth_bins, 0.0);
    int valid = 0;
    for (int i = 0; i < draws; ++i) {
        const auto index = static_cast<uint32_t>(i);
        const auto [x, y] = sample_2d(SamplerKind::independent, 1234567U, index, 0);
        const DirectionDraw draw = sample({x, y}, sample_1d(SamplerKind::independent, 1234567U, index, 1));
        if (!draw.ok) continue;
        ++valid;
        const Triple<double> local = frame.to_local({draw.direction.x, draw.direction.y, draw.direction.z});
        // 1 - cos from the chord: exact for small angles, where 1 - local.z has no digits.
        const double chord2 = local.x * local.x + local.y * local.y + (local.z - 1.0) * (local.z - 1.0);
        double phi = std::atan2(local.y, local.x) / (2.0 * M_PI);
        phi -= std::floor(phi);
        const int j = std::min(static_cast<int>(phi * azimuth_bins), azimuth_bins - 1);
        observed[static_cast<size_t>(bins.index(0.5 * chord2) * azimuth_bins + j)] += 1.0;
    }

    ChiSquareResult result;
    result.sampled_share = static_cast<double>(valid) / draws;
    double chi2 = 0.0;
    double pooled_expected = 0.0;
    double pooled_observed = 0.0;
    double worst = 0.0;
    int cells = 0;
    const auto add_cell = [&](double expected, double found, int i, int j) {
        const double term = (found - expected) * (found - expected) / expected;
        chi2 += term;
        ++cells;
        if (term > worst) {
            worst = term;
            char text[160];
            std::snprintf(text, sizeof(text), "angle bin %d (from %.3g rad), azimuth bin %d: expected %.1f, found %.0f",
                          i, std::sqrt(2.0 * bins.lower(i)), j, expected, found);
            result.worst_bin = text;
        }
    };
    for (int i = 0; i < angle_bins; ++i) {
        for (int j = 0; j < azimuth_bins; ++j) {
            const double mass = integrate_bin(pdf, frame, bins, i, j);
            result.integral += mass;
            const double found = observed[static_cast<size_t>(i * azimuth_bins + j)];
            // Cells with little mass are pooled: the statistic needs about ten counts a cell.
            if (mass * draws >= 20.0) {
                add_cell(mass * draws, found, i, j);
            } else {
                pooled_expected += mass * draws;
                pooled_observed += found;
            }
        }
    }
    if (pooled_expected >= 20.0) {
        add_cell(pooled_expected, pooled_observed, -1, -1);
    } else if (pooled_observed > pooled_expected + 40.0) {
        add_cell(std::max(pooled_expected, 1.0), pooled_observed, -1, -1);
    }
    result.degrees_of_freedom = std::max(cells - 1, 1);
    result.p_value = chi_square_tail(chi2, result.degrees_of_freedom);
    return result;
}

}  // namespace nephroid::testing

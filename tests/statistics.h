// Statistical tests: chi-square of samplers against densities, z-scores with the Sidak correction.
#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "core/vec.h"

namespace nephroid::testing {

/// Probability that a standard normal variable exceeds z.
inline double normal_tail(double z) {
    return 0.5 * std::erfc(z / std::sqrt(2.0));
}

/// Upper tail of the chi-square distribution (Wilson and Hilferty's cube-root normal approximation; good to a few per
/// cent of the p-value for 10 degrees of freedom and more).
double chi_square_tail(double chi2, double degrees_of_freedom);

/// Significance for one of `tests` tests such that all together have `alpha`.
inline double sidak(double alpha, double tests) {
    return 1.0 - std::pow(1.0 - alpha, 1.0 / tests);
}

/// |z| that a fair result exceeds with probability `significance` (two-sided).
double critical_z(double significance);

struct ChiSquareResult {
    double p_value = 0.0;
    double degrees_of_freedom = 0.0;
    double sampled_share = 0.0;  ///< Of all draws that were valid directions.
    double integral = 0.0;       ///< Of the density over the sphere.
    std::string worst_bin;       ///< Where the largest deviation is, for the failure message.
};

/// A drawn direction; ok = false: the sampler failed (absorbed), which the density must not account for.
struct DirectionDraw {
    Vec3 direction;
    bool ok = true;
};

/// Compares `draws` directions with a density per solid angle, on bins about `focus` that are uniform in azimuth and in
/// log(1 - cos) down to `smallest_angle` (radians), so that narrow lobes are resolved as well as wide ones.
ChiSquareResult chi_square_directions(const std::function<DirectionDraw(Vec2 u, float u_choice)>& sample,
                                      const std::function<double(const Vec3&)>& pdf, const Vec3& focus,
                                      double smallest_angle, int draws = 400000);

}  // namespace nephroid::testing

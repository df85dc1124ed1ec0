// How far a half vector may be from the normal for a glossy surface still to reflect noticeably.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace nephroid {

/// Below, a surface is a perfect mirror; a lobe of this roughness stands for it wherever roughness is a unit or a
/// width.
inline constexpr double smallest_alpha = 1e-4;

/// 1 - cos(theta) of the largest angle between half vector and shading normal: where the spherical Gaussian that stands
/// for the normal distribution of roughness `alpha` (> 0) has fallen to `epsilon` (Eq. 1, Li et al. 2022). In [0, 2]:
/// 2, which accepts everything, where the formula's cosine falls below -1 (rough surfaces), and 0, which accepts exact
/// solutions alone, where the lobe is nowhere above epsilon.
///
/// Not the cosine itself, which cannot tell the angles of small alpha from zero in float.
inline double acceptance_one_minus_cos(double alpha, double epsilon) {
    constexpr double pi_double = 3.14159265358979323846;
    return std::clamp(-0.5 * alpha * alpha * std::log(epsilon * pi_double * alpha * alpha), 0.0, 2.0);
}

/// The same as a slope, tan(theta): infinite from a right angle on.
inline double acceptance_slope(double alpha, double epsilon) {
    const double m = acceptance_one_minus_cos(alpha, epsilon);
    return m < 1.0 ? std::sqrt(m * (2.0 - m)) / (1.0 - m) : std::numeric_limits<double>::infinity();
}

}  // namespace nephroid

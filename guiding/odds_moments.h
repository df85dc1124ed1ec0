// The guide's probability of least variance, from samples of any other probability.
//
// A vertex draws directions with density p_b = b g + (1 - b) f, of the guide's density g, the BSDF's f and the fraction
// b. A sample drawn with density p that brought C (what it found, over p) estimates the second moment that another
// fraction b would have: C^2 p / p_b (importance sampling of the moment; Owen and Zhou, "Safe and Effective Importance
// Sampling", 2000, choose mixtures by it too). That is w / (b r + (1 - b) (1 - r)) with w = C^2 p / (f + g) and
// r = g / (f + g). So w is summed by the odds g / f, in a few bins: one addition a sample, and any fraction can be
// judged afterwards.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

namespace nephroid {

/// Powers of four from 4^-4 to 4^4.
inline constexpr size_t odds_bins = 8;

/// Sums of w by odds_bin.
using OddsMoments = std::array<double, odds_bins>;

/// Densities not negative, not both zero.
inline size_t odds_bin(float guide_pdf, float bsdf_pdf) {
    constexpr float least = 0x1p-8F, most = 0x1p7F;
    const float odds = std::clamp(guide_pdf / std::max(bsdf_pdf, 1e-30F), least, most);
    constexpr uint32_t mantissa_bits = 23, exponent_of_least = 127 - 8;
    return ((std::bit_cast<uint32_t>(odds) >> mantissa_bits) - exponent_of_least) / 2;
}

/// The guide's probability never leaves this range: what has been seen of the light may be little.
inline constexpr float least_guide_fraction = 0.05F;
inline constexpr float largest_guide_fraction = 0.95F;

/// Second moment of one sample where the guide has the probability `fraction`, times the number of samples.
double second_moment(const OddsMoments& moments, double fraction);

/// The fraction of the least second moment; `otherwise` where all moments are zero.
float least_variance_fraction(const OddsMoments& moments, float otherwise);

}  // namespace nephroid

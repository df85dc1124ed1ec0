// The probability of the BSDF against the guide, learned by gradient descent on the Kullback-Leibler divergence
// (Mueller, "Practical Path Guiding in Production", SIGGRAPH 2019 course "Path Guiding in Production").
//
// With product p = f L cos, sampled with density q, the divergence of the mixture from the ideal density is, but for a
// constant, -sum (p / q) log(a b + (1 - a) g) for the BSDF's density b, the guide's g and the fraction a. It depends on
// b and g by r = b / (b + g) alone, but for another constant. So samples are summed by r, in a few bins, and the
// descent runs on the sums: in any order of samples, with the same result. docs/ppg.md tells what that changes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace nephroid {

inline constexpr size_t choice_bins = 16;

/// Bin of r; 0 <= r <= 1.
inline size_t choice_bin(float bsdf_share) {
    return std::min(static_cast<size_t>(bsdf_share * static_cast<float>(choice_bins)), choice_bins - 1);
}

/// Neither of both ever gets less: what a leaf knows may be wrong.
inline constexpr float least_choice_probability = 0.2F;

/// The fraction a that Adam (Kingma and Ba 2015) finds, on a = 1 / (1 + exp(-x)), from `fraction` on; `weights` has the
/// sums of p / q by choice_bin. Unchanged where all weights are zero.
float learn_bsdf_fraction(std::span<const double, choice_bins> weights, float fraction);

}  // namespace nephroid

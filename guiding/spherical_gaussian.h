// Spherical Gaussians: lobes over directions that can be multiplied and integrated in closed form.
//
//   G(v) = amplitude exp(sharpness (axis.v - 1))      (Eq. 2, Li et al. 2022)
//
// Written so that sharpness 1e-3 to 1e9 works in float: axis.v - 1 is computed as -|v - axis|^2 / 2, which keeps the
// digits that a cosine near one has lost, and sampling draws 1 - cos(theta), never cos(theta). Templates over F = float
// or double.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/frame.h"

namespace nephroid {

template <class F>
struct SphericalGaussian {
    Triple<F> axis;  ///< Unit.
    F sharpness;     ///< > 0.
    F amplitude;     ///< Value along the axis, in whatever unit the lobe describes.
};

/// axis.v - 1 of two unit vectors, in [-2, 0].
template <class F>
F cosine_minus_one(const Triple<F>& axis, const Triple<F>& v) {
    const Triple<F> difference = v - axis;
    return F(-0.5) * dot(difference, difference);
}

template <class F>
F evaluate(const SphericalGaussian<F>& lobe, const Triple<F>& v) {
    return lobe.amplitude * std::exp(lobe.sharpness * cosine_minus_one(lobe.axis, v));
}

/// Integral over the sphere of a lobe of amplitude one, sr: 4 pi at sharpness zero, 2 pi / sharpness for sharp lobes.
template <class F>
F unit_integral(F sharpness) {
    constexpr F two_pi = F(6.283185307179586);
    if (!(sharpness > F(0))) return F(2) * two_pi;
    return -two_pi * std::expm1(F(-2) * sharpness) / sharpness;
}

template <class F>
F integral(const SphericalGaussian<F>& lobe) {
    return lobe.amplitude * unit_integral(lobe.sharpness);
}

/// A direction about `axis` with density exp(sharpness (axis.v - 1)) / unit_integral(sharpness) per solid angle; u and
/// v in [0, 1).
template <class F>
Triple<F> sample_spherical_gaussian(const Triple<F>& axis, F sharpness, F u, F v) {
    const F one_minus_cos =
        sharpness > F(0) ? std::min(-std::log1p(u * std::expm1(F(-2) * sharpness)) / sharpness, F(2)) : F(2) * u;
    const F radius = safe_sqrt(one_minus_cos * (F(2) - one_minus_cos));
    const F angle = F(6.283185307179586) * v;
    const Frame<F> frame = make_frame(axis);
    return frame.s * (radius * std::cos(angle)) + frame.t * (radius * std::sin(angle)) + axis * (F(1) - one_minus_cos);
}

/// The product of two lobes, which is one. Where the axes are opposite and the sharpness equal, it is constant: its
/// sharpness is then zero and its axis that of a.
template <class F>
SphericalGaussian<F> product(const SphericalGaussian<F>& a, const SphericalGaussian<F>& b) {
    const Triple<F> sum = a.axis * a.sharpness + b.axis * b.sharpness;
    const F sharpness = square_root(dot(sum, sum));
    const F total = sharpness + a.sharpness + b.sharpness;
    // sharpness - a.sharpness - b.sharpness, without the cancellation; <= 0.
    const F exponent =
        total > F(0) ? F(2) * a.sharpness * (b.sharpness / total) * cosine_minus_one(a.axis, b.axis) : F(0);
    const Triple<F> axis = sharpness > F(0) ? sum * (F(1) / sharpness) : a.axis;
    return {axis, sharpness, a.amplitude * b.amplitude * std::exp(exponent)};
}

}  // namespace nephroid

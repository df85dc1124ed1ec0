// Maps of the unit square to other domains, with their densities.
#pragma once

#include "core/simd.h"

namespace nephroid {

/// Cosine-weighted direction about +z; density cos(theta) / pi per solid angle.
template <class F>
Triple<F> square_to_cosine_hemisphere(const F& u, const F& v) {
    F sine, cosine;
    sincos_turn(v, sine, cosine);
    const F radius = square_root(u);
    return {radius * cosine, radius * sine, square_root(F(1.0F) - u)};
}
template <class F>
F cosine_hemisphere_pdf(const F& cos_theta) {
    return maximum(cos_theta, F(0.0F)) * F(inv_pi);
}

/// Uniform direction; density 1 / (4 pi) per solid angle.
template <class F>
Triple<F> square_to_uniform_sphere(const F& u, const F& v) {
    F sine, cosine;
    sincos_turn(v, sine, cosine);
    const F z = F(1.0F) - F(2.0F) * u;
    const F radius = F(2.0F) * square_root(u * (F(1.0F) - u));
    return {radius * cosine, radius * sine, z};
}

/// Uniform direction in the cone about +z with the given 1 - cos(half angle), which keeps its digits where the cone is
/// narrow; density uniform_cone_pdf.
template <class F>
Triple<F> square_to_uniform_cone(const F& u, const F& v, const F& one_minus_cos_max) {
    F sine, cosine;
    sincos_turn(v, sine, cosine);
    const F one_minus_z = u * one_minus_cos_max;
    const F radius = safe_sqrt(one_minus_z * (F(2.0F) - one_minus_z));
    return {radius * cosine, radius * sine, F(1.0F) - one_minus_z};
}
template <class F>
F uniform_cone_pdf(const F& one_minus_cos_max) {
    return F(0.5F * inv_pi) / one_minus_cos_max;
}

/// Barycentric weights (of vertices 1 and 2) of a uniform point of a triangle: the square is folded along its
/// diagonal without distorting areas (Heitz 2019).
inline Vec2 square_to_triangle(Vec2 u) {
    if (u.y > u.x) {
        u.x *= 0.5F;
        u.y -= u.x;
    } else {
        u.y *= 0.5F;
        u.x -= u.y;
    }
    return u;
}

}  // namespace nephroid

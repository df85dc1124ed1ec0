// Lobes in the reflector's slope space: the material's own profile, mapped to directions at the receiver by the
// Jacobian of the half-vector constraint (lobes.md, Sec. 2).
//
// A glossy reflector sends light from y to x in proportion to its normal distribution at the slope C(y) that the half
// vector has against the normal. With C(y0 + delta) = C(y0) + J delta, the directions w from x follow
//
//   p(w) = P22(J delta(w)) |det J| |d delta / d w|,   P22(m) = 1 / (pi a^2 (1 + |m|^2 / a^2)^2)
//
// where P22 is GGX's distribution of slopes of width a. In gnomonic coordinates about w0, the direction to y0, delta is
// linear in the direction's tangent, so that with two rows k1, k2 across w0 (J, the foreshortening and 1 / a in one)
//
//   m = (k1.w, k2.w) / (w0.w),   p(w) = |det K| / (pi (1 + |m|^2)^2 (w0.w)^3)      per solid angle, w0.w > 0
//
// which integrates to one for any invertible K: whatever rounding or a bad Jacobian did to it, the estimator that
// divides by it is unbiased. That is why float suffices here, down to alpha 1e-4; but where K is as good as singular,
// samples are not where the density says (is_usable). Templates over F = float or FloatV.
#pragma once

#include <cmath>

#include "core/simd.h"
#include "core/vec.h"

namespace nephroid {

/// A lobe at a shading point.
template <class F>
struct SlopeLobe {
    Triple<F> axis;        ///< w0, unit.
    Triple<F> row1, row2;  ///< k1 and k2; dimensionless, large for narrow lobes. Across the axis where w0 is the
                           ///< lobe's centre; otherwise it lies where both vanish.

    /// |det K|.
    F determinant() const { return absolute(dot(axis, cross(row1, row2))); }
};

/// Whether samples follow the density in float. Not where the lobe is so wide in a direction that samples end on the
/// gnomonic plane's horizon, nor where it is so much narrower in another that their rounding there is a width: both
/// have been seen to brighten pictures. Nor where anything is infinite or NaN.
template <class F>
MaskOf<F> is_usable(const SlopeLobe<F>& lobe) {
    constexpr float widest = 20.0F, most_anisotropic = 1e5F, most_determinant = 1e30F;
    const F determinant = lobe.determinant();
    // Of singular values: their product, about the square of the larger one.
    const F squared = dot(lobe.row1, lobe.row1) + dot(lobe.row2, lobe.row2);
    return (determinant * determinant > squared * F(1.0F / (widest * widest))) &&
           (determinant > squared * F(1.0F / most_anisotropic)) && (determinant < F(most_determinant)) &&
           (dot(lobe.axis, lobe.axis) < F(2.0F));
}

/// The same lobe with rows that are orthogonal (a Jacobi rotation; slopes' length is all that counts). Its centre is
/// the rows' cross product, which has few digits where they are nearly parallel: not enough for a narrow lobe.
template <class F>
SlopeLobe<F> with_orthogonal_rows(const SlopeLobe<F>& lobe) {
    const F one(1.0F);
    const F p = dot(lobe.row1, lobe.row1), q = dot(lobe.row2, lobe.row2), r = dot(lobe.row1, lobe.row2);
    const auto is_orthogonal = absolute(r) <= (p + q) * F(1e-12F);
    const F half_cotangent = (q - p) / (select(is_orthogonal, one, r) * F(2.0F));
    const F size = one / (absolute(half_cotangent) + square_root(one + half_cotangent * half_cotangent));
    const F tangent = select(is_orthogonal, F(0.0F), select(half_cotangent < F(0.0F), -size, size));
    const F cosine = one / square_root(one + tangent * tangent), sine = tangent * cosine;
    return {lobe.axis, lobe.row1 * cosine - lobe.row2 * sine, lobe.row1 * sine + lobe.row2 * cosine};
}

/// Density of GGX's slopes at squared length `squared` in units of the width, per squared unit, times pi.
template <class F>
F slope_profile(const F& squared) {
    const F t = F(1.0F) + squared;
    return F(1.0F) / (t * t);
}

/// The wide defensive copy that is mixed into every lobe: it catches what a curved surface does beyond J.
inline constexpr float wide_share = 0.15F;
inline constexpr float wide_factor = 5.0F;

/// Density of a lobe with its wide copy, over |det K| / pi; zero behind the gnomonic plane.
template <class F>
F relative_density(const SlopeLobe<F>& lobe, const Triple<F>& w) {
    const F cosine = dot(lobe.axis, w);
    const F inverse = F(1.0F) / maximum(cosine, F(1e-6F));
    const F m1 = dot(lobe.row1, w) * inverse, m2 = dot(lobe.row2, w) * inverse;
    const F squared = m1 * m1 + m2 * m2;
    constexpr float wide_area = wide_factor * wide_factor;
    const F profile = slope_profile(squared) * F(1.0F - wide_share) +
                      slope_profile(squared * F(1.0F / wide_area)) * F(wide_share / wide_area);
    return select(cosine > F(1e-6F), profile * inverse * inverse * inverse, F(0.0F));
}

/// The direction at slope m, in units of the width; unit. det K must not be zero.
inline Vec3 direction_at_slope(const SlopeLobe<float>& lobe, const Vec2& m) {
    const Vec3 axis = to_vec3(lobe.axis), k1 = to_vec3(lobe.row1), k2 = to_vec3(lobe.row2);
    const Vec3 centre = glm::cross(k1, k2);
    const Vec3 along = centre + m.x * glm::cross(k2, axis) + m.y * glm::cross(axis, k1);
    return glm::normalize(along / glm::dot(axis, centre));
}

/// A direction with density relative_density |det K| / pi. u_width chooses between the lobe and its wide copy; all in
/// [0, 1).
inline Vec3 sample_slope_lobe(const SlopeLobe<float>& lobe, float u_width, float u, float v) {
    const float radius = std::sqrt(u / (1.0F - u)) * (u_width < wide_share ? wide_factor : 1.0F);
    float sine = 0.0F, cosine = 0.0F;
    sincos_turn(v, sine, cosine);
    return direction_at_slope(lobe, {radius * cosine, radius * sine});
}

/// K at the receiver x for the map from the reflector's plane to slopes in units of the width: rows (j11, j12) and
/// (j21, j22) along the unit axes e1, e2 of the plane (1/m), at the reflector point y.
template <class F>
SlopeLobe<F> make_slope_lobe(const Triple<F>& x, const Triple<F>& y, const Triple<F>& e1, const Triple<F>& e2,
                             const F& j11, const F& j12, const F& j21, const F& j22) {
    const Triple<F> to_y = y - x;
    const F distance = square_root(dot(to_y, to_y));
    const Triple<F> axis = to_y * (F(1.0F) / distance);
    const Triple<F> normal = cross(e1, e2);
    // Moving the direction by a small q across the axis moves the point on the plane by f1.q e1 + f2.q e2.
    const F cosine = dot(normal, axis);
    const F bounded = select(absolute(cosine) > F(1e-4F), cosine, F(1e-4F));
    const Triple<F> f1 = (e1 - normal * (dot(e1, axis) / bounded)) * distance;
    const Triple<F> f2 = (e2 - normal * (dot(e2, axis) / bounded)) * distance;
    const Triple<F> row1 = f1 * j11 + f2 * j12, row2 = f1 * j21 + f2 * j22;
    // Where the cosine was bounded the rows are not across the axis any more: the density needs them to be.
    return with_orthogonal_rows<F>({axis, row1 - axis * dot(row1, axis), row2 - axis * dot(row2, axis)});
}

}  // namespace nephroid

// Cached slope lobes, and how they move to a shading point near the cached one.
//
// Newton (one reflection): the reflector point moves so that the slope stays what it was at the cached point,
// delta = -J(x, y_c)^-1 (C(x, y_c) - C_c), with the cached J for the lobe's shape. Driving relaxed points (C_c not
// zero) to zero instead would be wrong: they are where slopes are smallest. Implicit: the derivative dy/dx, for any
// number of reflections.
#pragma once

#include "core/simd.h"
#include "guiding/slope_lobe.h"
#include "pathcut/half_vector_slope.h"

namespace nephroid {

enum class SlopeWarp : uint8_t {
    none,      ///< The direction is kept.
    implicit,  ///< By the stored derivative dy/dx.
    newton,    ///< Newton's method to the cached slope; implicit for two and more reflections.
};

/// All floats, so that a vector of lobes is the same struct over FloatV. World space, metres; y is the reflector point
/// next to the receiver.
template <class F>
struct CachedSlopeLobe {
    Triple<F> y;                ///< Reflector point.
    Triple<F> e1, e2;           ///< Unit axes of its triangle's plane.
    Triple<F> normal, tangent;  ///< Unit shading normal and first slope axis; the second is normal x tangent.
    Triple<F> dn1, dn2;         ///< Derivatives of the normal along e1 and e2, 1/m.
    Triple<F> light;            ///< Position; or direction to a light at infinity.
    F light_at_infinity;        ///< 1 or 0.
    F slope1, slope2;           ///< C_c.
    F j11, j12, j21, j22;       ///< Of slopes in units of the lobe's width along e1, e2, 1/m; fitted.
    Triple<F> move1, move2;     ///< Rows of dy/dx along e1 and e2, dimensionless.
    F squared_floor;            ///< Smallest squared singular value that the Newton step divides by, 1/m^2.
    F reach;                    ///< A step goes no further than three times this, or than the shading point has moved.
    F is_single;                ///< 1: one reflection; 0: more.
    F weight;                   ///< Irradiance that the lobe brings, W/m^2 of luminance.
};

/// The constraint at a point of the reflector, for one reflection. Directions need no more than float here, see
/// slope_lobe.h.
template <class F>
struct SlopeAtPoint {
    Connection<F> to_viewer, to_light;
    HalfVectorSlope<F> half;
};

template <class F>
SlopeAtPoint<F> slope_at(const CachedSlopeLobe<F>& lobe, const Triple<F>& x, const Triple<F>& y,
                         const Triple<F>& normal, const Triple<F>& tangent) {
    const F is_near = F(1.0F) - lobe.light_at_infinity;
    const Triple<F> to_viewer = x - y, to_light = lobe.light - y * is_near;
    const F inverse_viewer = reciprocal_square_root(dot(to_viewer, to_viewer));
    const F inverse_light = reciprocal_square_root(dot(to_light, to_light));
    const Connection<F> viewer{to_viewer * inverse_viewer, inverse_viewer};
    const Connection<F> light{to_light * inverse_light, inverse_light * is_near};
    const Frame<F> frame{tangent, cross(normal, tangent), normal};
    return {viewer, light, half_vector_slope(viewer.direction + light.direction, frame)};
}

/// dC / d(plane coordinates of y), 1/m.
template <class F>
struct SlopeJacobian {
    F j11, j12, j21, j22;
};

template <class F>
SlopeJacobian<F> slope_jacobian(const CachedSlopeLobe<F>& lobe, const SlopeAtPoint<F>& at) {
    const auto column = [&](const Triple<F>& e, const Triple<F>& dn) {
        return at.half.derivative(at.to_viewer.turned_by_vertex(e) + at.to_light.turned_by_vertex(e), dn);
    };
    const SlopePair<F> along1 = column(lobe.e1, lobe.dn1), along2 = column(lobe.e2, lobe.dn2);
    return {along1.c1, along2.c1, along1.c2, along2.c2};
}

/// delta = -(J^T J)^-1 J^T c as a matrix, with the eigenvalues of J^T J floored: along a direction in which slopes
/// hardly change (the caustic itself), the step stays short instead of becoming infinite.
template <class F>
struct NewtonStep {
    F s11, s12, s21, s22;
};

template <class F>
NewtonStep<F> newton_step(const SlopeJacobian<F>& j, const F& squared_floor) {
    const F p = j.j11 * j.j11 + j.j21 * j.j21, q = j.j11 * j.j12 + j.j21 * j.j22;
    const F r = j.j12 * j.j12 + j.j22 * j.j22;
    const F mean = (p + r) * F(0.5F), half = (p - r) * F(0.5F);
    const F radius = square_root(half * half + q * q);
    const F least = mean - radius;
    const F inverse_large = F(1.0F) / maximum(mean + radius, squared_floor);
    const F inverse_small = F(1.0F) / maximum(least, squared_floor);
    // g(A) = g_small I + (g_large - g_small) (A - least I) / (2 radius), with the unfloored eigenvalues in A.
    const F ratio = select(radius > mean * F(1e-6F), (inverse_large - inverse_small) / (radius * F(2.0F)), F(0.0F));
    const F g11 = inverse_small + ratio * (p - least), g12 = ratio * q, g22 = inverse_small + ratio * (r - least);
    return {-(g11 * j.j11 + g12 * j.j12), -(g11 * j.j21 + g12 * j.j22), -(g12 * j.j11 + g22 * j.j12),
            -(g12 * j.j21 + g22 * j.j22)};
}

/// A move on the plane of the reflector.
template <class F>
struct PlaneMove {
    F delta1, delta2;
};

/// Shortened to `limit`; none where it is not finite.
template <class F>
PlaneMove<F> limited(const PlaneMove<F>& move, const F& limit) {
    const F length = square_root(move.delta1 * move.delta1 + move.delta2 * move.delta2);
    const F scale = select(length <= limit, F(1.0F), limit / length);
    const auto usable = length < F(std::numeric_limits<float>::infinity());
    return {select(usable, move.delta1 * scale, F(0.0F)), select(usable, move.delta2 * scale, F(0.0F))};
}

/// Where the surface is after a move, to second order: it bends as its normals do.
template <class F>
Triple<F> moved_point(const CachedSlopeLobe<F>& lobe, const PlaneMove<F>& move, const Triple<F>& turn) {
    const Triple<F> along = lobe.e1 * move.delta1 + lobe.e2 * move.delta2;
    return lobe.y + along - lobe.normal * (F(0.5F) * dot(along, turn));
}

/// Two steps of Newton's method with one Jacobian, the second one from where the surface bends to. Where the first one
/// does not bring the slope nearer to the cached one, the point stays.
template <class F>
PlaneMove<F> newton_move(const CachedSlopeLobe<F>& lobe, const Triple<F>& x, const F& limit) {
    const SlopeAtPoint<F> start = slope_at(lobe, x, lobe.y, lobe.normal, lobe.tangent);
    const NewtonStep<F> step = newton_step(slope_jacobian(lobe, start), lobe.squared_floor);
    const auto move_by = [&](const SlopeAtPoint<F>& at) -> PlaneMove<F> {
        const F c1 = at.half.slope.c1 - lobe.slope1, c2 = at.half.slope.c2 - lobe.slope2;
        return {step.s11 * c1 + step.s12 * c2, step.s21 * c1 + step.s22 * c2};
    };
    const auto squared_residual = [&](const SlopeAtPoint<F>& at) {
        const F c1 = at.half.slope.c1 - lobe.slope1, c2 = at.half.slope.c2 - lobe.slope2;
        return c1 * c1 + c2 * c2;
    };
    const PlaneMove<F> first = limited(move_by(start), limit);
    const Triple<F> turn = lobe.dn1 * first.delta1 + lobe.dn2 * first.delta2;
    const Triple<F> turned = lobe.normal + turn;
    const Triple<F> normal = turned * reciprocal_square_root(dot(turned, turned));
    const Triple<F> across = lobe.tangent - normal * dot(lobe.tangent, normal);
    const Triple<F> tangent = across * reciprocal_square_root(dot(across, across));
    const SlopeAtPoint<F> there = slope_at(lobe, x, moved_point(lobe, first, turn), normal, tangent);
    const PlaneMove<F> second = move_by(there);
    const PlaneMove<F> both = limited({first.delta1 + second.delta1, first.delta2 + second.delta2}, limit);
    const auto nearer = squared_residual(there) <= squared_residual(start);
    return {select(nearer, both.delta1, F(0.0F)), select(nearer, both.delta2, F(0.0F))};
}

/// The cached lobe of a point at x_c as it is at x.
template <class F>
SlopeLobe<F> warped(const CachedSlopeLobe<F>& lobe, const Triple<F>& x, const Triple<F>& x_c, SlopeWarp warp) {
    if (warp == SlopeWarp::none) {
        // The same direction, as if the reflector had moved along.
        return make_slope_lobe(x_c, lobe.y, lobe.e1, lobe.e2, lobe.j11, lobe.j12, lobe.j21, lobe.j22);
    }
    const Triple<F> shift = x - x_c;
    const F limit = F(3.0F) * maximum(lobe.reach, square_root(dot(shift, shift)));
    PlaneMove<F> move = limited<F>({dot(lobe.move1, shift), dot(lobe.move2, shift)}, limit);
    if (warp == SlopeWarp::newton) {
        const PlaneMove<F> newton = newton_move(lobe, x, limit);
        const auto single = lobe.is_single > F(0.5F);
        move = {select(single, newton.delta1, move.delta1), select(single, newton.delta2, move.delta2)};
    }
    const Triple<F> turn = lobe.dn1 * move.delta1 + lobe.dn2 * move.delta2;
    return make_slope_lobe(x, moved_point(lobe, move, turn), lobe.e1, lobe.e2, lobe.j11, lobe.j12, lobe.j21, lobe.j22);
}

}  // namespace nephroid

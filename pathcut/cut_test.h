// The relaxed half-vector test of a path cut (Sec. 3.3, Li et al. 2022): can any path through these pieces of reflector
// have its half vectors close enough to the normals?
//
// Conservative: what it rejects holds no such path. With wi and wo known up to angles, H = wi + wo is known up to the
// sum of two chords, and a half vector within `spread` of an axis satisfies |H x axis| cos(spread) -
// |H . axis| sin(spread) <= 0, a function that changes by no more than H does. So the test needs two reciprocal square
// roots and no trigonometry. Sines throughout: the cosines of 1e-4 radians are lost in float.
#pragma once

#include "pathcut/bounds_block.h"
#include "pathcut/path_light.h"

namespace nephroid {

/// Directions from the points of one bound to those of another.
template <class F>
struct Leg {
    Triple<F> direction;  ///< Unit, between the centres.
    F chord;              ///< How far the other unit directions are from it, at most.
    F inverse_distance;   ///< Between the centres, 1/m; zero at infinity.
};

namespace leg {
/// Above any distance between unit vectors: nothing is known.
inline constexpr float unbounded = 4.0F;
/// Up to this sine the bound of the chord below holds.
inline constexpr float widest_sine = 0.9F;
/// More than what rounding changes in the tests below: a few operations on vectors of length up to two.
inline constexpr float slack = 4e-6F;
}  // namespace leg

/// 2 sin(angle / 2) from above, from the sine of an angle below a right one.
template <class F>
F chord_of_sine(const F& sine) {
    return select(sine < F(leg::widest_sine), sine * (F(1.0F) + F(0.25F) * sine * sine), F(leg::unbounded));
}

template <class F>
Leg<F> make_leg(const PointBound<F>& from, const PointBound<F>& to) {
    const Triple<F> between = to.centre - from.centre;
    const F inverse = reciprocal_square_root(dot(between, between));
    // Coinciding centres: infinity times zero makes everything NaN, and no comparison that rejects holds.
    return {between * inverse, chord_of_sine<F>((from.radius + to.radius) * inverse), inverse};
}

template <class F>
Leg<F> make_leg(const PointBound<F>& from, const PathLight& light) {
    const Triple<F> point{F(light.point.x), F(light.point.y), F(light.point.z)};
    if (light.at_infinity) return {point, F(0.0F), F(0.0F)};
    return make_leg<F>(from, PointBound<F>{point, F(light.radius)});
}

inline Leg<FloatV> broadcast(const Leg<float>& leg) {
    return {broadcast(leg.direction), FloatV(leg.chord), FloatV(leg.inverse_distance)};
}

template <class F>
Leg<F> reversed(const Leg<F>& leg) {
    return {-leg.direction, leg.chord, leg.inverse_distance};
}

/// True where no point of the mirror reflects any direction of one leg into the other.
template <class F>
MaskOf<F> cannot_reflect(const MirrorBound<F>& mirror, const Leg<F>& to_viewer, const Leg<F>& to_light) {
    const Triple<F> h = to_viewer.direction + to_light.direction;
    const Triple<F> across = cross(h, mirror.axis);
    const F along = absolute(dot(h, mirror.axis));
    const F reach = to_viewer.chord + to_light.chord + along * mirror.sin_spread + F(leg::slack);
    return dot(across, across) * (mirror.cos_spread * mirror.cos_spread) > reach * reach;
}

/// True where a spot light leaves all of the points dark.
template <class F>
MaskOf<F> outside_light_cone(const PathLight& light, const Leg<F>& to_light) {
    const Triple<F> axis{F(light.axis.x), F(light.axis.y), F(light.axis.z)};
    return -dot(to_light.direction, axis) < F(light.cos_cone) - to_light.chord - F(leg::slack);
}

}  // namespace nephroid

// Conservative interval arithmetic for 3-vectors: boxes of positions, of differences of positions, and of directions.
//
// A box is a Triple of intervals, so that sum, difference, scaling, `dot` and `cross` of core/simd.h hold for boxes as
// they stand; here is what needs more than that to be tight.
#pragma once

#include "core/vec.h"
#include "pathcut/interval.h"

namespace nephroid {

/// The axis-aligned box of all vectors whose coordinates lie in x, y and z.
template <class F>
using IntervalVector = Triple<Interval<F>>;

/// The box of one vector.
template <class F>
IntervalVector<F> point_box(const Triple<F>& v) {
    return {point_interval(v.x), point_interval(v.y), point_interval(v.z)};
}
/// The neutral element of `hull`.
template <class F>
IntervalVector<F> empty_box() {
    return {empty_interval<F>(), empty_interval<F>(), empty_interval<F>()};
}
/// The smallest box that holds both.
template <class F>
IntervalVector<F> hull(const IntervalVector<F>& a, const IntervalVector<F>& b) {
    return {hull(a.x, b.x), hull(a.y, b.y), hull(a.z, b.z)};
}
template <class F>
MaskOf<F> contains(const IntervalVector<F>& a, const Triple<F>& v) {
    return contains(a.x, v.x) && contains(a.y, v.y) && contains(a.z, v.z);
}
template <class F>
MaskOf<F> overlap(const IntervalVector<F>& a, const IntervalVector<F>& b) {
    return overlap(a.x, b.x) && overlap(a.y, b.y) && overlap(a.z, b.z);
}

/// The largest dot product of a member of a and a member of b: half the price of `dot`, and all that pruning needs.
template <class F>
F upper_dot(const IntervalVector<F>& a, const IntervalVector<F>& b) {
    return add_up(add_up(upper_product(a.x, b.x), upper_product(a.y, b.y)), upper_product(a.z, b.z));
}

template <class F>
Interval<F> squared_length(const IntervalVector<F>& v) {
    return square(v.x) + square(v.y) + square(v.z);
}
template <class F>
Interval<F> length(const IntervalVector<F>& v) {
    return square_root(squared_length(v));
}
/// Between a point of a and a point of b.
template <class F>
Interval<F> distance(const IntervalVector<F>& a, const IntervalVector<F>& b) {
    return length<F>(b - a);
}

/// The largest c / sqrt(c^2 + r^2) for c in `component` and r^2 in `rest_squared`, at most 1.
template <class F>
F upper_cosine(const Interval<F>& component, const Interval<F>& rest_squared) {
    // Increasing in c, and decreasing in r^2 where c > 0: the extremum is at a corner, and no interval widens.
    const F c = component.upper;
    const auto positive = c > F(0.0F);
    const F shortest = square_root_down(maximum<F>(add_down(multiply_down(c, c), rest_squared.lower), F(0.0F)));
    const F longest = square_root_up(add_up(multiply_up(c, c), rest_squared.upper));
    const F length_used = select(positive, shortest, longest);
    const F bound = minimum<F>(divide_up(c, length_used), F(1.0F));
    // A length of zero (the zero vector, or squares that underflow) or infinity over infinity: what the sign says.
    const F fallback = select(positive, F(1.0F), F(0.0F));
    return select(length_used > F(0.0F) && bound == bound, bound, fallback);
}

/// Directions v / |v| of all non-zero v in the box: the exact range of each coordinate up to rounding, inside [-1, 1].
template <class F>
IntervalVector<F> normalized(const IntervalVector<F>& v) {
    const Interval<F> x2 = square(v.x), y2 = square(v.y), z2 = square(v.z);
    const Interval<F> yz2 = y2 + z2, xz2 = x2 + z2, xy2 = x2 + y2;
    return {{-upper_cosine<F>(-v.x, yz2), upper_cosine<F>(v.x, yz2)},
            {-upper_cosine<F>(-v.y, xz2), upper_cosine<F>(v.y, xz2)},
            {-upper_cosine<F>(-v.z, xy2), upper_cosine<F>(v.z, xy2)}};
}

/// Directions from the points of `from` to the points of `to`.
template <class F>
IntervalVector<F> directions_between(const IntervalVector<F>& from, const IntervalVector<F>& to) {
    return normalized<F>(to - from);
}

/// Unit half vectors (wi + wo) / |wi + wo| of all wi and wo in two boxes of directions.
template <class F>
IntervalVector<F> half_vectors(const IntervalVector<F>& wi, const IntervalVector<F>& wo) {
    return normalized<F>(wi + wo);
}

}  // namespace nephroid

// Conservative interval arithmetic in float: for any real numbers inside the operands the result of the real operation
// lies inside the resulting interval, whatever floating point does (directed_rounding.h).
//
// F = float or FloatV (one interval per lane). An infinite bound means "unbounded"; members are finite. No operation
// returns NaN bounds for operands without NaN, and none branches.
#pragma once

#include "pathcut/directed_rounding.h"

namespace nephroid {

/// The real numbers x with lower <= x <= upper. Empty where lower > upper.
template <class F>
struct Interval {
    F lower, upper;
};

/// The interval that holds one number.
template <class F>
Interval<F> point_interval(const F& x) {
    return {x, x};
}
/// All real numbers.
template <class F>
Interval<F> unbounded_interval() {
    return {F(-infinity), F(infinity)};
}
/// Holds nothing; the neutral element of `hull`.
template <class F>
Interval<F> empty_interval() {
    return {F(infinity), F(-infinity)};
}

template <class F>
MaskOf<F> contains(const Interval<F>& a, const F& x) {
    return a.lower <= x && x <= a.upper;
}
template <class F>
MaskOf<F> overlap(const Interval<F>& a, const Interval<F>& b) {
    return a.lower <= b.upper && b.lower <= a.upper;
}
/// The smallest interval that holds both.
template <class F>
Interval<F> hull(const Interval<F>& a, const Interval<F>& b) {
    return {minimum(a.lower, b.lower), maximum(a.upper, b.upper)};
}
/// The smallest |x| in the interval; exact.
template <class F>
F smallest_magnitude(const Interval<F>& a) {
    return maximum(maximum<F>(a.lower, -a.upper), F(0.0F));
}
/// The largest |x| in the interval; exact.
template <class F>
F largest_magnitude(const Interval<F>& a) {
    return maximum<F>(-a.lower, a.upper);
}

template <class F>
Interval<F> operator-(const Interval<F>& a) {
    return {-a.upper, -a.lower};
}
template <class F>
Interval<F> operator+(const Interval<F>& a, const Interval<F>& b) {
    return {add_down(a.lower, b.lower), add_up(a.upper, b.upper)};
}
template <class F>
Interval<F> operator-(const Interval<F>& a, const Interval<F>& b) {
    return {add_down(a.lower, -b.upper), add_up(a.upper, -b.lower)};
}

/// Bounds that an undefined operation (0 * unbounded) made NaN: unbounded.
template <class F>
Interval<F> without_nan(const Interval<F>& a) {
    return {select(a.lower == a.lower, a.lower, F(-infinity)), select(a.upper == a.upper, a.upper, F(infinity))};
}

/// The largest product of two members.
template <class F>
F upper_product(const Interval<F>& a, const Interval<F>& b) {
    // 0 * infinity is NaN, which `maximum` drops in its first operand: rightly so, since 0 * (the other, finite bound)
    // is among the candidates then. In the last operand it survives, and makes the result unbounded.
    const F candidate =
        maximum<F>(maximum<F>(nearly_multiply_up(a.lower, b.lower), nearly_multiply_up(a.lower, b.upper)),
                   maximum<F>(nearly_multiply_up(a.upper, b.lower), nearly_multiply_up(a.upper, b.upper)));
    const F upper = finish_up(candidate);
    return select(upper == upper, upper, F(infinity));
}
template <class F>
Interval<F> operator*(const Interval<F>& a, const Interval<F>& b) {
    return {-upper_product(-a, b), upper_product(a, b)};
}

/// Unbounded where b contains zero.
template <class F>
Interval<F> operator/(const Interval<F>& a, const Interval<F>& b) {
    const F lower = minimum<F>(minimum<F>(divide_down(a.lower, b.lower), divide_down(a.lower, b.upper)),
                               minimum<F>(divide_down(a.upper, b.lower), divide_down(a.upper, b.upper)));
    const F upper = maximum<F>(maximum<F>(divide_up(a.lower, b.lower), divide_up(a.lower, b.upper)),
                               maximum<F>(divide_up(a.upper, b.lower), divide_up(a.upper, b.upper)));
    const auto divides_by_zero = contains<F>(b, F(0.0F));
    return without_nan<F>({select(divides_by_zero, F(-infinity), lower), select(divides_by_zero, F(infinity), upper)});
}

/// x^2; tighter than a * a, whose operands are independent.
template <class F>
Interval<F> square(const Interval<F>& a) {
    const F least = smallest_magnitude(a);
    const F most = largest_magnitude(a);
    return {maximum<F>(multiply_down(least, least), F(0.0F)), multiply_up(most, most)};
}

/// sqrt(x) of the members >= 0; zero if there are none.
template <class F>
Interval<F> square_root(const Interval<F>& a) {
    return {square_root_down(maximum<F>(a.lower, F(0.0F))), square_root_up(maximum<F>(a.upper, F(0.0F)))};
}

}  // namespace nephroid

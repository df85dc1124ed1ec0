// Sums, products, quotients and square roots of floats rounded towards minus or plus infinity, for one float or a
// vector of floats: what keeps interval arithmetic conservative in floating point.
//
// With AVX-512 every instruction carries its own rounding direction, at no cost and to the last bit. Elsewhere the
// nearest value is moved outwards by one unit in the last place (at least half of one is needed), which costs three
// operations per bound. Changing the processor's rounding mode instead would need -frounding-math, which switches off
// optimisations everywhere.
//
// Results are never NaN unless the real-number operation is undefined for the operands (0 * infinity, 0 / 0, ...):
// overflow gives the largest finite number or infinity, whichever is the conservative one. Denormal numbers must not be
// flushed to zero (MXCSR's FTZ and DAZ, off by default), or results below 1e-38 are rounded to zero.
#pragma once

#include <limits>

#include "core/simd.h"

namespace nephroid {

inline constexpr float largest_float = std::numeric_limits<float>::max();
inline constexpr float infinity = std::numeric_limits<float>::infinity();

/// A number below every real number that rounds to x (to nearest), also where x overflowed or lost bits to underflow.
template <class F>
F below(const F& x) {
    // The product with a power of two is exact, so the step is never less than the distance to the neighbour of x.
    const F step = absolute(x) * F(std::numeric_limits<float>::epsilon()) + F(std::numeric_limits<float>::min());
    return select(x > F(largest_float), F(largest_float), x - step);
}
/// A number above every real number that rounds to x (to nearest).
template <class F>
F above(const F& x) {
    const F step = absolute(x) * F(std::numeric_limits<float>::epsilon()) + F(std::numeric_limits<float>::min());
    return select(x < F(-largest_float), F(-largest_float), x + step);
}

#if defined(__AVX512F__)

namespace embedded_rounding {
inline constexpr int down = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
inline constexpr int up = _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC;
inline __m512 bits(const FloatV& x) {
    return static_cast<__m512>(x);
}
inline __m128 bits(float x) {
    return _mm_set_ss(x);
}
}  // namespace embedded_rounding

inline FloatV add_down(const FloatV& a, const FloatV& b) {
    return FloatV(_mm512_add_round_ps(embedded_rounding::bits(a), embedded_rounding::bits(b), embedded_rounding::down));
}
inline FloatV add_up(const FloatV& a, const FloatV& b) {
    return FloatV(_mm512_add_round_ps(embedded_rounding::bits(a), embedded_rounding::bits(b), embedded_rounding::up));
}
inline FloatV multiply_down(const FloatV& a, const FloatV& b) {
    return FloatV(_mm512_mul_round_ps(embedded_rounding::bits(a), embedded_rounding::bits(b), embedded_rounding::down));
}
inline FloatV multiply_up(const FloatV& a, const FloatV& b) {
    return FloatV(_mm512_mul_round_ps(embedded_rounding::bits(a), embedded_rounding::bits(b), embedded_rounding::up));
}
inline FloatV divide_down(const FloatV& a, const FloatV& b) {
    return FloatV(_mm512_div_round_ps(embedded_rounding::bits(a), embedded_rounding::bits(b), embedded_rounding::down));
}
inline FloatV divide_up(const FloatV& a, const FloatV& b) {
    return FloatV(_mm512_div_round_ps(embedded_rounding::bits(a), embedded_rounding::bits(b), embedded_rounding::up));
}
inline FloatV square_root_down(const FloatV& a) {
    return FloatV(_mm512_sqrt_round_ps(embedded_rounding::bits(a), embedded_rounding::down));
}
inline FloatV square_root_up(const FloatV& a) {
    return FloatV(_mm512_sqrt_round_ps(embedded_rounding::bits(a), embedded_rounding::up));
}

inline float add_down(float a, float b) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_add_round_ss(bits(a), bits(b), down));
}
inline float add_up(float a, float b) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_add_round_ss(bits(a), bits(b), up));
}
inline float multiply_down(float a, float b) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_mul_round_ss(bits(a), bits(b), down));
}
inline float multiply_up(float a, float b) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_mul_round_ss(bits(a), bits(b), up));
}
inline float divide_down(float a, float b) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_div_round_ss(bits(a), bits(b), down));
}
inline float divide_up(float a, float b) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_div_round_ss(bits(a), bits(b), up));
}
inline float square_root_down(float a) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_sqrt_round_ss(bits(a), bits(a), down));
}
inline float square_root_up(float a) {
    using namespace embedded_rounding;
    return _mm_cvtss_f32(_mm_sqrt_round_ss(bits(a), bits(a), up));
}

/// The largest of several products rounded up: `nearly_multiply_up` each, then `finish_up` once. With rounding in the
/// instruction there is nothing left to finish.
template <class F>
F nearly_multiply_up(const F& a, const F& b) {
    return multiply_up(a, b);
}
template <class F>
F finish_up(const F& x) {
    return x;
}

#else

template <class F>
F add_down(const F& a, const F& b) {
    return below<F>(a + b);
}
template <class F>
F add_up(const F& a, const F& b) {
    return above<F>(a + b);
}
template <class F>
F multiply_down(const F& a, const F& b) {
    return below<F>(a * b);
}
template <class F>
F multiply_up(const F& a, const F& b) {
    return above<F>(a * b);
}
template <class F>
F divide_down(const F& a, const F& b) {
    return below<F>(a / b);
}
template <class F>
F divide_up(const F& a, const F& b) {
    return above<F>(a / b);
}
/// Of a >= 0; never negative.
template <class F>
F square_root_down(const F& a) {
    return maximum<F>(below<F>(square_root(a)), F(0.0F));
}
template <class F>
F square_root_up(const F& a) {
    return above<F>(square_root(a));
}
/// The largest of several products rounded up: `nearly_multiply_up` each, then `finish_up` once.
template <class F>
F nearly_multiply_up(const F& a, const F& b) {
    return a * b;
}
template <class F>
F finish_up(const F& x) {
    return above(x);
}

#endif

}  // namespace nephroid

// One formula for one float and for a vector of floats: kernels are templates over F = float or FloatV.
//
// FloatV is the widest native vector of the instruction set that the build targets (16 floats with AVX-512, 4 with
// SSE2). The overloads below give float and FloatV the same vocabulary: select instead of if, any(), sqrt, ...
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <experimental/simd>

#if defined(__AVX512F__)
#include <immintrin.h>
#endif

#include "core/vec.h"

// For functions that work on vectors: what they call is inlined, however deep, because vectors that are passed to a
// function travel through memory. Not under sanitizers, whose checks make the inlined code enormous.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define NEPHROID_FLATTEN
#else
#define NEPHROID_FLATTEN [[gnu::flatten]]
#endif

namespace nephroid {

namespace stdx = std::experimental;
using FloatV = stdx::native_simd<float>;
using UintV = stdx::rebind_simd_t<uint32_t, FloatV>;
using IntV = stdx::rebind_simd_t<int32_t, FloatV>;
inline constexpr size_t simd_width = FloatV::size();
inline constexpr size_t simd_alignment = 64;

/// Type of a comparison of two F.
template <class F>
using MaskOf = decltype(F() < F());

inline float select(bool condition, float yes, float no) {
    return condition ? yes : no;
}
inline FloatV select(const FloatV::mask_type& condition, FloatV yes, FloatV no) {
    stdx::where(!condition, yes) = no;
    return yes;
}

inline double select(bool condition, double yes, double no) {
    return condition ? yes : no;
}
inline double square_root(double x) {
    return std::sqrt(x);
}

inline bool any_of(bool condition) {
    return condition;
}
inline bool any_of(const FloatV::mask_type& condition) {
    return stdx::any_of(condition);
}

inline float square_root(float x) {
    return std::sqrt(x);
}
inline FloatV square_root(const FloatV& x) {
    return stdx::sqrt(x);
}

/// 1 / sqrt(x) to 3e-7 relative for normal x > 0; infinity or NaN for zero.
inline float reciprocal_square_root(float x) {
    return 1.0F / std::sqrt(x);
}
inline FloatV reciprocal_square_root(const FloatV& x) {
#if defined(__AVX512F__)
    const FloatV estimate(_mm512_rsqrt14_ps(static_cast<__m512>(x)));
    return estimate * (FloatV(1.5F) - FloatV(0.5F) * x * estimate * estimate);
#else
    return FloatV(1.0F) / stdx::sqrt(x);
#endif
}

template <class F>
F minimum(const F& a, const F& b) {
    return select(a < b, a, b);
}
template <class F>
F maximum(const F& a, const F& b) {
    return select(a > b, a, b);
}
template <class F>
F absolute(const F& a) {
    return select(a < F(0.0F), -a, a);
}
/// sqrt(max(x, 0)): for differences that rounding may push below zero.
template <class F>
F safe_sqrt(const F& x) {
    return square_root(maximum(x, F(0.0F)));
}
/// Not infinite, not NaN.
template <class F>
MaskOf<F> is_finite(const F& x) {
    return absolute(x) <= F(3.4028234e38F);
}

// Gathers and compaction, which std::experimental::simd lacks: intrinsics where the instruction set has them, loops
// elsewhere.

#if defined(__AVX512F__)
inline __mmask16 mask_bits(const FloatV::mask_type& mask) {
    return static_cast<__mmask16>(mask.__to_bitset().to_ulong());
}
#endif

/// base[index] of each lane where `active`; zero elsewhere. Inactive lanes read nothing.
inline FloatV gather(const float* base, const UintV& index, const FloatV::mask_type& active) {
#if defined(__AVX512F__)
    return FloatV(
        _mm512_mask_i32gather_ps(_mm512_setzero_ps(), mask_bits(active), static_cast<__m512i>(index), base, 4));
#else
    return FloatV([&](auto lane) { return active[lane] ? base[index[lane]] : 0.0F; });
#endif
}
inline UintV gather(const uint32_t* base, const UintV& index, const FloatV::mask_type& active) {
#if defined(__AVX512F__)
    return UintV(
        _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), mask_bits(active), static_cast<__m512i>(index), base, 4));
#else
    return UintV([&](auto lane) { return active[lane] ? base[index[lane]] : 0U; });
#endif
}

/// Writes the lanes of `kept` to `to`, one after the other, and may write up to simd_width values: what follows the
/// kept ones is unspecified.
inline void compress_store(float* to, const FloatV& values, const FloatV::mask_type& kept) {
#if defined(__AVX512F__)
    _mm512_storeu_ps(to, _mm512_maskz_compress_ps(mask_bits(kept), static_cast<__m512>(values)));
#else
    for (size_t lane = 0; lane < simd_width; ++lane) {
        *to = values[lane];
        to += kept[lane] ? 1 : 0;
    }
#endif
}
inline void compress_store(uint32_t* to, const UintV& values, const FloatV::mask_type& kept) {
#if defined(__AVX512F__)
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(mask_bits(kept), static_cast<__m512i>(values)));
#else
    for (size_t lane = 0; lane < simd_width; ++lane) {
        *to = values[lane];
        to += kept[lane] ? 1 : 0;
    }
#endif
}

/// The first simd_width floats of each row, by column: lane r of the c-th vector is rows[r][c]. Whole rows are read and
/// turned, which is cheaper than gathering float by float.
inline std::array<FloatV, simd_width> load_transposed(const std::array<const float*, simd_width>& rows) {
    std::array<FloatV, simd_width> columns;
#if defined(__AVX512F__)
    // First pairs of rows, then four rows: their 4 x 4 squares are turned, each inside a quarter of the vectors.
    __m512 pairs[16], squares[16];
#pragma GCC unroll 8
    for (size_t r = 0; r < 16; r += 2) {
        const __m512 even = _mm512_loadu_ps(rows[r]), odd = _mm512_loadu_ps(rows[r + 1]);
        pairs[r] = _mm512_unpacklo_ps(even, odd);
        pairs[r + 1] = _mm512_unpackhi_ps(even, odd);
    }
#pragma GCC unroll 8
    for (size_t r = 0; r < 16; r += 2) {
        const size_t first = r / 4 * 4 + r % 4 / 2;
        const __m512d upper = _mm512_castps_pd(pairs[first]), lower = _mm512_castps_pd(pairs[first + 2]);
        squares[r] = _mm512_castpd_ps(_mm512_unpacklo_pd(upper, lower));
        squares[r + 1] = _mm512_castpd_ps(_mm512_unpackhi_pd(upper, lower));
    }
    // Then the quarters change places.
#pragma GCC unroll 4
    for (size_t c = 0; c < 4; ++c) {
        const __m512 left1 = _mm512_shuffle_f32x4(squares[c], squares[c + 4], 0x44);
        const __m512 left2 = _mm512_shuffle_f32x4(squares[c + 8], squares[c + 12], 0x44);
        const __m512 right1 = _mm512_shuffle_f32x4(squares[c], squares[c + 4], 0xEE);
        const __m512 right2 = _mm512_shuffle_f32x4(squares[c + 8], squares[c + 12], 0xEE);
        columns[c] = FloatV(_mm512_shuffle_f32x4(left1, left2, 0x88));
        columns[c + 4] = FloatV(_mm512_shuffle_f32x4(left1, left2, 0xDD));
        columns[c + 8] = FloatV(_mm512_shuffle_f32x4(right1, right2, 0x88));
        columns[c + 12] = FloatV(_mm512_shuffle_f32x4(right1, right2, 0xDD));
    }
#else
    for (size_t c = 0; c < simd_width; ++c) columns[c] = FloatV([&](auto lane) { return rows[lane][c]; });
#endif
    return columns;
}

inline size_t count_of(const FloatV::mask_type& mask) {
    return static_cast<size_t>(stdx::popcount(mask));
}

/// Lane numbers 0, 1, 2, ...
inline UintV lane_numbers() {
    return UintV([](auto lane) { return static_cast<uint32_t>(lane); });
}
/// The lanes below `count`.
inline FloatV::mask_type first_lanes(size_t count) {
    return stdx::static_simd_cast<FloatV>(stdx::static_simd_cast<IntV>(lane_numbers())) <
           FloatV(static_cast<float>(count));
}

/// sin(2 pi u) and cos(2 pi u) for u in [0, 1], to 2e-7 absolute: minimax polynomials on a quarter turn, no table, no
/// branch, so that it vectorises.
template <class F>
void sincos_turn(const F& u, F& sine, F& cosine) {
    // Fold the turn: u = quarter / 4 + r with |r| <= 1/8, then rotate by quarter.
    const F scaled = u * F(4.0F) + F(0.5F);
    F quarter;
    if constexpr (std::is_same_v<F, float>) {
        quarter = std::floor(scaled);
    } else {
        quarter = stdx::floor(scaled);
    }
    const F x = (u * F(4.0F) - quarter) * F(1.57079632679F);
    const F x2 = x * x;
    const F s = x * (F(1.0F) + x2 * (F(-1.6666654611e-1F) + x2 * (F(8.3321608736e-3F) + x2 * F(-1.9515295891e-4F))));
    const F c = F(1.0F) + x2 * (F(-0.5F) + x2 * (F(4.166664568298827e-2F) +
                                                 x2 * (F(-1.388731625493765e-3F) + x2 * F(2.443315711809948e-5F))));
    const auto swap = (quarter == F(1.0F)) || (quarter == F(3.0F));
    const auto negative_sine = (quarter == F(2.0F)) || (quarter == F(3.0F));
    const auto negative_cosine = (quarter == F(1.0F)) || (quarter == F(2.0F));
    const F sine_magnitude = select(swap, c, s);
    const F cosine_magnitude = select(swap, s, c);
    sine = select(negative_sine, -sine_magnitude, sine_magnitude);
    cosine = select(negative_cosine, -cosine_magnitude, cosine_magnitude);
}

/// Three F: a direction, or a colour, of one or of simd_width lanes.
template <class F>
struct Triple {
    F x, y, z;

    friend Triple operator+(const Triple& a, const Triple& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend Triple operator-(const Triple& a, const Triple& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend Triple operator*(const Triple& a, const Triple& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
    friend Triple operator*(const Triple& a, const F& s) { return {a.x * s, a.y * s, a.z * s}; }
    friend Triple operator-(const Triple& a) { return {-a.x, -a.y, -a.z}; }
};

inline Triple<float> to_triple(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Vec3 to_vec3(const Triple<float>& v) {
    return {v.x, v.y, v.z};
}

template <class F>
Triple<F> absolute(const Triple<F>& v) {
    return {absolute(v.x), absolute(v.y), absolute(v.z)};
}
template <class F>
Triple<F> maximum(const Triple<F>& a, const Triple<F>& b) {
    return {maximum(a.x, b.x), maximum(a.y, b.y), maximum(a.z, b.z)};
}
template <class F>
Triple<F> cross(const Triple<F>& a, const Triple<F>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class F>
F dot(const Triple<F>& a, const Triple<F>& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class F>
Triple<F> normalized(const Triple<F>& v) {
    return v * (F(1.0F) / square_root(dot(v, v)));
}
template <class F>
F max_component(const Triple<F>& v) {
    return maximum(v.x, maximum(v.y, v.z));
}
template <class F>
F luminance(const Triple<F>& c) {
    return F(0.2126F) * c.x + F(0.7152F) * c.y + F(0.0722F) * c.z;
}
template <class F>
Triple<F> select(const MaskOf<F>& condition, const Triple<F>& yes, const Triple<F>& no) {
    return {select(condition, yes.x, no.x), select(condition, yes.y, no.y), select(condition, yes.z, no.z)};
}

}  // namespace nephroid

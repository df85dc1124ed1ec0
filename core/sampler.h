// Sample points of the unit hypercube: a counter-based sampler, so that any sample of any pixel can be had in any
// order, on any thread, with the same result.
//
// Low discrepancy: every dimension pair is its own (0,2)-sequence: the first two Sobol dimensions, Owen-scrambled by
// hashing, with the order of the samples Owen-shuffled per pair (padding, Burley 2020). Each power-of-two run of
// samples is stratified in every elementary interval of every pair; triples are the first three dimensions, a
// (1,3)-sequence. Pixels are decorrelated by independent scrambles.
// Independent: hashed counters, for statistics that assume independence.
//
// All functions are templates over U = uint32_t or UintV, so that a batch of paths draws a vector at a time.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "core/simd.h"

namespace nephroid {

enum class SamplerKind : uint8_t { sobol, independent };

/// A bijective hash with good avalanche (the "lowbias32" constants of Wellons' hash prospector).
template <class U>
U hash_uint(U x) {
    x ^= x >> 16;
    x *= U(0x7feb352dU);
    x ^= x >> 15;
    x *= U(0x846ca68bU);
    x ^= x >> 16;
    return x;
}

template <class U>
U hash_combine(const U& a, const U& b) {
    return hash_uint(U(a ^ (hash_uint(U(b + U(0x9e3779b9U))))));
}

template <class U>
constexpr U reverse_bits(U x) {
    x = ((x >> 1) & U(0x55555555U)) | ((x & U(0x55555555U)) << 1);
    x = ((x >> 2) & U(0x33333333U)) | ((x & U(0x33333333U)) << 2);
    x = ((x >> 4) & U(0x0f0f0f0fU)) | ((x & U(0x0f0f0f0fU)) << 4);
    x = ((x >> 8) & U(0x00ff00ffU)) | ((x & U(0x00ff00ffU)) << 8);
    return (x >> 16) | (x << 16);
}

/// Owen scrambling of a bit-reversed number: every bit is flipped by a hash of the bits below it and the seed
/// (Laine and Karras 2011, with the constants of Vegdahl 2021).
template <class U>
U owen_scramble_reversed(U x, const U& seed) {
    x ^= x * U(0x3d20adeaU);
    x += seed;
    x *= (seed >> 16) | U(1U);
    x ^= x * U(0x05526c56U);
    x ^= x * U(0x53a22864U);
    return x;
}

/// Second Sobol dimension of index i, bit-reversed: the Pascal matrix modulo 2, which is a Kronecker power of
/// (1 1; 0 1) and so takes log2(32) butterfly steps.
template <class U>
U sobol_second_reversed(U i) {
    i ^= (i >> 16) & U(0x0000ffffU);
    i ^= (i >> 8) & U(0x00ff00ffU);
    i ^= (i >> 4) & U(0x0f0f0f0fU);
    i ^= (i >> 2) & U(0x33333333U);
    i ^= (i >> 1) & U(0x55555555U);
    return i;
}

/// Direction numbers of the third Sobol dimension (polynomial x^2 + x + 1, m = 1, 3), bit-reversed.
inline constexpr std::array<uint32_t, 32> sobol_third_reversed_numbers = [] {
    std::array<uint32_t, 32> numbers{1, 3};
    for (size_t k = 2; k < numbers.size(); ++k) {
        numbers[k] = (numbers[k - 1] << 1) ^ (numbers[k - 2] << 2) ^ numbers[k - 2];
    }
    for (size_t k = 0; k < numbers.size(); ++k) numbers[k] = reverse_bits(numbers[k] << (31 - k));
    return numbers;
}();

/// Third Sobol dimension of index i, bit-reversed.
template <class U>
U sobol_third_reversed(const U& i) {
    U x(0U);
    for (uint32_t k = 0; k < 32; ++k) x ^= (U(0U) - ((i >> k) & U(1U))) & U(sobol_third_reversed_numbers[k]);
    return x;
}

/// [0, 1): the upper 24 bits, so that the result is never rounded up to 1.
inline float unit_float(uint32_t x) {
    return static_cast<float>(x >> 8) * 0x1p-24F;
}
inline FloatV unit_float(const UintV& x) {
    return stdx::static_simd_cast<FloatV>(stdx::static_simd_cast<IntV>(x >> 8)) * FloatV(0x1p-24F);
}

template <class U>
using UnitFloat = decltype(unit_float(U()));

/// Seed of a pixel: all its dimensions derive from it.
inline uint32_t pixel_seed(uint32_t x, uint32_t y, uint32_t image_seed) {
    return hash_combine(hash_combine(hash_combine(image_seed, 0x51ed270bU), x), y);
}

/// The two coordinates of dimension pair `dimension` of sample `index`.
template <class U>
std::pair<UnitFloat<U>, UnitFloat<U>> sample_2d(SamplerKind kind, const U& seed, const U& index, uint32_t dimension) {
    const U pair_seed = hash_combine(seed, U(dimension));
    if (kind == SamplerKind::independent) {
        const U bits = hash_combine(pair_seed, index);
        return {unit_float(bits), unit_float(hash_uint(U(bits + U(0x68bc21ebU))))};
    }
    // Shuffling the order is Owen scrambling of the index itself.
    const U shuffled = reverse_bits(owen_scramble_reversed(reverse_bits(index), pair_seed));
    const U seed_x = hash_uint(U(pair_seed ^ U(0xa511e9b3U)));
    const U seed_y = hash_uint(U(pair_seed ^ U(0x63d83595U)));
    const U x = reverse_bits(owen_scramble_reversed(shuffled, seed_x));
    const U y = reverse_bits(owen_scramble_reversed(sobol_second_reversed(shuffled), seed_y));
    return {unit_float(x), unit_float(y)};
}

/// Three coordinates that are stratified together: sample_2d's two, and a third one of its own.
template <class U>
std::array<UnitFloat<U>, 3> sample_3d(SamplerKind kind, const U& seed, const U& index, uint32_t dimension) {
    const auto [x, y] = sample_2d(kind, seed, index, dimension);
    const U pair_seed = hash_combine(seed, U(dimension));
    const U seed_z = hash_uint(U(pair_seed ^ U(0x1b56c4e9U)));
    if (kind == SamplerKind::independent) return {x, y, unit_float(hash_combine(seed_z, index))};
    const U shuffled = reverse_bits(owen_scramble_reversed(reverse_bits(index), pair_seed));
    return {x, y, unit_float(reverse_bits(owen_scramble_reversed(sobol_third_reversed(shuffled), seed_z)))};
}

/// The coordinate of dimension `dimension` of sample `index`: an Owen-scrambled van der Corput sequence.
template <class U>
UnitFloat<U> sample_1d(SamplerKind kind, const U& seed, const U& index, uint32_t dimension) {
    const U pair_seed = hash_combine(seed, U(dimension));
    if (kind == SamplerKind::independent) return unit_float(hash_combine(pair_seed, index));
    const U shuffled = reverse_bits(owen_scramble_reversed(reverse_bits(index), pair_seed));
    return unit_float(reverse_bits(owen_scramble_reversed(shuffled, hash_uint(U(pair_seed ^ U(0xa511e9b3U))))));
}

}  // namespace nephroid

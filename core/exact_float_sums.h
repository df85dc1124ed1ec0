// Sums of non-negative floats of any magnitude that come in any order, from any thread, and still have the same bits.
//
// Where ExactSums needs to know the unit of what it sums, this does not: a sum is a fixed-point number as wide as the
// range of float (Kulisch's accumulator), in digits of 32 bits that have an integer of 64 each. A value's 24 bits touch
// two digits at most, of one cache line; carries wait until the sum is read, so atomic additions commute. Exact for
// 2^32 values.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

namespace nephroid {

class ExactFloatSums {
  public:
    /// Larger values count as this.
    static constexpr float largest_value = 0x1p100F;

    void resize(size_t size) { sums_.resize(size); }
    size_t size() const { return sums_.size(); }

    /// Thread-safe. Negative values and NaN count as zero.
    void add(size_t i, float value) {
        if (!(value > 0.0F)) return;
        const auto bits = std::bit_cast<uint32_t>(std::min(value, largest_value));
        const uint32_t exponent = bits >> mantissa_bits;
        const uint32_t fraction = bits & ((1U << mantissa_bits) - 1U);
        // In units of the smallest subnormal number.
        const uint64_t mantissa = exponent == 0 ? fraction : fraction | (1U << mantissa_bits);
        const uint32_t position = std::max(exponent, 1U) - 1U;
        const size_t digit = position / digit_bits;
        const uint64_t shifted = mantissa << (position % digit_bits);
        add_digit(sums_[i][digit], shifted & ((uint64_t{1} << digit_bits) - 1U));
        if (shifted >> digit_bits != 0) add_digit(sums_[i][digit + 1], shifted >> digit_bits);
    }
    /// Not while values are being added.
    double sum(size_t i) const {
        double result = 0.0;
        for (size_t digit = digits; digit-- > 0;) {
            result += std::ldexp(static_cast<double>(sums_[i][digit]),
                                 static_cast<int>(digit * digit_bits) + exponent_of_unit);
        }
        return result;
    }

    /// All that was added, for checkpoints.
    using Sum = std::array<uint64_t, 8>;
    std::vector<Sum>& sums() { return sums_; }
    const std::vector<Sum>& sums() const { return sums_; }

  private:
    static constexpr uint32_t mantissa_bits = 23;
    static constexpr uint32_t digit_bits = 32;
    static constexpr size_t digits = 8;
    static constexpr int exponent_of_unit = -149;

    static void add_digit(uint64_t& digit, uint64_t value) {
        std::atomic_ref<uint64_t>(digit).fetch_add(value, std::memory_order_relaxed);
    }

    std::vector<Sum> sums_;
};

}  // namespace nephroid

// Sums of non-negative values that come in any order, from any thread, and still have the same bits.
//
// Floating-point sums depend on their order. A fixed-point sum does not: integers add exactly, so atomic additions
// commute, no thread waits for another, and no list of what is to be added has to be kept and sorted. Each value is
// split into two digits, of 2^-8 and of 2^-40, that are summed in an integer each: rounded to 2^-40, the sum is exact
// for 2^32 values and up to 2^56. The alternatives: lists per block, committed in order at the end of a pass, take
// memory without bound in long passes and give other bits where passes end elsewhere (after --resume); one picture per
// thread gives other bits for other numbers of threads.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <vector>

namespace nephroid {

class ExactSums {
  public:
    /// Values from here on are refused: some hundreds of them would overflow.
    static constexpr double largest_value = 0x1p47;

    void resize(size_t size) { digits_.resize(2 * size); }
    bool empty() const { return digits_.empty(); }

    /// Thread-safe. 0 <= value < largest_value.
    void add(size_t i, double value) {
        const double high = std::floor(value * high_per_unit);
        const double rest = value - high / high_per_unit;  // Exact: the difference has no more bits than the value.
        add_digit(2 * i, static_cast<uint64_t>(high));
        add_digit(2 * i + 1, static_cast<uint64_t>(std::llrint(rest * low_per_unit)));
    }
    /// Not while values are being added.
    double sum(size_t i) const {
        return static_cast<double>(digits_[2 * i]) / high_per_unit +
               static_cast<double>(digits_[2 * i + 1]) / low_per_unit;
    }

    /// All that was added, for checkpoints.
    std::vector<uint64_t>& digits() { return digits_; }
    const std::vector<uint64_t>& digits() const { return digits_; }

  private:
    static constexpr double high_per_unit = 0x1p8;
    static constexpr double low_per_unit = 0x1p40;

    void add_digit(size_t i, uint64_t value) {
        if (value == 0) return;
        std::atomic_ref<uint64_t>(digits_[i]).fetch_add(value, std::memory_order_relaxed);
    }

    std::vector<uint64_t> digits_;
};

}  // namespace nephroid

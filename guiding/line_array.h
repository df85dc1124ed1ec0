// Structures of floats, each in cache lines of its own: read whole, from wherever they lie, as lanes of vectors.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/simd.h"

namespace nephroid {

/// `Structure<F>` consists of members of type F only.
template <template <class> class Structure>
class LineArray {
  public:
    using value_type = Structure<float>;
    static constexpr size_t fields = sizeof(value_type) / sizeof(float);

    LineArray() = default;
    explicit LineArray(size_t size) : lines_(size) {}
    explicit LineArray(const std::vector<value_type>& values) : lines_(values.size()) {
        for (size_t i = 0; i < values.size(); ++i) set(i, values[i]);
    }

    size_t size() const { return lines_.size(); }
    bool empty() const { return lines_.empty(); }
    friend size_t bytes_of(const LineArray& array) { return array.lines_.size() * sizeof(Lines); }

    void set(size_t i, const value_type& value) { lines_[i].value = value; }
    const value_type& get(size_t i) const { return lines_[i].value; }

    /// Soon wanted.
    void prefetch(size_t i) const {
        for (size_t line = 0; line < sizeof(Lines); line += alignof(Lines)) {
            __builtin_prefetch(reinterpret_cast<const std::byte*>(&lines_[i]) + line);
        }
    }
    /// Those at the first `count` of the indices, at least one; behind them the first one again.
    Structure<FloatV> gather(const uint32_t* index, size_t count) const {
        std::array<const float*, simd_width> rows;
        for (size_t lane = 0; lane < simd_width; ++lane) {
            rows[lane] = reinterpret_cast<const float*>(&lines_[index[lane < count ? lane : 0]]);
        }
        std::array<FloatV, fields> values;
        // Up to the end of the last line: vectors are no longer than lines.
#pragma GCC unroll 4
        for (size_t first = 0; first < fields; first += simd_width) {
            const std::array<FloatV, simd_width> columns = load_transposed(rows);
            for (size_t f = first; f < std::min(first + simd_width, fields); ++f) values[f] = columns[f - first];
            for (const float*& row : rows) row += simd_width;
        }
        return std::bit_cast<Structure<FloatV>>(values);
    }

  private:
    struct alignas(64) Lines {
        value_type value{};
    };
    std::vector<Lines> lines_;
};

}  // namespace nephroid

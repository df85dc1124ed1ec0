// Structures of floats, each in cache lines of its own: read whole, from wherever they lie, as lanes of vectors.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
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
    /// Those at `index`, where active; zero elsewhere.
    Structure<FloatV> gather(const UintV& index, const FloatV::mask_type& active) const {
        const auto* first = reinterpret_cast<const float*>(lines_.data());
        const UintV at = index * static_cast<uint32_t>(sizeof(Lines) / sizeof(float));
        std::array<FloatV, fields> values;
        for (size_t f = 0; f < fields; ++f) values[f] = nephroid::gather(first + f, at, active);
        return std::bit_cast<Structure<FloatV>>(values);
    }

  private:
    struct alignas(64) Lines {
        value_type value{};
    };
    std::vector<Lines> lines_;
};

}  // namespace nephroid

// Cached slope lobes, each in cache lines of its own: a mixture's lobes are read whole, from wherever they lie.
#pragma once

#include <array>
#include <bit>
#include <vector>

#include "guiding/slope_warp.h"

namespace nephroid {

class SlopeLobeArray {
  public:
    using value_type = CachedSlopeLobe<float>;
    static constexpr size_t fields = sizeof(value_type) / sizeof(float);

    SlopeLobeArray() = default;
    explicit SlopeLobeArray(const std::vector<value_type>& lobes) : lobes_(lobes.size()) {
        for (size_t i = 0; i < lobes.size(); ++i) set(i, lobes[i]);
    }

    size_t size() const { return lobes_.size(); }
    bool empty() const { return lobes_.empty(); }
    friend size_t bytes_of(const SlopeLobeArray& lobes) { return lobes.lobes_.size() * sizeof(Lines); }

    void set(size_t i, const value_type& lobe) { lobes_[i].lobe = lobe; }
    const value_type& get(size_t i) const { return lobes_[i].lobe; }

    /// Soon wanted.
    void prefetch(size_t i) const {
        for (size_t line = 0; line < sizeof(Lines); line += alignof(Lines)) {
            __builtin_prefetch(reinterpret_cast<const std::byte*>(&lobes_[i]) + line);
        }
    }
    /// The lobes at `index`, where active; zero elsewhere.
    CachedSlopeLobe<FloatV> gather(const UintV& index, const FloatV::mask_type& active) const {
        const auto* first = reinterpret_cast<const float*>(lobes_.data());
        const UintV at = index * static_cast<uint32_t>(sizeof(Lines) / sizeof(float));
        std::array<FloatV, fields> values;
        for (size_t f = 0; f < fields; ++f) values[f] = nephroid::gather(first + f, at, active);
        return std::bit_cast<CachedSlopeLobe<FloatV>>(values);
    }

  private:
    struct alignas(64) Lines {
        value_type lobe;
    };
    std::vector<Lines> lobes_;
};

}  // namespace nephroid

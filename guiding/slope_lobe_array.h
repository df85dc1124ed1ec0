// Cached slope lobes as structures of arrays: as many as fit are loaded into vectors at once.
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
    explicit SlopeLobeArray(const std::vector<value_type>& lobes) : size_(lobes.size()), values_(size_ * fields) {
        for (size_t i = 0; i < size_; ++i) set(i, lobes[i]);
    }

    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    friend size_t bytes_of(const SlopeLobeArray& lobes) { return lobes.values_.size() * sizeof(float); }

    void set(size_t i, const value_type& lobe) {
        const auto values = std::bit_cast<std::array<float, fields>>(lobe);
        for (size_t f = 0; f < fields; ++f) values_[f * size_ + i] = values[f];
    }
    value_type get(size_t i) const {
        std::array<float, fields> values;
        for (size_t f = 0; f < fields; ++f) values[f] = values_[f * size_ + i];
        return std::bit_cast<value_type>(values);
    }
    /// The lobes at `index`, where active; zero elsewhere.
    CachedSlopeLobe<FloatV> gather(const UintV& index, const FloatV::mask_type& active) const {
        std::array<FloatV, fields> values;
        for (size_t f = 0; f < fields; ++f) values[f] = nephroid::gather(&values_[f * size_], index, active);
        return std::bit_cast<CachedSlopeLobe<FloatV>>(values);
    }

  private:
    size_t size_ = 0;
    std::vector<float> values_;
};

}  // namespace nephroid

// Discrete distribution with constant-time sampling (Walker's alias method, built as by Vose 1991).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace nephroid {

class AliasTable {
  public:
    AliasTable() = default;
    /// Weights >= 0 and finite; where all vanish the distribution is uniform.
    explicit AliasTable(std::span<const float> weights);

    size_t size() const { return entries_.size(); }
    float probability(size_t i) const { return entries_[i].probability; }
    /// Index drawn with u in [0, 1), and u remapped to [0, 1) for further use.
    size_t sample(float& u) const;

  private:
    struct Entry {
        float threshold;  ///< Below it the entry itself, above it its alias.
        uint32_t alias;
        float probability;  ///< Of this entry's own index.
    };
    std::vector<Entry> entries_;
};

}  // namespace nephroid

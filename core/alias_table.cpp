#include "core/alias_table.h"

#include <algorithm>

namespace nephroid {

AliasTable::AliasTable(std::span<const float> weights) : entries_(weights.size()) {
    const auto n = weights.size();
    double sum = 0.0;
    for (const float w : weights) sum += w;
    // Scaled so that the average entry holds 1: entries below take the rest from one above.
    std::vector<double> scaled(n);
    std::vector<uint32_t> small;
    std::vector<uint32_t> large;
    for (size_t i = 0; i < n; ++i) {
        const double probability = sum > 0.0 ? weights[i] / sum : 1.0 / static_cast<double>(n);
        entries_[i].probability = static_cast<float>(probability);
        scaled[i] = probability * static_cast<double>(n);
        (scaled[i] < 1.0 ? small : large).push_back(static_cast<uint32_t>(i));
    }
    while (!small.empty() && !large.empty()) {
        const uint32_t poor = small.back();
        const uint32_t rich = large.back();
        small.pop_back();
        entries_[poor].threshold = static_cast<float>(scaled[poor]);
        entries_[poor].alias = rich;
        scaled[rich] -= 1.0 - scaled[poor];
        if (scaled[rich] < 1.0) {
            large.pop_back();
            small.push_back(rich);
        }
    }
    // What rounding left over holds 1.
    for (const auto& rest : {small, large}) {
        for (const uint32_t i : rest) {
            entries_[i].threshold = 1.0F;
            entries_[i].alias = i;
        }
    }
}

size_t AliasTable::sample(float& u) const {
    const float scaled = u * static_cast<float>(entries_.size());
    const size_t i = std::min(static_cast<size_t>(scaled), entries_.size() - 1);
    const float inside = scaled - static_cast<float>(i);
    const Entry& entry = entries_[i];
    if (inside < entry.threshold) {
        u = std::min(inside / entry.threshold, 0x1.fffffep-1F);
        return i;
    }
    u = std::min((inside - entry.threshold) / (1.0F - entry.threshold), 0x1.fffffep-1F);
    return entry.alias;
}

}  // namespace nephroid

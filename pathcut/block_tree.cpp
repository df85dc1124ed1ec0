#include "pathcut/block_tree.h"

#include <tbb/parallel_invoke.h>

#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace nephroid {

namespace {

constexpr size_t parallel_threshold = 4096;

size_t widest_dimension(std::span<const OrderKey> keys, std::span<const uint32_t> items) {
    OrderKey low, high;
    low.fill(std::numeric_limits<float>::infinity());
    high.fill(-std::numeric_limits<float>::infinity());
    for (const uint32_t item : items) {
        for (size_t d = 0; d < low.size(); ++d) {
            low[d] = std::min(low[d], keys[item][d]);
            high[d] = std::max(high[d], keys[item][d]);
        }
    }
    size_t widest = 0;
    for (size_t d = 1; d < low.size(); ++d) {
        if (high[d] - low[d] > high[widest] - low[widest]) widest = d;
    }
    return widest;
}

/// Halves the items along their widest dimension, at a multiple of the largest run that is shorter than all of them.
void order(std::span<const OrderKey> keys, std::span<uint32_t> items) {
    if (items.size() <= block_size) return;
    size_t run = block_size;
    while (run * block_size < items.size()) run *= block_size;
    const size_t runs = (items.size() + run - 1) / run;
    const size_t middle = (runs / 2) * run;
    const size_t d = widest_dimension(keys, items);
    // NaN, which comes of lights on corners and of overflow, goes first: nth_element needs an order.
    const auto key = [&](uint32_t item) {
        const float k = keys[item][d];
        return std::isnan(k) ? -std::numeric_limits<float>::infinity() : k;
    };
    std::nth_element(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(middle), items.end(),
                     [&](uint32_t a, uint32_t b) { return key(a) < key(b) || (key(a) == key(b) && a < b); });
    const std::span<uint32_t> left = items.first(middle), right = items.subspan(middle);
    if (items.size() < parallel_threshold) {
        order(keys, left);
        order(keys, right);
    } else {
        tbb::parallel_invoke([=] { order(keys, left); }, [=] { order(keys, right); });
    }
}

}  // namespace

std::vector<uint32_t> compact_order(std::span<const OrderKey> keys) {
    std::vector<uint32_t> items(keys.size());
    std::iota(items.begin(), items.end(), 0U);
    order(keys, items);
    return items;
}

}  // namespace nephroid

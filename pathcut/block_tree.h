// A complete tree of sixteen children a node, without pointers.
//
// Items are reordered so that every run of 16^m of them is compact; level m of the tree bounds runs of 16^m items, and
// the children of item i of a level are block i of the level below: items 16 i .. 16 i + 15.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pathcut/bounds_block.h"

namespace nephroid {

/// What an item is sorted by: position and orientation, in units in which a step counts the same in each.
using OrderKey = std::array<float, 6>;

/// A permutation of the items that makes runs of 16^m compact, by medians of the widest dimension. Deterministic;
/// parallel.
std::vector<uint32_t> compact_order(std::span<const OrderKey> keys);

/// An item of a tree: `level` 0 is what the tree was built of.
struct TreeItem {
    uint32_t level = 0;
    uint32_t index = 0;
};

template <class Block>
struct BlockTree {
    size_t size = 0;                         ///< Items at level 0.
    std::vector<std::vector<Block>> levels;  ///< Level l holds the bounds of its items; the last has one block.

    size_t items_at(uint32_t level) const {
        const size_t run = size_t{1} << (4 * level);
        return (size + run - 1) / run;
    }
    /// Bounds all; its children are the last level.
    TreeItem root() const { return {static_cast<uint32_t>(levels.size()), 0}; }
    const Block& children(TreeItem item) const { return levels[item.level - 1][item.index]; }
    /// Children that exist: the last node of a level may have fewer than sixteen.
    size_t child_count(TreeItem item) const {
        return std::min(block_size, items_at(item.level - 1) - size_t{item.index} * block_size);
    }
    static TreeItem child(TreeItem item, size_t lane) {
        return {item.level - 1, item.index * static_cast<uint32_t>(block_size) + static_cast<uint32_t>(lane)};
    }
    size_t bytes() const {
        size_t sum = 0;
        for (const auto& level : levels) sum += level.size() * sizeof(Block);
        return sum;
    }
};

/// Builds all levels over `size` ordered items: bound(begin, end) bounds the items begin .. end - 1.
template <class Block, class Bound>
BlockTree<Block> build_block_tree(size_t size, const Bound& bound) {
    BlockTree<Block> tree;
    tree.size = size;
    for (size_t run = 1;; run *= block_size) {
        const size_t items = (size + run - 1) / run;
        std::vector<Block>& level =
            tree.levels.emplace_back(std::max<size_t>((items + block_size - 1) / block_size, 1));
        tbb::parallel_for(tbb::blocked_range<size_t>(0, items, 256), [&](const tbb::blocked_range<size_t>& range) {
            for (size_t i = range.begin(); i != range.end(); ++i) {
                store(level[i / block_size], i % block_size, bound(i * run, std::min((i + 1) * run, size)));
            }
        });
        if (items <= block_size) return tree;
    }
}

}  // namespace nephroid

// Points of surfaces at which mixtures are cached, and the nearest one to a shading point.
//
// Look-up: a tree of splits in the middle leads to a cell; the cell has the sixteen cached points nearest to it in
// one block, and vector comparisons find the nearest of these: no backtracking. The points found are not always the
// nearest of all, which guiding does not need.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "accel/wave_array.h"
#include "core/vec.h"

namespace nephroid {

/// In a cache line of its own.
struct alignas(64) CachedPoint {
    Vec3 position{0.0F};            ///< World space, metres.
    Vec3 normal{0.0F, 1.0F, 0.0F};  ///< Unit geometric normal, on the side that the point is for.
    float reach = 0.0F;             ///< Metres: the point serves no shading point further away.
    uint32_t first_lobe = 0;        ///< In LobeCache::lobes.
    uint32_t lobe_count = 0;
    float fraction = 0.0F;        ///< Probability of guiding here, below one; zero where there is no lobe.
    float other_radiance = 0.0F;  ///< What arrives besides the lobes' light, from anywhere: W/(m^2 sr) of luminance.
};

/// A cached point that serves a shading point.
struct FoundPoint {
    uint32_t index = 0;
    float squared_distance = 0.0F;  ///< m^2.
};

inline constexpr float similar_normal_cosine = 0.7F;  ///< Cached points of other orientation serve no shading point.

class CachedPointLookup {
  public:
    CachedPointLookup() = default;
    explicit CachedPointLookup(const std::vector<CachedPoint>& points);

    /// The nearest cached points of a similar normal and within their reach, nearest first: as many as `found` holds or
    /// fewer. Returns how many. Deterministic.
    size_t find(const Vec3& position, const Vec3& normal, std::span<FoundPoint> found) const;

    /// The same in two steps, for many positions: their cells, vector by vector, of the first `count` positions where
    /// `wanted` is not zero, and cell 0 elsewhere; then the points.
    void find_cells(const TripleArray& positions, const PathArray<float>& wanted, size_t count,
                    PathArray<uint32_t>& cells) const;
    /// A cell that will soon be asked.
    void prefetch(uint32_t cell) const {
        if (blocks_.empty()) return;
        for (size_t line = 0; line < sizeof(Block); line += alignof(Block)) {
            __builtin_prefetch(reinterpret_cast<const std::byte*>(&blocks_[cell]) + line);
        }
    }
    size_t find_in_cell(uint32_t cell, const Vec3& position, const Vec3& normal, std::span<FoundPoint> found) const;
    size_t bytes() const;

  private:
    static constexpr size_t block_size = 16;
    using Lanes = std::array<float, block_size>;
    struct alignas(64) Block {
        std::array<Lanes, 3> position{};
        std::array<Lanes, 3> normal{};  ///< Zero where there is no point: similar to nothing.
        Lanes squared_reach{};
        std::array<uint32_t, block_size> index{};
    };
    void build(const std::vector<CachedPoint>& points, std::span<uint32_t> own, std::span<const uint32_t> candidates,
               size_t node);
    static Block make_block(const std::vector<CachedPoint>& points, const std::vector<uint32_t>& indices);

    struct Node {
        float at = 0.0F;       ///< Points whose coordinate is below lie under the first child.
        uint32_t link = cell;  ///< The axis in the lowest bits, the first child above them; the second follows it.

        uint32_t axis() const { return link & axis_bits; }  ///< `cell`: a cell, whose block is `child`.
        uint32_t child() const { return link >> axis_bit_count; }
        static constexpr uint32_t axis_bit_count = 2, axis_bits = 3, cell = 3;
    };

    std::vector<Node> nodes_;
    std::vector<Block> blocks_;
};

}  // namespace nephroid

#include "guiding/cached_points.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>

#include "core/scene.h"
#include "core/simd.h"

namespace nephroid {

namespace {

constexpr size_t points_per_cell = 6;  // The rest of a block are neighbours.

float squared_distance(const Bounds& box, const Vec3& p) {
    const Vec3 outside = glm::max(glm::max(box.min - p, p - box.max), Vec3(0.0F));
    return glm::dot(outside, outside);
}

Bounds bounds_of(const std::vector<CachedPoint>& points, std::span<const uint32_t> indices) {
    Bounds box;
    for (const uint32_t i : indices) box.extend(points[i].position);
    return box;
}

/// The `count` candidates nearest to the box, in no particular order.
std::vector<uint32_t> nearest_candidates(const std::vector<CachedPoint>& points, const Bounds& box,
                                         std::span<const uint32_t> candidates, size_t count) {
    std::vector<std::pair<float, uint32_t>> ranked;
    ranked.reserve(candidates.size());
    for (const uint32_t i : candidates) ranked.emplace_back(squared_distance(box, points[i].position), i);
    if (count < ranked.size()) {
        std::nth_element(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(count), ranked.end());
        ranked.resize(count);
    }
    std::vector<uint32_t> nearest;
    nearest.reserve(ranked.size());
    for (const auto& [distance, index] : ranked) nearest.push_back(index);
    return nearest;
}

int longest_axis(const Vec3& extent) {
    if (extent.x >= extent.y) return extent.x >= extent.z ? 0 : 2;
    return extent.y >= extent.z ? 1 : 2;
}

}  // namespace

CachedPointLookup::CachedPointLookup(const std::vector<CachedPoint>& points) {
    if (points.empty()) return;
    std::vector<uint32_t> order(points.size());
    std::iota(order.begin(), order.end(), 0U);
    const std::vector<uint32_t> all = order;
    nodes_.resize(1);
    build(points, order, all, 0);
}

void CachedPointLookup::build(const std::vector<CachedPoint>& points, std::span<uint32_t> own,
                              std::span<const uint32_t> candidates, size_t node) {
    const Bounds box = bounds_of(points, own);
    const int axis = longest_axis(box.max - box.min);
    const float middle = 0.5F * (box.min[axis] + box.max[axis]);
    // Not where rounding leaves nothing between the ends.
    const bool is_cell = own.size() <= points_per_cell || !(box.min[axis] < middle && middle < box.max[axis]);
    // Enough neighbours for the cells below: their number falls with the node's own.
    const size_t wanted = is_cell ? block_size : std::max<size_t>(4 * own.size(), 4 * block_size);
    const std::vector<uint32_t> near = nearest_candidates(points, box, candidates, wanted);
    if (is_cell) {
        nodes_[node].link = static_cast<uint32_t>(blocks_.size()) << Node::axis_bit_count | Node::cell;
        blocks_.push_back(make_block(points, near));
        return;
    }
    const auto second =
        std::partition(own.begin(), own.end(), [&](uint32_t i) { return points[i].position[axis] < middle; });
    const auto first_count = static_cast<size_t>(second - own.begin());
    const auto child = static_cast<uint32_t>(nodes_.size());
    nodes_[node] = {middle, child << Node::axis_bit_count | static_cast<uint32_t>(axis)};
    nodes_.resize(child + size_t{2});
    build(points, own.first(first_count), near, child);
    build(points, own.subspan(first_count), near, child + 1);
}

CachedPointLookup::Block CachedPointLookup::make_block(const std::vector<CachedPoint>& points,
                                                       const std::vector<uint32_t>& indices) {
    Block block;
    for (size_t lane = 0; lane < indices.size(); ++lane) {
        const CachedPoint& point = points[indices[lane]];
        for (size_t c = 0; c < 3; ++c) {
            block.position[c][lane] = point.position[static_cast<int>(c)];
            block.normal[c][lane] = point.normal[static_cast<int>(c)];
        }
        block.squared_reach[lane] = point.reach * point.reach;
        block.index[lane] = indices[lane];
    }
    return block;
}

size_t CachedPointLookup::find(const Vec3& position, const Vec3& normal, std::span<FoundPoint> found) const {
    if (blocks_.empty()) return 0;
    Node node = nodes_[0];
    while (node.axis() != Node::cell) {
        const bool second = !(position[static_cast<int>(node.axis())] < node.at);
        node = nodes_[node.child() + (second ? 1U : 0U)];
    }
    return find_in_cell(node.child(), position, normal, found);
}

NEPHROID_FLATTEN void CachedPointLookup::find_cells(const TripleArray& positions, const PathArray<float>& wanted,
                                                    size_t count, PathArray<uint32_t>& cells) const {
    for (size_t i = 0; i < count; i += simd_width) {
        const Triple<FloatV> position = positions.load(i);
        auto active =
            first_lanes(blocks_.empty() ? 0 : count - i) && (FloatV(&wanted[i], stdx::vector_aligned) != FloatV(0.0F));
        UintV node(0U);
        UintV cell(0U);
        while (stdx::any_of(active)) {
            const UintV fields = node * static_cast<uint32_t>(sizeof(Node) / sizeof(float));
            const FloatV at = gather(&nodes_.data()->at, fields, active);
            const UintV link = gather(&nodes_.data()->link, fields, active);
            const FloatV axis = stdx::static_simd_cast<FloatV>(link & uint32_t{Node::axis_bits});
            const UintV child = link >> static_cast<int>(Node::axis_bit_count);
            const FloatV coordinate =
                select(axis == FloatV(0.0F), position.x, select(axis == FloatV(1.0F), position.y, position.z));
            const FloatV second = select(coordinate < at, FloatV(0.0F), FloatV(1.0F));
            const auto arrived = axis == FloatV(float{Node::cell});
            node = child + stdx::static_simd_cast<UintV>(second);
            const auto arrived_now =
                stdx::static_simd_cast<UintV>(select(arrived && active, FloatV(1.0F), FloatV(0.0F)));
            stdx::where(arrived_now != 0U, cell) = child;
            active = active && !arrived;
        }
        cell.copy_to(&cells[i], stdx::vector_aligned);
    }
}

size_t CachedPointLookup::find_in_cell(uint32_t cell, const Vec3& position, const Vec3& normal,
                                       std::span<FoundPoint> found) const {
    if (blocks_.empty()) return 0;
    const Block& block = blocks_[cell];
    // Distances as integers, which have the same order, with the lane in the last bits: the least tells both.
    constexpr uint32_t lane_bits = block_size - 1;
    constexpr auto infinity = std::bit_cast<uint32_t>(std::numeric_limits<float>::infinity());
    std::array<UintV, block_size / simd_width> keys;
    for (size_t i = 0; i < block_size; i += simd_width) {
        const auto load = [i](const Lanes& lanes) { return FloatV(&lanes[i], stdx::vector_aligned); };
        const FloatV dx = load(block.position[0]) - FloatV(position.x);
        const FloatV dy = load(block.position[1]) - FloatV(position.y);
        const FloatV dz = load(block.position[2]) - FloatV(position.z);
        const FloatV squared = dx * dx + dy * dy + dz * dz;
        const FloatV cosine = load(block.normal[0]) * FloatV(normal.x) + load(block.normal[1]) * FloatV(normal.y) +
                              load(block.normal[2]) * FloatV(normal.z);
        const auto usable = (squared <= load(block.squared_reach)) && (cosine > FloatV(similar_normal_cosine));
        const FloatV distance = select(usable, squared, FloatV(std::numeric_limits<float>::infinity()));
        keys[i / simd_width] =
            (std::bit_cast<UintV>(distance) & ~lane_bits) | (lane_numbers() + static_cast<uint32_t>(i));
    }
    for (size_t count = 0; count < found.size(); ++count) {
        UintV least = keys[0];
        for (size_t part = 1; part < keys.size(); ++part) least = stdx::min(least, keys[part]);
        const uint32_t key = stdx::hmin(least);
        if (key >= infinity) return count;
        found[count] = {block.index[key & lane_bits], std::bit_cast<float>(key & ~lane_bits)};
        for (UintV& part : keys) stdx::where(part == key, part) = infinity;
    }
    return found.size();
}

size_t CachedPointLookup::bytes() const {
    return nodes_.size() * sizeof(Node) + blocks_.size() * sizeof(Block);
}

}  // namespace nephroid

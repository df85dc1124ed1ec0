#include "guiding/quad_tree.h"

#include <algorithm>
#include <numeric>

namespace nephroid {

namespace {

constexpr float largest_below_one = 0x1.fffffep-1F;

/// A node's energy; 0 where rounding has left nothing: its quadrants then count alike.
float energy_of(const QuadNode& node) {
    return (node.energy[0] + node.energy[1]) + (node.energy[2] + node.energy[3]);
}

/// Chooses the lower half with the given probability and stretches u, so that it may be used again.
bool choose_upper_half(float lower_probability, float& u) {
    const bool upper = !(u < lower_probability);
    u = upper ? (u - lower_probability) / (1.0F - lower_probability) : u / lower_probability;
    u = std::min(u, largest_below_one);
    return upper;
}

/// The quadrant of the point, which becomes the point's place in it.
uint32_t enter_quadrant(Vec2& point) {
    point *= 2.0F;
    const uint32_t x = point.x >= 1.0F ? 1 : 0, y = point.y >= 1.0F ? 1 : 0;
    point -= Vec2(static_cast<float>(x), static_cast<float>(y));
    return x + 2 * y;
}

/// Adds the leaves below a node that the rectangle [low, high), in the node's coordinates, meets; `scale`: what an area
/// of one in these is worth.
void add_shares(const QuadNode* tree, uint32_t index, Vec2 low, Vec2 high, float scale,
                std::vector<QuadShare>& shares) {
    for (uint32_t q = 0; q < 4; ++q) {
        const Vec2 corner(static_cast<float>(q & 1), static_cast<float>(q >> 1));
        const Vec2 from = glm::max(low * 2.0F - corner, Vec2(0.0F)), to = glm::min(high * 2.0F - corner, Vec2(1.0F));
        if (!(from.x < to.x && from.y < to.y)) continue;
        const uint32_t child = tree[index].child[q];
        if (child != 0) {
            add_shares(tree, child, from, to, 0.25F * scale, shares);
        } else {
            shares.push_back({4 * index + q, 0.25F * scale * (to.x - from.x) * (to.y - from.y)});
        }
    }
}

/// Copies a tree, dividing and merging.
class Refiner {
  public:
    Refiner(const QuadNode* tree, const QuadRefinement& refinement, std::vector<QuadNode>& nodes)
        : tree_(tree),
          depth_(refinement.depth),
          least_energy_(refinement.share * total_energy(tree)),
          first_(nodes.size()),
          nodes_(nodes) {}

    void run() { append(tree_[0].energy, &tree_[0], 1); }

  private:
    /// A node of the given energies, whose quadrants are divided as those of `old` are (null: a new node).
    uint32_t append(const std::array<float, 4>& energy, const QuadNode* old, int depth) {
        const size_t node = nodes_.size();
        nodes_.push_back({energy, {}});
        for (size_t q = 0; q < 4; ++q) {
            const auto quadrant = static_cast<double>(energy[q]);
            if (depth >= depth_ || !(quadrant > least_energy_)) continue;
            const QuadNode* child = old != nullptr && old->child[q] != 0 ? &tree_[old->child[q]] : nullptr;
            std::array<float, 4> quarters;
            quarters.fill(0.25F * energy[q]);
            const uint32_t appended = append(child != nullptr ? child->energy : quarters, child, depth + 1);
            nodes_[node].child[q] = appended;
        }
        return static_cast<uint32_t>(node - first_);
    }

    const QuadNode* tree_;
    int depth_;
    double least_energy_;
    size_t first_;
    std::vector<QuadNode>& nodes_;
};

}  // namespace

QuadSample sample_quad_tree(const QuadNode* tree, Vec2 u) {
    Vec2 corner(0.0F);
    float size = 1.0F, density = 1.0F;
    for (uint32_t index = 0;;) {
        const QuadNode& node = tree[index];
        const float energy = energy_of(node);
        const bool known = energy > 0.0F;
        const bool right = choose_upper_half(known ? (node.energy[0] + node.energy[2]) / energy : 0.5F, u.x);
        const float below = node.energy[right ? 1 : 0], above = node.energy[right ? 3 : 2];
        const bool upper = choose_upper_half(known ? below / (below + above) : 0.5F, u.y);
        size *= 0.5F;
        corner += Vec2(right ? size : 0.0F, upper ? size : 0.0F);
        const uint32_t q = (right ? 1U : 0U) + (upper ? 2U : 0U);
        if (known) density *= 4.0F * node.energy[q] / energy;
        index = node.child[q];
        if (index == 0) return {glm::min(corner + size * u, Vec2(largest_below_one)), density};
    }
}

float quad_tree_density(const QuadNode* tree, Vec2 point) {
    float density = 1.0F;
    for (uint32_t index = 0;;) {
        const QuadNode& node = tree[index];
        const float energy = energy_of(node);
        const uint32_t q = enter_quadrant(point);
        if (energy > 0.0F) density *= 4.0F * node.energy[q] / energy;
        index = node.child[q];
        if (index == 0 || density == 0.0F) return density;
    }
}

QuadLeaf quad_leaf_at(const QuadNode* tree, Vec2 point) {
    QuadLeaf leaf{0, 1.0F};
    for (uint32_t index = 0;;) {
        const uint32_t q = enter_quadrant(point);
        leaf.quadrant = 4 * index + q;
        leaf.size *= 0.5F;
        index = tree[index].child[q];
        if (index == 0) return leaf;
    }
}

void shares_of_square(const QuadNode* tree, Vec2 point, float size, std::vector<QuadShare>& shares) {
    const float scale = 1.0F / (size * size);
    const float x = std::clamp(point.x - 0.5F * size, 0.0F, 1.0F - size);
    const float y = point.y - 0.5F * size;
    const auto add = [&](float low, float high) { add_shares(tree, 0, {x, low}, {x + size, high}, scale, shares); };
    add(std::max(y, 0.0F), std::min(y + size, 1.0F));
    if (y < 0.0F) add(1.0F + y, 1.0F);
    if (y + size > 1.0F) add(0.0F, y + size - 1.0F);
}

double total_energy(const QuadNode* tree) {
    return std::accumulate(tree->energy.begin(), tree->energy.end(), 0.0);
}

void append_refined(const QuadNode* tree, const QuadRefinement& refinement, std::vector<QuadNode>& nodes) {
    Refiner(tree, refinement, nodes).run();
}

}  // namespace nephroid

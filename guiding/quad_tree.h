// Distributions on the unit square as quadtrees: constant in each leaf, finer where there is more energy (Mueller et
// al. 2017).
//
// A tree is a run of nodes in an array that many trees may share, parents before their children. A node holds the
// energy of its four quadrants: sampling and densities read one node (32 bytes) for each level.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace nephroid {

/// Quadrant q = (x in the upper half) + 2 (y in the upper half).
struct QuadNode {
    std::array<float, 4> energy{};
    std::array<uint32_t, 4> child{};  ///< Counted from the tree's first node; 0: the quadrant is a leaf.
};

/// A leaf: a quadrant of a node.
struct QuadLeaf {
    uint32_t quadrant = 0;  ///< 4 * node + q, the node counted from the tree's first.
    float size = 0.0F;      ///< Edge of its square.
};

/// A part of a square deposit.
struct QuadShare {
    uint32_t quadrant;  ///< As in QuadLeaf.
    float share;        ///< Of the whole deposit.
};

/// When leaves are divided, and nodes merged.
struct QuadRefinement {
    double share = 0.01;  ///< rho: a quadrant with more than this share of the tree's energy has children.
    int depth = 20;       ///< Most levels of nodes.
};

struct QuadSample {
    Vec2 point;     ///< In [0, 1)^2.
    float density;  ///< quad_tree_density there.
};

/// What u in [0, 1)^2 is mapped to. The tree must have energy.
QuadSample sample_quad_tree(const QuadNode* tree, Vec2 u);
/// Per area of the square; its integral is one.
float quad_tree_density(const QuadNode* tree, Vec2 point);
QuadLeaf quad_leaf_at(const QuadNode* tree, Vec2 point);
/// Appends the leaves that the square of edge `size` about `point` meets, with the shares of its area that they hold.
/// y wraps around; at the ends of x the square is pushed inside. The shares' sum is one, but for rounding.
void shares_of_square(const QuadNode* tree, Vec2 point, float size, std::vector<QuadShare>& shares);

/// Sum over the quadrants of the tree's first node.
double total_energy(const QuadNode* tree);
/// Appends a tree of the same energy everywhere, divided where there is much: a new leaf gets a quarter of what its
/// parent had. Nodes that hold too little become leaves.
void append_refined(const QuadNode* tree, const QuadRefinement& refinement, std::vector<QuadNode>& nodes);

}  // namespace nephroid

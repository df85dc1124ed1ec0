// The points for which specular paths are wanted, and the tree over them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pathcut/block_tree.h"

namespace nephroid {

struct ReceiverTree {
    BlockTree<PointBlock> tree;
    size_t given = 0;             ///< Points that the tree was asked for.
    std::vector<uint32_t> order;  ///< Tree position -> index of the point as it was given.
};

/// Points that are not finite are left out.
ReceiverTree build_receiver_tree(std::span<const Vec3> points);

}  // namespace nephroid

// Down the tree of a set of beams, and back along a beam's chain of triangles.
#pragma once

#include <bit>

#include "pathcut/beam_tracing.h"
#include "pathcut/specular_chain.h"

namespace nephroid {

/// Calls visit(block index, lane bits) for all blocks of beams that may reach the points.
template <class Visit>
void for_beams_towards(const BlockTree<MirrorBlock>& tree, TreeItem item, const PointBound<float>& points,
                       float deviation, uint64_t& nodes_visited, const Visit& visit) {
    ++nodes_visited;
    const MirrorBlock& block = tree.children(item);
    uint32_t bits = 0;
    const PointBound<FloatV> viewer = broadcast(points);
    for (size_t first = 0; first < block_size; first += simd_width) {
        const MirrorBound<FloatV> beams = load(block, first);
        const Leg<FloatV> leg = make_leg<FloatV>(beams.points, viewer);
        bits |= lane_bits(!misses<FloatV>(beams, leg, FloatV(deviation))) << first;
    }
    bits &= (1U << tree.child_count(item)) - 1U;
    if (bits == 0) return;
    if (item.level == 1) {
        visit(item.index, bits);
        return;
    }
    for (; bits != 0; bits &= bits - 1) {
        const auto lane = static_cast<size_t>(std::countr_zero(bits));
        for_beams_towards(tree, BlockTree<MirrorBlock>::child(item, lane), points, deviation, nodes_visited, visit);
    }
}

/// The triangles behind a beam of `length` reflections, its own first.
inline PerVertex<uint32_t> chain_triangles(const BeamSets& sets, size_t length, uint32_t beam) {
    PerVertex<uint32_t> triangles{};
    for (size_t i = 0; i < length; ++i) {
        const BeamSet& set = sets.by_length[length - 1 - i];
        triangles[i] = set.triangle(beam);
        beam = set.parent(beam);
    }
    return triangles;
}

}  // namespace nephroid

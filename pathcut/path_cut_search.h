// The path-cut search (Sec. 3.2-3.3, Li et al. 2022): all tuples of reflecting triangles through which a light can
// reach the receivers by specular or nearly specular reflections, and the representative path of each.
//
// A path cut is a node of receivers, a chain of nodes of reflectors, and a light. Cuts that the half-vector test
// (cut_test.h) cannot reject are split at their thickest node, until only single points and triangles are left. The
// test runs for sixteen children at once. Groups of receivers are searched in parallel, depth first, so that memory is
// bounded by the result.
#pragma once

#include <functional>
#include <span>

#include "pathcut/receiver_tree.h"
#include "pathcut/representative_path.h"
#include "pathcut/tuple_solver.h"
#include "pathcut/visibility.h"

namespace nephroid {

struct SearchOptions {
    int shortest = 1;  ///< Paths of at least
    int bounces = 1;   ///< and at most so many reflections; clamped to 1 .. max_chain_length.
    Selection selection = Selection::local_minima;
    SolverOptions solver;
    /// Paths whose reflector points all lie closer than this, in units of the triangles' edges, become one; the paper
    /// merges at 0.1. Zero: equal paths only; negative: none.
    double merge_distance = 0.1;
    /// Path cuts that may be visited for each receiver, on average over a group of them; zero: no limit. What is left
    /// out is reported.
    uint64_t max_nodes_per_receiver = 0;
    /// If set, asked every few milliseconds by all threads: once it says yes, what is left is dropped and reported as
    /// above. The result then depends on when that was.
    std::function<bool()> should_stop;
    /// Chains of triangles of one length and light that are kept for paths of two and more reflections (about 200 bytes
    /// each while they are made); more are dropped, and reported.
    size_t max_beams = 4'000'000;
    /// If set, paths are tested for what is in their way, from the receivers as `receiver_points` describes them (in
    /// the order in which they were given), and triangles that are dark at their corners and centroid are left out.
    const Accelerator* accelerator = nullptr;
    std::span<const SurfacePoint> receiver_points;
    bool keep_occluded = false;  ///< Otherwise occluded paths are left out.
};

/// Deterministic unless stopped: the result does not depend on the number of threads. Paths of a receiver are ordered
/// by light, length and triangles.
RepresentativePaths find_representative_paths(const ReflectorTree& reflectors, const ReceiverTree& receivers,
                                              std::span<const PathLight> lights, const SearchOptions& options);

}  // namespace nephroid

// Paths of two and more reflections by way of beams: see beam.h.
//
// Finds exact paths, and of the relaxed ones those whose last reflection falls short. Bounds are conservative as far as
// light that is reflected exactly by all but the last reflector goes; what is linear is not, and has margins. How much
// is missed is measured against brute force (docs/pathcut.md).
#pragma once

#include "pathcut/beam.h"
#include "pathcut/path_merging.h"
#include "pathcut/receiver_tree.h"
#include "pathcut/tuple_solver.h"

namespace nephroid {

/// Beams of 1 .. `length` reflections from a light, to be asked for paths.
struct BeamSets {
    std::vector<BeamSet> by_length;  ///< [length - 1]
    uint64_t nodes_visited = 0;
    uint64_t dropped = 0;  ///< Beams left out because there were more than `max_beams` of one length.
    size_t bytes() const;
};

/// With an accelerator, beams that something blocks at all the points that are tested are left out.
BeamSets trace_beams(const ReflectorTree& reflectors, const PathLight& light, const LitTriangles& lit,
                     const Accelerator* accelerator, int length, size_t max_beams);

/// All paths of `length` reflections (2 or more) that beams bring to a receiver are appended to `found`.
void find_paths_in_beams(const ReflectorTree& reflectors, const BeamSets& beams, int length, const Vec3& receiver,
                         const PathLight& light, const SolverOptions& options, std::vector<FoundPath>& found,
                         SearchStatistics& statistics);

}  // namespace nephroid

// Paths of two and more reflections by way of beams: see beam.h.
//
// Finds exact paths, and of the relaxed ones those whose last reflection falls short. Bounds are conservative as far as
// light that is reflected exactly by all but the last reflector goes; what is linear is not, and has margins. How much
// is missed is measured against brute force (docs/pathcut.md).
#pragma once

#include "pathcut/beam_tracing.h"
#include "pathcut/path_merging.h"
#include "pathcut/receiver_tree.h"
#include "pathcut/tuple_solver.h"

namespace nephroid {

/// All paths of `length` reflections (2 or more) that beams bring to a receiver are appended to `found`.
void find_paths_in_beams(const ReflectorTree& reflectors, const BeamSets& beams, int length, const Vec3& receiver,
                         const PathLight& light, const SolverOptions& options, std::vector<FoundPath>& found,
                         SearchStatistics& statistics);

}  // namespace nephroid

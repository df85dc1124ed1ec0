// Lamps that the camera sees by two and more reflections: the representative paths of its pinhole.
//
// A search from the lights for a single receiver would cost as much as for thousands. From the pinhole, it is enough to
// look: mirror paths through a grid over the film tell where half vectors come near the normals, and the solver goes on
// from there.
#pragma once

#include <vector>

#include "integrators/guided/guided_paths.h"
#include "pathcut/path_merging.h"

namespace nephroid {

/// Unoccluded paths of two to `longest` reflections (at most max_chain_length), the camera's side first; their receiver
/// is 0. Perspective cameras. Highlights narrower than the grid's cells may be missed; the same paths for any number of
/// threads.
std::vector<FoundPath> find_mirrored_lamps(const RenderContext& context, const GuidedPaths& prepared,
                                           const PixelRegion& crop, int longest, const SolverOptions& options);

}  // namespace nephroid

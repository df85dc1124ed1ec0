// Cached points on the casters themselves, for paths of two and more reflections.
#pragma once

#include <vector>

#include "integrators/guided/photon_coverage.h"

namespace nephroid {

/// Points where photons of two and more reflections that landed near a cached point were reflected last, which is where
/// camera paths arrive, and where they were reflected for the second time, where lobes of one reflection lead on to the
/// light. About evenly spread, at most `most` of them. Deterministic.
std::vector<Receiver> choose_reflector_points(const RenderContext& context, const std::vector<CausticPhoton>& photons,
                                              const std::vector<PhotonCoverage>& coverage, size_t most);

}  // namespace nephroid

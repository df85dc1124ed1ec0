// Cached points on the casters themselves: where paths of two and more reflections meet the first of them.
#pragma once

#include <vector>

#include "integrators/guided/photon_coverage.h"

namespace nephroid {

/// Points where photons of two and more reflections were reflected last before they landed near a cached point: there
/// camera paths need to know where the reflection before may be. About evenly spread, at most `most` of them; none
/// where such photons bring next to nothing. Deterministic.
std::vector<Receiver> choose_reflector_points(const RenderContext& context, const std::vector<CausticPhoton>& photons,
                                              const std::vector<PhotonCoverage>& coverage, size_t most);

}  // namespace nephroid

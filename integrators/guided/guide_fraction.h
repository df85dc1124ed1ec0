// With which probability a cached point should guide: from the light that its lobes bring and from the light that comes
// otherwise.
#pragma once

#include <span>
#include <vector>

#include "guiding/cached_points.h"
#include "integrators/integrator.h"
#include "pathcut/receiver_sampler.h"

namespace nephroid {

/// `caustic` is the irradiance that each point's lobes bring (W/m^2, luminance); `lookup` finds `points`, which are the
/// receivers. All other indirect light is sampled by a few paths from every point, and shared with the points around
/// it: the bright spots that matter are rare.
///
/// With one sample from two techniques, guide for the caustic and BSDF for the rest, whose estimates have the second
/// moments c^2 and o^2, the variance is c^2 / b + o^2 / (1 - b), least at b = c / (c + o).
std::vector<float> guide_fractions(const RenderContext& context, std::span<const Receiver> receivers,
                                   std::span<const float> caustic, const CachedPointLookup& lookup);

}  // namespace nephroid

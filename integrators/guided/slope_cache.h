// Slope lobes for all cached points, fitted to the real surface and weighted by what they really bring (lobes.md,
// Sec. 2).
#pragma once

#include "guiding/slope_mixture.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

/// Cached points, and more of them (added to `found`) where photons show that these do not cover the light.
SlopeCache make_slope_cache(const RenderContext& context, GuidedPaths& found, const GuidedSettings& settings,
                            GuidedStatistics& statistics);

}  // namespace nephroid

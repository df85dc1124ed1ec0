// Slope lobes for all cached points, fitted to the real surface and weighted by what they really bring (lobes.md,
// Sec. 2).
#pragma once

#include "guiding/odds_moments.h"
#include "guiding/slope_mixture.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

struct MadeSlopeCache {
    SlopeCache cache;
    std::vector<OddsMoments> expected;  ///< Of each point (expected_moments); empty: nothing has been tried.
};

/// Cached points, and more of them (added to `found`) where photons show that these do not cover the light.
MadeSlopeCache make_slope_cache(const RenderContext& context, GuidedPaths& found, const GuidedSettings& settings,
                                GuidedStatistics& statistics);

}  // namespace nephroid

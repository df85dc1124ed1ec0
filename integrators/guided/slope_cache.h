// Slope lobes for all cached points, fitted to the real surface and weighted by what they really bring (lobes.md,
// Sec. 2).
#pragma once

#include <span>

#include "guiding/odds_moments.h"
#include "guiding/slope_mixture.h"
#include "integrators/guided/caustic_photons.h"

namespace nephroid {

struct MadeSlopeCache {
    SlopeCache cache;
    std::vector<OddsMoments> expected;  ///< Of each point (expected_moments); empty: nothing has been tried.
    std::vector<CausticPhoton> photons;
};

/// Cached points, and more of them (added to `found`) where photons show that these do not cover the light, and on
/// `mirrors`, the most important first.
MadeSlopeCache make_slope_cache(const RenderContext& context, GuidedPaths& found, std::span<const Receiver> mirrors,
                                const GuidedSettings& settings, GuidedStatistics& statistics);

}  // namespace nephroid

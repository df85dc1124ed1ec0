// Slope lobes for all cached points, fitted to the real surface and weighted by what they really bring (lobes.md,
// Sec. 2).
#pragma once

#include "guiding/slope_mixture.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

SlopeCache make_slope_cache(const RenderContext& context, const GuidedPaths& found, const GuidedSettings& settings);

}  // namespace nephroid

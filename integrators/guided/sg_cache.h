// The paper's lobes for all cached points (Secs. 3.4 and 3.5, Li et al. 2022).
#pragma once

#include "guiding/sg_mixture.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

/// With the fraction of the settings, or the paper's 0.5.
SgCache make_sg_cache(const RenderContext& context, const GuidedPaths& found, const GuidedSettings& settings);

}  // namespace nephroid

// Lamps mirrored in the casters, as the camera sees them: see guiding/film_guide.h.
#pragma once

#include <vector>

#include "guiding/film_guide.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

struct Highlights {
    FilmGuide film;  ///< Empty for parallel cameras.
    /// Where the camera meets the first of several mirrors on the way to a lamp, brightest first: there camera paths
    /// need to know where the next one is.
    std::vector<Receiver> mirrors;
};

/// `prepared` has neither receivers nor paths, before and after. `view`: what is rendered.
Highlights find_highlights(const RenderContext& context, GuidedPaths& prepared, const GuidedView& view,
                           const GuidedSettings& settings);

}  // namespace nephroid

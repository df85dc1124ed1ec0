// Lamps mirrored in the casters, as the camera sees them: see guiding/film_guide.h.
#pragma once

#include "guiding/film_guide.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

/// The guide of the film for highlights by one reflection. Empty for parallel cameras. `prepared` has neither receivers
/// nor paths, before and after. `view`: what is rendered.
FilmGuide find_highlights(const RenderContext& context, GuidedPaths& prepared, const GuidedView& view,
                          const GuidedSettings& settings);

}  // namespace nephroid

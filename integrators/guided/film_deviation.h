// How much the light of one film position deviates in the pixels of highlights: what tells where more of them pay.
#pragma once

#include <span>
#include <vector>

#include "guiding/film_guide.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

/// Of each of film.pixels(), luminance in W/(m^2 sr): measured for light of one reflection, which costs two rays; for
/// light of more, in proportion to what its lobes bring.
std::vector<float> film_deviations(const RenderContext& context, std::span<const PathLight> lights,
                                   const FilmGuide& film);

}  // namespace nephroid

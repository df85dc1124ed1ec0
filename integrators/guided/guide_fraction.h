// With which probability a cached point should guide: tried out with a few paths.
#pragma once

#include <span>
#include <vector>

#include "guiding/slope_mixture.h"
#include "integrators/integrator.h"
#include "pathcut/receiver_sampler.h"

namespace nephroid {

/// For every cached point, which is a receiver. Paths start from each in directions of mixture and BSDF alike, and the
/// second moment of the estimator is summed up for every fraction in question; the least one wins. What lobes do not
/// cover (light that is no caustic, caustics of more reflections) raises the moment of high fractions. Moments are
/// shared with the points around, for such light is rare. Deterministic.
std::vector<float> guide_fractions(const RenderContext& context, std::span<const Receiver> receivers,
                                   const SlopeCache& cache, const SlopeMixtureOptions& options);

}  // namespace nephroid

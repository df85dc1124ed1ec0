// What decides with which probability a cached point should guide: tried out with a few paths.
#pragma once

#include <span>
#include <vector>

#include "guiding/odds_moments.h"
#include "guiding/slope_mixture.h"
#include "integrators/guided/photon_coverage.h"
#include "integrators/integrator.h"
#include "pathcut/receiver_sampler.h"

namespace nephroid {

/// What trial paths at a cached point tell.
struct GuideTrial {
    OddsMoments moments{};        ///< Of the estimator at a diffuse receiver.
    float other_radiance = 0.0F;  ///< CachedPoint::other_radiance.
};

/// For every cached point, which is a receiver. Paths start from each in directions of mixture and BSDF alike, and sum
/// up the second moments of the estimator, for any fraction. What lobes do not cover (light that is no caustic,
/// caustics of more reflections) raises the moment of high fractions. Such light is rare: moments are shared with the
/// points around, and where photons (with their `coverage` by the cache) have found caustic light that is left to the
/// BSDF, it counts as they say. Deterministic.
std::vector<GuideTrial> try_guide(const RenderContext& context, std::span<const Receiver> receivers,
                                  const SlopeCache& cache, const SlopeMixtureOptions& options,
                                  const std::vector<CausticPhoton>& photons,
                                  const std::vector<PhotonCoverage>& coverage);

}  // namespace nephroid

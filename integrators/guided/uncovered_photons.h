// Photons of two and more reflections that a cache leaves to the BSDF, and lobes for them.
#pragma once

#include <vector>

#include "integrators/guided/photon_coverage.h"
#include "integrators/guided/photon_lobes.h"

namespace nephroid {

class UncoveredPhotons {
  public:
    /// Keeps a reference to the cache.
    UncoveredPhotons(const SlopeCache& cache, const std::vector<CausticPhoton>& photons,
                     const std::vector<PhotonCoverage>& coverage);

    /// From those around the point.
    std::vector<CachedSlopeLobe<float>> lobes_at(const CachedPoint& point) const;

  private:
    const SlopeCache& cache_;
    std::vector<uint32_t> first_;  ///< Of each cached point, and one more.
    std::vector<PhotonOrigin> origins_;
};

}  // namespace nephroid

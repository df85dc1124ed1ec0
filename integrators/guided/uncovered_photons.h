// Photons that a cache leaves to the BSDF, mostly of two and more reflections, and lobes for them.
#pragma once

#include <vector>

#include "integrators/guided/photon_coverage.h"
#include "integrators/guided/photon_lobes.h"

namespace nephroid {

class UncoveredPhotons {
  public:
    /// Keeps a reference to the cache. Photons of one reflection count only `with_single`: where their paths have not
    /// been searched for.
    UncoveredPhotons(const SlopeCache& cache, const std::vector<CausticPhoton>& photons,
                     const std::vector<PhotonCoverage>& coverage, bool with_single);

    /// From those around the point.
    std::vector<CachedSlopeLobe<float>> lobes_at(const CachedPoint& point) const;

  private:
    const SlopeCache& cache_;
    std::vector<uint32_t> first_;        ///< Of each cached point, and one more.
    std::vector<LandedPhoton> photons_;  ///< Those of each point.
};

}  // namespace nephroid

// Path tracing guided to caustics by representative specular paths (Li et al. 2022).
//
// Use it for caustics of glossy metal (alpha up to 0.1) under small lights. Before rendering, a cache of mixtures of
// lobes is made (guided_cache.h); then every vertex that is not a perfect mirror samples its direction from the nearest
// mixture or from its BSDF, weighted by both densities together, so that the mean does not depend on what the cache
// holds. Light that is not a caustic, environments and large lights are path traced as ever. Without a caster or a
// small light it is the path tracer.
#pragma once

#include <optional>

#include "integrators/guided/guided_cache.h"

namespace nephroid {

class GuidedIntegrator final : public Integrator {
  public:
    /// Makes the cache; keeps a reference to the context.
    GuidedIntegrator(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                     const GuidedSettings& settings);
    std::string name() const override { return "guided"; }
    std::unique_ptr<IntegratorWorker> make_worker() const override;
    std::optional<IntegratorStatistics> statistics() const override;

    /// Null where nothing is to be guided to.
    const DirectionalGuide* guide() const { return guide_ ? &*guide_ : nullptr; }
    const LobeCache<SgLobe>& cache() const { return cache_; }
    const RenderContext& context() const { return context_; }

  private:
    const RenderContext& context_;
    GuidedStatistics statistics_;
    LobeCache<SgLobe> cache_;
    std::optional<CachedGuide<SgMixture>> guide_;
};

}  // namespace nephroid

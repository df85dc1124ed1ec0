// Path tracing guided to caustics by representative specular paths (Li et al. 2022), with the paper's lobes or with
// slope lobes.
//
// Use it for caustics of glossy metal (alpha up to 0.1) under small lights. Before rendering, a cache of mixtures of
// lobes is made (guided_paths.h, then sg_cache.h or slope_cache.h); then vertices sample their direction from the
// mixture of the nearest cached points or from their BSDF, weighted by both densities together, so that the mean does
// not depend on what the cache holds. Light that is not a caustic, environments and large lights are path traced as
// ever. Without a caster or a small light it is the path tracer.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "guiding/film_guide.h"
#include "integrators/guided/fraction_learner.h"
#include "integrators/guided/sg_cache.h"
#include "integrators/guided/slope_cache.h"
#include "integrators/subpaths/light_tracing.h"

namespace nephroid {

/// What the cache holds for a surface point.
struct GuideFacts {
    float distance = 0.0F;  ///< To the nearest cached point that serves it, metres.
    size_t lobe_count = 0;
    LobeView heaviest;  ///< The lobe of the largest weight at the surface point: meaningful where there are lobes.
};

/// A cache and the guide that it feeds.
template <class Mixture>
struct MixtureCache {
    MixtureCache(typename Mixture::Cache made, const typename Mixture::Options& used)
        : cache(std::move(made)), options(used), guide(cache, options) {}
    typename Mixture::Cache cache;
    typename Mixture::Options options;
    CachedGuide<Mixture> guide;
};

class GuidedIntegrator final : public Integrator {
  public:
    /// Makes the cache; keeps a reference to the context.
    GuidedIntegrator(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                     const GuidedSettings& settings);
    std::string name() const override { return "guided"; }
    std::unique_ptr<IntegratorWorker> make_worker() const override;
    bool makes_splats() const override { return light_tracing_ != nullptr; }
    Learner* learner() const override;
    std::optional<IntegratorStatistics> statistics() const override;

    /// Null where nothing is to be guided to.
    const DirectionalGuide* guide() const;
    /// Of a point and its unit geometric normal; nothing where no cached point serves it.
    std::optional<GuideFacts> facts_at(const Vec3& position, const Vec3& normal) const;
    const RenderContext& context() const { return context_; }
    /// Null where there are camera paths only.
    const LightTracing* light_tracing() const { return light_tracing_.get(); }

    /// Null where lobes are of the other kind, or where nothing is to be guided to.
    const MixtureCache<SgMixtures>* spherical_gaussians() const { return spherical_gaussians_.get(); }
    const MixtureCache<SlopeMixtures>* slope_lobes() const { return slope_lobes_.get(); }

  private:
    bool light_paths_pay(const CasterReport& casters) const;
    /// `photons` tell where light paths should start.
    void add_light_tracing(const CasterReport& casters, const GuidedView& view, uint32_t one_in,
                           std::span<const CausticPhoton> photons);

    const RenderContext& context_;
    GuidedStatistics statistics_;
    FilmGuide film_guide_;
    std::unique_ptr<LightTracing> light_tracing_;  ///< Null: camera paths only.
    std::unique_ptr<MixtureCache<SgMixtures>> spherical_gaussians_;
    std::unique_ptr<MixtureCache<SlopeMixtures>> slope_lobes_;
    std::unique_ptr<FractionLearner> fractions_;  ///< Of slope_lobes_; null: they stay as they are.
    std::unique_ptr<AdaptiveSampling> adaptive_;  ///< Null: pixels are not learned about.
    std::unique_ptr<LearnerPair> both_;           ///< Null: one of them at most.
};

}  // namespace nephroid

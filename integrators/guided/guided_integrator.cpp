#include "integrators/guided/guided_integrator.h"

#include "integrators/path/path_worker.h"

namespace nephroid {

GuidedIntegrator::GuidedIntegrator(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                                   const GuidedSettings& settings)
    : context_(context) {
    const bool has_casters =
        std::find(casters.is_caster.begin(), casters.is_caster.end(), 1) != casters.is_caster.end();
    // A path through a caster scatters twice.
    if (!has_casters || casters.small_lights.empty() || context.max_depth < 2 || settings.guide_fraction <= 0.0F)
        return;
    cache_ = build_sg_cache(context, casters, view, settings, statistics_);
    if (!cache_.lobes.empty()) guide_.emplace(cache_, settings.mixture, settings.guide_fraction);
}

std::unique_ptr<IntegratorWorker> GuidedIntegrator::make_worker() const {
    return std::make_unique<PathWorker>(context_, guide());
}

std::optional<IntegratorStatistics> GuidedIntegrator::statistics() const {
    const GuidedStatistics& s = statistics_;
    return IntegratorStatistics{"guiding",
                                {{"cached_points", s.cached_points},
                                 {"lobes", s.lobes},
                                 {"bytes", s.bytes},
                                 {"path_cuts_visited", s.search.nodes_visited},
                                 {"leaf_path_cuts", s.search.leaf_cuts},
                                 {"newton_solves", s.search.solves},
                                 {"newton_converged", s.search.exact + s.search.relaxed},
                                 {"representative_paths", s.paths}},
                                {{"seconds_receivers", s.seconds_receivers},
                                 {"seconds_hierarchy", s.seconds_hierarchy},
                                 {"seconds_search", s.seconds_search},
                                 {"seconds_lobes", s.seconds_lobes}}};
}

}  // namespace nephroid

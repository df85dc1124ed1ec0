// Precomputation of the guided integrator: cached points where the camera looks, the representative specular paths to
// each, and the lobes that they make (Secs. 3.3 to 3.5, Li et al. 2022).
#pragma once

#include <cstdint>

#include "core/casters.h"
#include "guiding/lobe_cache.h"
#include "guiding/sg_mixture.h"
#include "integrators/integrator.h"
#include "pathcut/path_cut_search.h"

namespace nephroid {

struct GuidedSettings {
    uint32_t cached_points = 10000;  ///< About so many; more follow the caustic's shape better and take longer to make.
    int bounces = 2;                 ///< Reflections of the longest paths; 1 .. max_chain_length.
    double epsilon = 0.01;           ///< Eq. 1: where a glossy lobe ends to count.
    bool newton = true;              ///< Otherwise the triangles' centres stand for the paths' vertices (Fig. 13).
    double merge_distance = 0.1;     ///< SearchOptions::merge_distance.
    Selection selection = Selection::every_triangle;
    SgMixtureOptions mixture;
    float guide_fraction = 0.5F;  ///< Probability of the guide against the BSDF, 0 .. 1 exclusive.
};

struct GuidedStatistics {
    SearchStatistics search;
    size_t cached_points = 0;
    size_t lobes = 0;
    size_t paths = 0;
    size_t bytes = 0;  ///< Of the cache while rendering.
    double seconds_receivers = 0.0;
    double seconds_hierarchy = 0.0;
    double seconds_search = 0.0;  ///< Path cuts and Newton solves, which take turns.
    double seconds_lobes = 0.0;
};

/// The film that the cache is made for.
struct GuidedView {
    int width = 0;
    int height = 0;
    PixelRegion crop;
};

/// Deterministic: depends on the arguments, not on the number of threads.
LobeCache<SgLobe> build_sg_cache(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                                 const GuidedSettings& settings, GuidedStatistics& statistics);

}  // namespace nephroid

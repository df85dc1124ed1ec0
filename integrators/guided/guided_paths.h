// The first half of the guided integrator's precomputation: points where the camera looks, and the representative
// specular paths from the small lights to each (Sec. 3.3, Li et al. 2022).
#pragma once

#include <vector>

#include "core/casters.h"
#include "guiding/cached_points.h"
#include "guiding/sg_path.h"
#include "integrators/guided/guided_settings.h"
#include "integrators/integrator.h"
#include "pathcut/receiver_sampler.h"

namespace nephroid {

struct GuidedPaths {
    std::vector<Receiver> receivers;
    std::vector<PathLight> lights;
    ReflectorTree reflectors;
    RepresentativePaths paths;
};

/// Points where the camera looks, about `count`.
std::vector<Receiver> choose_receivers(const RenderContext& context, const GuidedView& view, uint32_t count);

/// How many points the settings' search_seconds allow.
uint32_t affordable_points(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                           const GuidedSettings& settings);

/// Deterministic: depends on the arguments, not on the number of threads.
GuidedPaths find_guided_paths(const RenderContext& context, const CasterReport& casters,
                              std::vector<Receiver> receivers, const GuidedSettings& settings,
                              GuidedStatistics& statistics);

/// Whether any path has more than one reflection.
bool has_long_paths(const GuidedPaths& found);

/// A path's vertices with their materials, from the receiver's side on.
PerVertex<GlossyVertex> glossy_vertices(const RenderContext& context, const GuidedPaths& found,
                                        const RepresentativePath& path, const Vec3d& receiver);

/// The path's light as its last vertex, at y, sees it.
PathEmitter emitter_at(const RenderContext& context, const PathLight& light, const Vec3d& y);

/// A cached point for the receiver, without a guide fraction yet.
CachedPoint make_cached_point(const Receiver& receiver, size_t first_lobe, size_t lobe_count);

}  // namespace nephroid

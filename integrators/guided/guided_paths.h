// The first half of the guided integrator's precomputation: points where the camera looks, and the representative
// specular paths from the small lights to each (Sec. 3.3, Li et al. 2022).
#pragma once

#include <span>
#include <vector>

#include "core/casters.h"
#include "guiding/cached_points.h"
#include "guiding/sg_path.h"
#include "integrators/guided/guided_settings.h"
#include "integrators/integrator.h"
#include "pathcut/receiver_sampler.h"

namespace nephroid {

/// A cached point serves shading points up to so many times the spacing of cached points away.
inline constexpr float reach_in_footprints = 4.0F;

struct GuidedPaths {
    std::vector<Receiver> receivers;
    std::vector<PathLight> lights;
    ReflectorTree reflectors;
    RepresentativePaths paths;  ///< Of each receiver: those of one reflection, then the longer ones.
    bool is_searched = true;    ///< Otherwise no paths are looked for: photons tell all.
};

/// The casters and small lights of a scene; no receivers and no paths yet.
GuidedPaths prepare_paths(const RenderContext& context, const CasterReport& casters, const GuidedSettings& settings);

/// Points where the camera looks, about `count`.
std::vector<Receiver> choose_receivers(const RenderContext& context, const GuidedView& view, uint32_t count);

/// As the settings have it, but no more than pixels.
uint32_t wanted_points(const GuidedView& view, const GuidedSettings& settings);

/// How many points the settings' search_seconds allow. `prepared` has no receivers yet.
uint32_t affordable_points(const RenderContext& context, const GuidedPaths& prepared, const GuidedView& view,
                           const GuidedSettings& settings);

/// The paths of found.receivers. Deterministic, whatever the number of threads, unless settings.search_end comes first:
/// then receivers that nothing is known about are dropped, evenly, and longer paths may be missing.
void search_paths(const RenderContext& context, const GuidedSettings& settings, GuidedPaths& found,
                  GuidedStatistics& statistics);

/// More receivers behind the others, with their paths of one reflection.
void add_receivers(const RenderContext& context, const GuidedSettings& settings, std::span<const Receiver> more,
                   GuidedPaths& found, GuidedStatistics& statistics);

/// All of this for given receivers.
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

// Stages that camera paths, and sub-paths from either end, have in common.
#pragma once

#include <vector>

#include "integrators/integrator.h"
#include "integrators/path/wave.h"

namespace nephroid {

/// Scatterings before Russian roulette: short paths carry most of the light and are never cut.
inline constexpr uint32_t roulette_start = 4;
inline constexpr float least_survival = 0.05F;

/// Camera rays of a block, with the film position jittered over the pixel (box filter) by the sampler's dimension pair
/// `film_dimension`. Fills `seeds` and `indices` by slot, and `paths` with a throughput of one.
void start_camera_paths(const RenderContext& context, const SampleBlock& block, uint32_t film_dimension,
                        AlignedArray<uint32_t>& seeds, AlignedArray<uint32_t>& indices, PathWave& paths);

/// Sets `path` of the vertices at hits on plain surfaces (Surfaces::is_plain), and how many there are. Lists all other
/// hits in `special`, for the caller to see to; also what hit nothing, if that is wanted.
void list_hits(const Surfaces& surfaces, const PathWave& paths, const HitBatch& hits, bool wants_misses,
               VertexWave& vertices, std::vector<uint32_t>& special);

/// Vertices 0 .. count - 1, whose `path` is set, at hits on plain surfaces. Leaves flags alone.
void interpolate_plain_vertices(const Surfaces& surfaces, const PathWave& paths, const HitBatch& hits,
                                VertexWave& vertices);

/// Appends the vertex of a hit on any surface. Leaves flags alone.
void push_vertex(const PathWave& paths, size_t path, const SurfaceInteraction& surface, VertexWave& vertices);

/// PathFlags at the surface that a path with the flags `before` has hit.
inline uint32_t path_flags_at(bool is_caster, uint32_t before) {
    if (!is_caster) return receiver_seen;
    return (before & receiver_seen) != 0 ? receiver_seen | on_caster_chain : 0U;
}

/// Whether a ray met what guides for casters (DirectionalGuide::is_for_casters) are meant for. Casters that emit are
/// not: the rivals of light sampling shall not include such a guide.
inline bool meets_caster(const Surfaces& surfaces, uint32_t object) {
    return object < surfaces.object_count() && surfaces.is_caster(object) && !surfaces.emits(object);
}

/// Depth, normal and albedo of what camera rays have hit.
void record_first_hits(const AovSelection& aovs, const HitBatch& hits, const VertexWave& vertices,
                       SampleBuffer& samples);

/// Shadow rays of the vertices that a light reaches: those whose contribution, in LightWave::radiance, is not zero.
void push_shadow_rays(const VertexWave& vertices, const LightWave& lights, ShadowWave& shadows);

}  // namespace nephroid

// What sub-paths from the light and from the camera have in common: tracing a wave, its surface points, scattering.
#pragma once

#include <vector>

#include "integrators/subpaths/light_tracing.h"

namespace nephroid {

/// Which way light runs along the sub-path.
enum class Transport : uint8_t { radiance, importance };

/// How a wave of vertices scatters.
struct Scattering {
    uint32_t bounce;  ///< Scatterings before.
    uint32_t lobe_dimension, direction_dimension;
    const AlignedArray<float>& reference;    ///< Per slot: the throughput that roulette judges is relative to it.
    bool connections = true;                 ///< LightTracing::connections.
    const GuideBatch* other_side = nullptr;  ///< Of paths the other way around, towards `wo`; null: not guided.
};

class SubpathTracer {
  public:
    explicit SubpathTracer(const RenderContext& context);

    /// Closest hits of `rays`.
    void trace(bool coherent);
    /// Vertices at hits on surfaces without texture, emission or instance; all other hits and misses are listed in
    /// `special`, for the caller to push_vertex what scatters.
    void find_vertices(bool wants_misses);
    /// Sums from the last scattering carried to the vertices; not for first vertices.
    void carry_sums();

    /// The directions (unit) that `scatter` will choose; anything where it chooses none.
    void sample_directions(const Scattering& how, TripleArray& directions) const;
    /// A direction at every vertex with its throughput, roulette and sums; the survivors become the next rays.
    template <Transport transport>
    void scatter(const Scattering& how);

    uint64_t ray_count() const { return ray_count_; }

    // Per slot of the block.
    AlignedArray<uint32_t> seeds, indices;
    // Per path of the wave, in the order of its rays.
    PathWave paths;
    MisArray path_sums;
    HitBatch hits;
    std::vector<uint32_t> special;
    // Per vertex of the wave.
    VertexWave vertices;
    MisArray sums;

  private:
    const RenderContext& context_;
    uint64_t ray_count_ = 0;
};

}  // namespace nephroid

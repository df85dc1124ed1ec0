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
    const AlignedArray<float>& reference;  ///< Per slot: the throughput that roulette judges is relative to it.
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

    /// A direction at every vertex with its throughput and roulette; the survivors become the next rays.
    template <Transport transport>
    void scatter(const Scattering& how);
    /// Their sums past the scattering. `connections`: LightTracing's. `other_side`: at the vertices of the rays, what
    /// the guide of paths the other way around does towards `wo`; null: not guided.
    void scatter_sums(bool connections, const GuideBatch* other_side);

    uint64_t ray_count() const { return ray_count_; }

    // Per slot of the block.
    AlignedArray<uint32_t> seeds, indices;
    // Per path of the wave, in the order of its rays.
    PathWave paths;
    PathArray<uint32_t> scattered_from;  ///< Vertex.
    MisArray path_sums;
    HitBatch hits;
    std::vector<uint32_t> special;
    // Per vertex of the wave.
    VertexWave vertices;
    MisArray sums;

  private:
    const RenderContext& context_;
    PathArray<float> cosine_, reverse_pdf_;  ///< Per path: of the last scattering.
    uint64_t ray_count_ = 0;
};

}  // namespace nephroid

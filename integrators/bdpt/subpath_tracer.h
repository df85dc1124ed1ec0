// What sub-paths from the light and from the camera have in common: tracing a wave, its surface points, scattering.
#pragma once

#include <vector>

#include "integrators/bdpt/bdpt_waves.h"

namespace nephroid {

/// Russian roulette as in the path tracer: from the fifth scattering on, by throughput.
inline constexpr uint32_t bdpt_roulette_start = 4;
inline constexpr float bdpt_least_survival = 0.05F;

/// Which way light runs along the sub-path.
enum class Transport : uint8_t { radiance, importance };

class SubpathTracer {
  public:
    explicit SubpathTracer(const RenderContext& context);

    /// Closest hits of `rays`.
    void trace(bool coherent);
    /// Vertices at hits on surfaces without texture, emission or instance; all other hits and misses are listed in
    /// `special`, for the caller to push_vertex what scatters.
    void find_plain_vertices(bool wants_misses);
    void push_vertex(size_t path, const SurfaceInteraction& surface);
    /// Sums from the last scattering carried to the vertices; not for first vertices.
    void carry_sums();

    /// A direction at every vertex with its throughput, roulette and sums; the survivors become the next rays. Sample
    /// dimensions `lobe` and `direction`. The throughput that roulette judges is relative to `reference[slot]`.
    template <Transport transport>
    void scatter(uint32_t bounce, uint32_t lobe_dimension, uint32_t direction_dimension,
                 const AlignedArray<float>& reference);

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
    void interpolate_plain_vertices();

    const RenderContext& context_;
    uint64_t ray_count_ = 0;
};

}  // namespace nephroid

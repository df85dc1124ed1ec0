// Connections between camera and light vertices (strategies s >= 2, t >= 2), gathered into batches of shadow rays.
#pragma once

#include "integrators/subpaths/subpath_tracer.h"

namespace nephroid {

class VertexConnections {
  public:
    explicit VertexConnections(const LightTracing& context);

    /// Connects every vertex of the wave, which lies past `bounce` scatterings, to the light vertices of its slot.
    void connect(uint32_t bounce, const VertexWave& vertices, const MisArray& sums, const LightVertices& light,
                 SampleBuffer& samples);
    uint64_t ray_count() const { return ray_count_; }

  private:
    void find_facing(const VertexWave& vertices, const LightVertices& light);
    void weigh(const VertexWave& vertices, const MisArray& sums, const LightVertices& light);
    void flush(const VertexWave& vertices, const MisArray& sums, const LightVertices& light, SampleBuffer& samples);

    const LightTracing& context_;
    // Pairs of vertices to connect.
    size_t pair_count_ = 0;
    PathArray<uint32_t> camera_vertex_, light_vertex_;
    ShadowWave shadows_;
    uint64_t ray_count_ = 0;
};

}  // namespace nephroid

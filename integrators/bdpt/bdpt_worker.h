// One thread's bidirectional path tracer.
#pragma once

#include "integrators/bdpt/vertex_connections.h"
#include "integrators/subpaths/light_subpaths.h"

namespace nephroid {

class BdptWorker final : public IntegratorWorker {
  public:
    explicit BdptWorker(const LightTracing& context);
    void render(const SampleBlock& block, SampleBuffer& samples) override;
    uint64_t rays() const override;

  private:
    void find_vertices(uint32_t bounce, SampleBuffer& samples);
    void start_sums();
    void set_flags();
    void add_escaped(size_t path, uint32_t bounce, SampleBuffer& samples);
    void add_sphere_light(size_t path, uint32_t light, uint32_t bounce, SampleBuffer& samples);
    void add_surface_emission(size_t path, const SurfaceInteraction& surface, uint32_t bounce, SampleBuffer& samples);
    void add_emission(size_t path, const Rgb& radiance, float weight, bool small_light, SampleBuffer& samples);
    void sample_lights(uint32_t bounce);
    void sample_light(size_t k, float u_select, Vec2 u);
    void weigh_lights();

    const LightTracing& context_;
    const RenderContext& render_;
    LightSubpaths light_;
    SubpathTracer tracer_;
    VertexConnections connections_;
    LightWave lights_;
    PathArray<float> ray_density_;  ///< Of emitted rays, for the directions of lights_.
    ShadowWave shadows_;
    AlignedArray<float> ones_;  ///< Camera sub-paths start with a throughput of one.
    uint64_t shadow_ray_count_ = 0;
};

}  // namespace nephroid

// One thread's path tracer.
#pragma once

#include "integrators/integrator.h"
#include "integrators/path/wave.h"

namespace nephroid {

class PathWorker final : public IntegratorWorker {
  public:
    explicit PathWorker(const RenderContext& context);
    void render(const SampleBlock& block, SampleBuffer& samples) override;
    uint64_t rays() const override { return rays_; }

  private:
    void clear(SampleBuffer& samples, size_t slots) const;
    void start_paths(const SampleBlock& block);
    void trace(uint32_t bounce);
    void collect_vertices(uint32_t bounce, SampleBuffer& samples);
    void add_escaped(size_t path, SampleBuffer& samples);
    void add_sphere_light(size_t path, uint32_t light, SampleBuffer& samples);
    void add_surface_emission(size_t path, const SurfaceInteraction& surface, SampleBuffer& samples);
    void add_emission(size_t path, const Rgb& radiance, float light_pdf, bool small_light, SampleBuffer& samples);
    void interpolate_plain_vertices();
    uint32_t flags_at(size_t path) const;
    void push_vertex(size_t path, const SurfaceInteraction& surface);
    void record_first_hits(SampleBuffer& samples) const;
    void sample_lights(uint32_t bounce);
    void sample_single_light(const PunctualLight& light);
    void weigh_lights();
    void push_shadow_rays();
    void add_unoccluded(uint32_t bounce, SampleBuffer& samples);
    void scatter(uint32_t bounce);

    const RenderContext& context_;
    uint64_t rays_ = 0;
    // Per slot of the block.
    AlignedArray<uint32_t> seeds_;
    AlignedArray<uint32_t> indices_;
    // Per path of the wave.
    PathWave paths_;
    HitBatch hits_;
    VertexWave vertices_;
    std::vector<uint32_t>
        special_paths_;  ///< Paths that hit a light or a surface that is not plain (Surfaces::is_plain).
    LightWave lights_;
    ShadowWave shadows_;
};

}  // namespace nephroid

// Light sub-paths of a block. Every vertex that the camera sees is splatted; where connections are made, vertices are
// stored for them.
#pragma once

#include <memory>
#include <optional>

#include "integrators/subpaths/subpath_tracer.h"

namespace nephroid {

class LightSubpaths {
  public:
    explicit LightSubpaths(const LightTracing& context);

    /// Traces the light sub-paths of the block and adds what the camera sees of them to samples.splats.
    void trace(const SampleBlock& block, SampleBuffer& samples);
    const LightVertices& vertices() const { return stored_; }
    uint64_t ray_count() const { return tracer_.ray_count() + shadow_ray_count_; }

  private:
    void start(const SampleBlock& block);
    void add_path(size_t slot, const EmissionSample& emission);
    void find_vertices(uint32_t bounce);
    void start_sums();
    void set_flags(uint32_t bounce);
    void store_vertices(uint32_t bounce);
    void ask_guide(const TripleArray& viewer);
    void look_from_camera();
    void connect_to_camera();
    void add_splats(SampleBuffer& samples);

    const LightTracing& context_;
    SubpathTracer tracer_;
    LightVertices stored_;
    std::unique_ptr<GuideWorker> guide_;     ///< Of camera paths; null: not guided.
    std::optional<GuideBatch> back_;         ///< What it would do at the vertices of the wave, towards `wo`.
    TripleArray viewer_;                     ///< Unit, to where a camera path would come from.
    float least_guided_alpha_ = 0.0F;        ///< DirectionalGuide::least_alpha.
    std::vector<uint32_t> slots_;            ///< Those with a light path.
    std::vector<EmissionSample> emissions_;  ///< Per slot.
    AlignedArray<float> emitted_;            ///< Per slot: largest component of the weight.
    ShadowWave shadows_;
    PathArray<float> film_x_, film_y_;  ///< Per ray to the camera.
    uint64_t shadow_ray_count_ = 0;
};

}  // namespace nephroid

// Light sub-paths of a block: one per sample. Their vertices are stored for connections, and every one that the camera
// sees is splatted.
#pragma once

#include "integrators/bdpt/subpath_tracer.h"

namespace nephroid {

class LightSubpaths {
  public:
    explicit LightSubpaths(const BdptContext& context);

    /// Traces the light sub-paths of the block's slots and adds what the camera sees of them to samples.splats.
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
    void connect_to_camera();
    void add_splats(SampleBuffer& samples);

    const BdptContext& context_;
    SubpathTracer tracer_;
    LightVertices stored_;
    std::vector<EmissionSample> emissions_;  ///< Per slot.
    AlignedArray<float> emitted_;            ///< Per slot: largest component of the weight.
    ShadowWave shadows_;
    PathArray<float> film_x_, film_y_;  ///< Per ray to the camera.
    uint64_t shadow_ray_count_ = 0;
};

}  // namespace nephroid

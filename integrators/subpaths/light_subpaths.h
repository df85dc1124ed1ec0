// Light sub-paths of a block. Every vertex that the camera sees is splatted; where connections are made, vertices are
// stored for them.
#pragma once

#include <memory>
#include <optional>

#include "integrators/subpaths/subpath_tracer.h"

namespace nephroid {

/// Rays to the camera, and what is needed to weigh what they carry.
struct SplatWave {
    explicit SplatWave(size_t capacity)
        : shadows(capacity),
          vertex(capacity),
          film_x(capacity),
          film_y(capacity),
          density(capacity),
          back_cosine(capacity),
          back_pdf(capacity),
          sums(capacity) {}
    ShadowWave shadows;  ///< Contributions without their weights; then with them.
    PathArray<uint32_t> vertex;
    PathArray<float> film_x, film_y;
    PathArray<float> density;      ///< Of a pixel's camera rays at the vertex, per area.
    PathArray<float> back_cosine;  ///< Of the direction that the light has come from,
    PathArray<float> back_pdf;     ///< and the density with which the BSDF would choose it, seen from the camera.
    MisArray sums;
};

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
    void connect_to_camera();
    void look_from_camera();
    void weigh_splats();
    FloatV camera_paths_of_splats(size_t i) const;
    void add_splats(SampleBuffer& samples);
    void look_from_next_vertices();
    void start_questions(GuideBatch& questions) const;
    void ask(size_t vertex, GuideBatch& questions) const;
    void answer(GuideBatch& questions);

    const LightTracing& context_;
    SubpathTracer tracer_;
    LightVertices stored_;
    std::unique_ptr<GuideWorker> guide_;  ///< Of camera paths; null: not guided.
    bool guide_is_for_casters_ = false;   ///< DirectionalGuide::is_for_casters.
    PathArray<uint32_t> left_caster_{0};  ///< Per path, if so: whether it comes from one (meets_caster).
    // What it would do at vertices of the wave, towards `wo`, for camera paths that come from the camera or from the
    // light path's next vertex; where that matters, zero fractions elsewhere.
    std::optional<GuideBatch> from_camera_, from_next_;
    TripleArray viewer_;                     ///< Per vertex: unit, to where the camera path would come from.
    float least_guided_alpha_ = 0.0F;        ///< DirectionalGuide::least_alpha.
    std::vector<uint32_t> slots_;            ///< Those with a light path.
    std::vector<EmissionSample> emissions_;  ///< Per slot.
    AlignedArray<float> emitted_;            ///< Per slot: largest component of the weight.
    SplatWave splats_;
    uint64_t shadow_ray_count_ = 0;
    int tile_x_ = 0, tile_y_ = 0;  ///< Of the block.
    bool is_recorded_ = false;     ///< By LightTracing::adaptive.
};

}  // namespace nephroid

// One thread's path tracer.
#pragma once

#include <optional>
#include <span>

#include "guiding/directional_guide.h"
#include "integrators/integrator.h"
#include "integrators/path/path_observer.h"
#include "integrators/path/pixel_samples.h"
#include "integrators/path/wave.h"
#include "integrators/subpaths/light_tracing.h"

namespace nephroid {

class PathWorker final : public IntegratorWorker {
  public:
    /// `guide` may be null: directions then come from the BSDF alone. `film_guide` may be null: film positions then lie
    /// evenly in their pixel. `light_tracing` may be null: otherwise samples are weighted against the splats of light
    /// paths, which are the caller's to add, with the same `adaptive`. That may be null: otherwise samples are means
    /// of as many paths as it says, and it is told what they found.
    PathWorker(const RenderContext& context, const DirectionalGuide* guide, const FilmGuide* film_guide = nullptr,
               const LightTracing* light_tracing = nullptr, AdaptiveSampling* adaptive = nullptr);
    void render(const SampleBlock& block, SampleBuffer& samples) override;
    /// Who watches the paths from now on; null: nobody. The observer must outlive its use.
    void set_observer(PathObserver* observer) {
        observer_ = observer;
        if (observer != nullptr) track_vertices();
    }
    /// Radiance that arrives at the rays' origins against their directions, in slots 0 .. count - 1 of `samples`; at
    /// most max_slots_per_block rays of unit direction. `first_index` numbers the samples of all rays alike; rays of
    /// different `seeds` are independent.
    void incident_radiance(const RayBatch& rays, std::span<const uint32_t> seeds, uint32_t first_index,
                           SampleBuffer& samples);
    uint64_t rays() const override { return rays_; }

  private:
    void start_special_samples(const SampleBlock& block);
    float shared_by(const PixelSamples::Sample& sample) const;
    void record_first_paths(const SampleBlock& block, const SampleBuffer& samples);
    void add_further_paths(SampleBuffer& samples);
    void trace_further_paths(SampleBuffer& samples);
    void count_rays(const PathArray<uint32_t>& slots, size_t count);
    void push_path(const Vec3& origin, const Vec3& direction, float throughput, uint32_t seed, uint32_t index);
    void trace_paths(SampleBuffer& samples);
    void track_vertices() {
        if (!scattered_from_) scattered_from_.emplace(max_slots_per_block);
    }
    void trace(uint32_t bounce);
    void arrive(const SampleBuffer& samples);
    void settle_guided();
    void count_guide_in(size_t path, size_t vertex);
    void collect_vertices(uint32_t bounce, SampleBuffer& samples);
    void add_escaped(size_t path, SampleBuffer& samples);
    void add_sphere_light(size_t path, uint32_t light, uint32_t bounce, SampleBuffer& samples);
    void add_surface_emission(size_t path, const SurfaceInteraction& surface, SampleBuffer& samples);
    void add_emission(size_t path, const Rgb& radiance, float weight, bool small_light, SampleBuffer& samples);
    float weight_of_hit(size_t path, float light_pdf) const;
    void carry_sums(uint32_t bounce);
    void find_ray_densities();
    void set_flags();
    void sample_lights(uint32_t bounce);
    void sample_single_light(const PunctualLight& light);
    void choose_directions(uint32_t bounce);
    void weigh_lights(uint32_t bounce, bool guided);
    template <bool guided>
    void scatter(uint32_t bounce);
    FloatV survival_probability(const FloatV& before, const FloatV& after, uint32_t bounce) const;
    BsdfSample<FloatV> guided_sample(size_t k, const Frame<FloatV>& frame) const;

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
    PathObserver* observer_ = nullptr;
    std::optional<PathArray<uint32_t>> scattered_from_;  ///< Of each ray: its vertex. Empty if nobody asks.
    std::optional<PixelSamples> pixel_samples_;          ///< Empty without film guide and adaptive sampling.
    std::optional<SampleBuffer> further_samples_;        ///< Of a wave of samples' second and further paths.
    std::vector<const PixelSamples::Sample*> further_;   ///< Whose they are.
    AdaptiveSampling* adaptive_;                         ///< Null: pixels are not learned about.
    bool counts_rays_ = false;                           ///< While it is told of paths.
    AlignedArray<uint32_t> rays_per_slot_{0};            ///< Of the wave, if so.
    std::unique_ptr<GuideWorker> guide_;                 ///< Null: not guided.
    float least_guided_alpha_ = 0.0F;                    ///< DirectionalGuide::least_alpha.
    bool guide_leads_on_ = false;                        ///< DirectionalGuide::leads_on.
    bool guide_is_for_casters_ = false;                  ///< DirectionalGuide::is_for_casters.
    bool guided_last_ = false;                           ///< It had a say in the wave's last scattering.
    std::vector<uint32_t> open_paths_, open_vertices_;   ///< Of settle_guided; keep their capacity.
    std::optional<GuidedWave> guided_;
    const LightTracing* light_tracing_;  ///< Null: no splats to weigh against.
    std::optional<RivalWave> rivals_;
};

}  // namespace nephroid

// Unidirectional path tracing with next event estimation.
//
// Use it for everything lit by large lights; caustics under small lights converge slowly (that is what `guided` is
// for), and a caustic of a point light in a perfect mirror is not found at all.
//
// Each vertex: one light sample (by power), one BSDF sample, weighted by the power heuristic; Russian roulette from the
// fifth scattering on, by throughput. A block of up to 1024 samples travels as a wave, stage by stage: trace (packets
// of 16), surfaces (scalar: memory), lights, BSDF (vectors), compaction. docs/performance.md has the measurements.
#pragma once

#include "integrators/integrator.h"
#include "integrators/path/adaptive_sampling.h"

namespace nephroid {

class PathIntegrator final : public Integrator {
  public:
    /// Keeps a reference to the context. One path for each sample.
    explicit PathIntegrator(const RenderContext& context) : context_(context) {}
    /// Adaptive, for the crop's pixels.
    PathIntegrator(const RenderContext& context, const PixelRegion& crop)
        : context_(context), adaptive_(std::make_unique<AdaptiveSampling>(crop)) {}
    std::string name() const override { return "path"; }
    std::unique_ptr<IntegratorWorker> make_worker() const override;
    Learner* learner() const override { return adaptive_.get(); }
    std::optional<IntegratorStatistics> statistics() const override;

  private:
    const RenderContext& context_;
    std::unique_ptr<AdaptiveSampling> adaptive_;  ///< Null: one path for each sample.
};

}  // namespace nephroid

// Practical path guiding: path tracing that learns, from its own samples, where light comes from (Mueller et al. 2017,
// with the improvements of the 2019 course notes).
//
// Use it for light that arrives by detours: rooms lit through gaps, indirect light with large lamps out of sight.
// Before the tree has learned, and for caustics smaller than its leaves, it is the path tracer, with the price of
// recording. It is PathWorker with another guide, and a recorder beside it. docs/ppg.md has the method.
#pragma once

#include <memory>

#include "guiding/sd_tree.h"
#include "integrators/integrator.h"
#include "integrators/learner.h"

namespace nephroid {

struct PpgSettings {
    SdTreeSettings tree;
    EarlierSamples earlier_samples = EarlierSamples::combined;
};

/// Mueller et al. 2017.
inline PpgSettings ppg_settings_2017() {
    PpgSettings settings;
    settings.tree.split_count = 12000.0;
    settings.tree.bsdf_fraction = 0.5F;
    settings.earlier_samples = EarlierSamples::discarded;
    return settings;
}

/// Mueller's chapter in "Path Guiding in Production", SIGGRAPH 2019 courses.
inline PpgSettings ppg_settings_2019() {
    PpgSettings settings;
    settings.tree.split_count = 4000.0;
    settings.tree.stochastic_spatial_filter = true;
    settings.tree.box_directional_filter = true;
    return settings;
}

class PpgLearner;

class PpgIntegrator final : public Integrator {
  public:
    /// Keeps a reference to the context.
    PpgIntegrator(const RenderContext& context, const PpgSettings& settings);
    ~PpgIntegrator() override;
    std::string name() const override { return "ppg"; }
    std::unique_ptr<IntegratorWorker> make_worker() const override;
    Learner* learner() const override;
    std::optional<IntegratorStatistics> statistics() const override;

    const SdTree& tree() const;

  private:
    const RenderContext& context_;
    std::unique_ptr<PpgLearner> learner_;
};

}  // namespace nephroid

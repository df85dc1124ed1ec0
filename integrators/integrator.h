// What an integrator gets, and what it must do. Time, passes, seeds, checkpoints and statistics belong to the driver.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "accel/accelerator.h"
#include "accel/surface.h"
#include "core/camera.h"
#include "core/film.h"
#include "core/light_set.h"
#include "core/sampler.h"
#include "core/scene.h"
#include "integrators/learner.h"

namespace nephroid {

/// The scene, ready to be traced, and the settings that every integrator shares. Immutable while rendering.
struct RenderContext {
    const Scene& scene;
    const Accelerator& accelerator;
    const Surfaces& surfaces;
    const LightSet& lights;
    CameraRays camera_rays;
    uint32_t max_depth = 12;  ///< Most surface scatterings on a path.
    uint32_t seed = 0;
    SamplerKind sampler = SamplerKind::sobol;
    AovSelection aovs;
};

/// One thread's state of an integrator: scratch memory and counters. Never shared between threads.
class IntegratorWorker {
  public:
    virtual ~IntegratorWorker() = default;
    /// Estimates every sample of the block. A sample's value depends on its pixel, index and seed alone,
    /// and on what the integrator's learner had learned.
    virtual void render(const SampleBlock& block, SampleBuffer& samples) = 0;
    /// Rays traced so far.
    virtual uint64_t rays() const = 0;
};

/// What an integrator reports of its own, as a group of the statistics.
struct IntegratorStatistics {
    std::string group;
    std::vector<std::pair<std::string, uint64_t>> counts;
    std::vector<std::pair<std::string, double>> measures;
};

class Integrator {
  public:
    virtual ~Integrator() = default;
    virtual std::string name() const = 0;
    virtual std::unique_ptr<IntegratorWorker> make_worker() const = 0;
    /// Whether blocks come with splats: one light path per sample of a block.
    virtual bool makes_splats() const { return false; }
    /// The integrator's part that learns between passes; null: there is none.
    virtual Learner* learner() const { return nullptr; }
    virtual std::optional<IntegratorStatistics> statistics() const { return std::nullopt; }
};

}  // namespace nephroid

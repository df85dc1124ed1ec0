// One thread's guided camera paths with light paths beside them: what the guide misses has a second way to the picture.
//
// A path of two and more scatterings can be made from the camera (it samples the light at its last vertex, or runs into
// it) and from the light (its last vertex is splatted where the camera sees it). The power heuristic weighs them by
// densities that hold the guide's; light paths of small lights aimed at casters are enough, for nothing depends on them
// where the guide is good.
#pragma once

#include "integrators/path/path_worker.h"
#include "integrators/subpaths/light_subpaths.h"

namespace nephroid {

class CombinedWorker final : public IntegratorWorker {
  public:
    /// Keeps references. Guide and adaptive sampling are light_tracing's.
    CombinedWorker(const FilmGuide* film_guide, const LightTracing& light_tracing)
        : camera_(light_tracing.render, light_tracing.guide, film_guide, &light_tracing, light_tracing.adaptive),
          light_(light_tracing) {}
    void render(const SampleBlock& block, SampleBuffer& samples) override {
        samples.splats.clear();
        camera_.render(block, samples);
        light_.trace(block, samples);
    }
    /// Of camera paths: PathWorker::set_observer.
    void set_observer(PathObserver* observer) { camera_.set_observer(observer); }
    uint64_t rays() const override { return camera_.rays() + light_.ray_count(); }

  private:
    PathWorker camera_;
    LightSubpaths light_;
};

}  // namespace nephroid

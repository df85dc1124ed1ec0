// Watches guided paths: of every scattering that the guide had a say in, what the path found by it. That counts as it
// does in the picture, throughput before the vertex and weights against light paths included: it is the picture's
// variance that shall be least.
#pragma once

#include <vector>

#include "integrators/guided/fraction_learner.h"
#include "integrators/path/path_observer.h"

namespace nephroid {

class FractionRecorder final : public PathObserver {
  public:
    /// Keeps a reference.
    explicit FractionRecorder(FractionLearner& learner) : learner_(learner) {}
    void scattered(const ScatteredPaths& scattered, const SampleBuffer& samples) override;
    void finished(const SampleBuffer& samples) override;

  private:
    struct Choice {
        uint32_t slot;
        uint32_t point;  ///< Cached.
        uint32_t bin;    ///< odds_bin of the direction.
        float density;   ///< p / (f + g): see odds_moments.h.
        float reached;   ///< What it had gathered, next event estimation at the vertex included; luminance.
    };

    FractionLearner& learner_;
    std::vector<Choice> choices_;  ///< Keeps its capacity from block to block.
};

}  // namespace nephroid

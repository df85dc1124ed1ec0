// What PPG learns, and when: the SD-tree is refined after 1, 2, 4, 8 ... samples.
#pragma once

#include "guiding/sd_tree_guide.h"
#include "integrators/learner.h"
#include "integrators/ppg/ppg_integrator.h"

namespace nephroid {

class PpgLearner final : public Learner {
  public:
    PpgLearner(const Bounds& bounds, const PpgSettings& settings);

    std::optional<uint32_t> next_lesson(uint32_t samples) const override;
    void learn(uint32_t samples) override;
    EarlierSamples earlier_samples() const override { return earlier_samples_; }
    std::vector<uint8_t> state() const override;
    void restore(const std::vector<uint8_t>& state) override;

    SdTree& tree() { return tree_; }
    const SdTreeGuide& guide() const { return guide_; }
    IntegratorStatistics statistics() const;

  private:
    SdTree tree_;
    SdTreeGuide guide_;
    EarlierSamples earlier_samples_;
    uint64_t lessons_ = 0;
    double seconds_refine_ = 0.0;  ///< This run only.
};

}  // namespace nephroid

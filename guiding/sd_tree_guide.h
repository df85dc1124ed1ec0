// The guide of an SD-tree.
#pragma once

#include "guiding/directional_guide.h"
#include "guiding/sd_tree.h"

namespace nephroid {

class SdTreeGuide final : public DirectionalGuide {
  public:
    /// Keeps a reference; the tree may be refined while nobody samples.
    explicit SdTreeGuide(const SdTree& tree) : tree_(tree) {}
    std::unique_ptr<GuideWorker> make_worker() const override;
    /// Mirrors, whose direction has no density, are their BSDF's alone.
    float least_alpha() const override;
    /// Light may come by any number of scatterings.
    bool leads_on() const override { return true; }

  private:
    const SdTree& tree_;
};

}  // namespace nephroid

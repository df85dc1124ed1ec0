// A representative path as a slope lobe, fitted to the real surface and weighted by what it really brings (lobes.md,
// Sec. 2).
#pragma once

#include "integrators/guided/lobe_weight.h"
#include "integrators/guided/secant_fit.h"

namespace nephroid {

class SlopeLobeMaker {
  public:
    /// Keeps references.
    SlopeLobeMaker(const RenderContext& context, const GuidedPaths& found);

    /// The weight is zero where the path is of no use.
    CachedSlopeLobe<float> lobe_of(const Receiver& receiver, const RepresentativePath& path) const;

  private:
    const GuidedPaths& found_;
    LobeWeights weights_;
    SecantFit fit_;
    double largest_extent_ = 1.0;  ///< Of footprints, metres.
};

}  // namespace nephroid

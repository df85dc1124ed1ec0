// A lobe's footprint fitted to the real surface: how far one may go along the reflector until the slope has grown by
// the lobe's width.
//
// The Jacobian at a point is the right measure where the surface bends evenly within the footprint. On a caustic's fold
// it is singular, and where triangles are smaller than the footprint it is that of one triangle only. The secant is
// right in both cases.
#pragma once

#include "guiding/slope_path.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

class SecantFit {
  public:
    /// Keeps references.
    SecantFit(const RenderContext& context, const GuidedPaths& found);

    /// Replaces the extents of the footprint of a path of one reflection where they are not small against its triangle.
    /// Eight rays or fewer in each of four directions.
    void apply(const Receiver& receiver, const SpecularChain& chain, const ChainEvaluation& evaluation, double width,
               double largest_extent, SlopeFootprint& footprint) const;

  private:
    struct Query;
    double extent_along(const Query& query, const Vec2d& direction, double first_guess) const;
    double squared_slope(const Query& query, const Vec2d& offset) const;

    const RenderContext& context_;
    const GuidedPaths& found_;
    std::vector<std::vector<uint32_t>> reflector_of_;  ///< By object and primitive: in the reflector tree, or
                                                       ///< no_triangle.
};

}  // namespace nephroid

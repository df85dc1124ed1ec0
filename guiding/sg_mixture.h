// The paper's mixture at one shading point: spherical Gaussians and a protective lobe over the hemisphere.
#pragma once

#include <span>

#include "accel/ray_batch.h"
#include "guiding/cached_points.h"
#include "guiding/sg_lobe.h"
#include "guiding/spherical_gaussian.h"

namespace nephroid {

struct SgMixtureOptions {
    SgWarp warp = SgWarp::mirror;
    float protective_weight = 0.05F;  ///< Of the uniform hemisphere; above zero, or the guide alone is not unbiased.
};

/// Reused for one shading point after the other: no allocation once it has its capacity.
class SgMixture {
  public:
    using Lobe = SgLobe;
    using Options = SgMixtureOptions;

    SgMixture(const Options& options, size_t most_lobes);

    /// Moves the lobes of a cached point to x, whose unit normal `normal` is the protective hemisphere's axis.
    void prepare(const CachedPoint& point, std::span<const SgLobe> lobes, const Vec3& x, const Vec3& normal);

    /// A direction with density pdf(); u_choice in [0, 1) picks the lobe. May lie below the horizon.
    Vec3 sample(float u_choice, float u, float v) const;
    /// Per solid angle; finite and, above the horizon, positive.
    float pdf(const Vec3& wi) const;

  private:
    using Array = AlignedArray<float>;
    Options options_;
    size_t count_ = 0;
    float protective_weight_ = 1.0F;  ///< What the lobes leave.
    Vec3 normal_{0.0F, 0.0F, 1.0F};
    Array axis_x_, axis_y_, axis_z_, sharpness_;
    Array weight_;   ///< Probability of the lobe.
    Array density_;  ///< weight / unit_integral: the density along the axis.
};

}  // namespace nephroid

// The paper's mixture at one shading point: spherical Gaussians and a protective lobe over the hemisphere.
#pragma once

#include <span>

#include "accel/ray_batch.h"
#include "core/bsdf.h"
#include "guiding/lobe_cache.h"
#include "guiding/sg_lobe.h"
#include "guiding/spherical_gaussian.h"

namespace nephroid {

struct SgMixtureOptions {
    SgWarp warp = SgWarp::mirror;
    float protective_weight = 0.05F;  ///< Of the uniform hemisphere.
    float least_alpha = delta_alpha;  ///< DirectionalGuide::least_alpha: every vertex that is not a mirror.
};

using SgCache = LobeCache<std::vector<SgLobe>>;

/// Reused for one shading point after the other: no allocation once it has its capacity.
class SgMixture {
  public:
    using Cache = SgCache;
    using Options = SgMixtureOptions;
    static constexpr size_t most_points = 1;

    /// Keeps a reference to the cache.
    SgMixture(const Cache& cache, const Options& options);

    /// Moves the lobes of the cached point to x, whose unit normal `normal` is the protective hemisphere's axis.
    /// Returns the probability of guiding: zero where nothing is known.
    float prepare(std::span<const FoundPoint> found, const Vec3& x, const Vec3& normal);

    /// A direction with density pdf(); u_choice in [0, 1) picks the lobe. May lie below the horizon.
    Vec3 sample(float u_choice, float u, float v) const;
    /// Per solid angle; finite and, above the horizon, positive.
    float pdf(const Vec3& wi) const;

    size_t lobe_count() const { return count_; }
    LobeView heaviest() const;

  private:
    using Array = AlignedArray<float>;
    const Cache& cache_;
    Options options_;
    size_t count_ = 0;
    float protective_weight_ = 1.0F;  ///< What the lobes leave.
    Vec3 normal_{0.0F, 0.0F, 1.0F};
    Array axis_x_, axis_y_, axis_z_, sharpness_;
    Array weight_;   ///< Probability of the lobe.
    Array density_;  ///< weight / unit_integral: the density along the axis.
};

}  // namespace nephroid

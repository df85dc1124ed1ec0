// Slope lobes of the cached points around a shading point, as one mixture with a protective lobe over the hemisphere.
//
// The union of several points' lobes covers solutions that appear or vanish between them; of the same solution each
// brings a copy, which costs time and no variance. Weights are the lobes' irradiance, so that a point without a caustic
// adds nothing, times a kernel of the distance.
#pragma once

#include <span>

#include "accel/ray_batch.h"
#include "core/casters.h"
#include "guiding/lobe_cache.h"
#include "guiding/slope_lobe_array.h"

namespace nephroid {

struct SlopeMixtureOptions {
    SlopeWarp warp = SlopeWarp::newton;
    float protective_weight = 0.02F;       ///< Of the uniform hemisphere.
    float least_alpha = max_caster_alpha;  ///< DirectionalGuide::least_alpha.
};

using SlopeCache = LobeCache<SlopeLobeArray>;

/// Reused for one shading point after the other: no allocation once it has its capacity.
class SlopeMixture {
  public:
    using Cache = SlopeCache;
    using Options = SlopeMixtureOptions;
    static constexpr size_t most_points = 3;

    /// Keeps a reference to the cache.
    SlopeMixture(const Cache& cache, const Options& options);

    /// Moves the lobes of the cached points to x, whose unit normal `normal` is the protective hemisphere's axis.
    /// Returns the probability of guiding: zero where nothing is known.
    float prepare(std::span<const FoundPoint> found, const Vec3& x, const Vec3& normal);
    /// A direction with density pdf(); u_choice in [0, 1) picks the lobe. May lie below the horizon.
    Vec3 sample(float u_choice, float u, float v) const;
    /// Per solid angle; finite and, above the horizon, positive.
    float pdf(const Vec3& wi) const;

    size_t lobe_count() const { return count_; }
    LobeView heaviest() const;

  private:
    void collect(const CachedPoint& point, float kernel);
    float warp(const Vec3& x);
    void normalise(float total);
    SlopeLobe<FloatV> load(size_t i) const;
    SlopeLobe<float> get(size_t i) const;

    using Array = AlignedArray<float>;
    const Cache& cache_;
    Options options_;
    size_t count_ = 0;
    float protective_weight_ = 1.0F;  ///< What the lobes leave.
    Vec3 normal_{0.0F, 0.0F, 1.0F};
    // Of each lobe, in the order of `found`: where it is cached, its point's kernel and position.
    AlignedArray<uint32_t> cached_;
    Array kernel_, from_x_, from_y_, from_z_;
    // At the shading point.
    std::array<Array, 9> lobe_;  ///< Axis, row1 and row2, coordinate by coordinate.
    Array weight_;               ///< Probability of the lobe.
    Array density_;              ///< Factor of relative_density.
};

}  // namespace nephroid

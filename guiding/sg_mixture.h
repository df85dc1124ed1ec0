// The paper's mixture at a shading point: spherical Gaussians and a protective lobe over the hemisphere. Groups have
// one shading point: a paper's mixture often has lobes enough to fill vectors.
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

class SgMixtures {
  public:
    using Cache = SgCache;
    using Options = SgMixtureOptions;
    static constexpr size_t most_points = 1;
    static constexpr size_t most_mixtures = 1;
    static constexpr bool is_for_casters = false;  ///< As published: its directions count wherever they lead.

    /// Keeps a reference to the cache.
    SgMixtures(const Cache& cache, const Options& options);

    // As in SlopeMixtures.
    void clear() { is_full_ = false; }
    bool is_full() const { return is_full_; }
    void add(std::span<const FoundPoint> found, const GuideVertex& vertex, float fraction);
    void add(std::span<const FoundPoint> found, const GuideVertex& vertex) {
        add(found, vertex, cached_fraction(found));
    }
    void prepare() {}
    float fraction(size_t) const { return fraction_; }
    Vec3 sample(size_t, float u_choice, float u, float v) const;
    float pdf(size_t, const Vec3& wi) const;
    static bool has_cached_fraction(float, float, float) { return true; }
    float cached_fraction(std::span<const FoundPoint> found) const;

    size_t lobe_count(size_t) const { return count_; }
    LobeView heaviest(size_t) const;

  private:
    using Array = AlignedArray<float>;
    const Cache& cache_;
    Options options_;
    bool is_full_ = false;
    float fraction_ = 0.0F;
    size_t count_ = 0;
    float protective_weight_ = 1.0F;  ///< What the lobes leave.
    Vec3 normal_{0.0F, 0.0F, 1.0F};
    Array axis_x_, axis_y_, axis_z_, sharpness_;
    Array weight_;   ///< Probability of the lobe.
    Array density_;  ///< weight / unit_integral: the density along the axis.
};

}  // namespace nephroid

// Slope lobes of the cached points around a shading point, as one mixture with a protective lobe over the hemisphere.
//
// The union of several points' lobes covers solutions that appear or vanish between them; of the same solution each
// brings a copy, which costs time and no variance. Weights are the lobes' irradiance, so that a point without a caustic
// adds nothing, times a kernel of the distance.
//
// Where the shading point has a narrow specular part itself (metal, a smooth coat), each lobe is joined by its product
// with that (product_lobe.h), and weights and the guide's probability are what both bring from the lobe to wo.
//
// Mixtures are made for a group of shading points at once: most points have a few lobes, and vectors are filled with
// those of many.
#pragma once

#include <span>

#include "accel/ray_batch.h"
#include "core/casters.h"
#include "guiding/line_array.h"
#include "guiding/lobe_cache.h"
#include "guiding/product_lobe.h"
#include "guiding/slope_warp.h"

namespace nephroid {

struct SlopeMixtureOptions {
    SlopeWarp warp = SlopeWarp::newton;
    float protective_weight = 0.02F;       ///< Of the uniform hemisphere.
    float least_alpha = max_caster_alpha;  ///< DirectionalGuide::least_alpha.
};

using SlopeCache = LobeCache<LineArray<CachedSlopeLobe>>;

class SlopeMixtures {
  public:
    using Cache = SlopeCache;
    using Options = SlopeMixtureOptions;
    static constexpr size_t most_points = 3;
    static constexpr size_t most_mixtures = 64;  ///< Of a group.
    static constexpr bool is_for_casters = true;

    /// Keeps a reference to the cache.
    SlopeMixtures(const Cache& cache, const Options& options);

    void clear();
    bool is_full() const { return size_ == most_mixtures || lobe_count_ >= enough_lobes; }
    /// Another shading point, not when full; its geometric normal is the protective hemisphere's axis. `fraction`: the
    /// cached_fraction of what was found.
    void add(std::span<const FoundPoint> found, const GuideVertex& vertex, float fraction);
    void add(std::span<const FoundPoint> found, const GuideVertex& vertex) {
        add(found, vertex, cached_fraction(found));
    }
    /// Moves the lobes of all added points to them. Before, nothing below may be called.
    void prepare();

    /// Probability of guiding at the k-th added point; zero: nothing is known, and nothing below may be called for it.
    float fraction(size_t k) const { return mixtures_[k].fraction; }
    /// A direction with density pdf(); u_choice in [0, 1) picks the lobe. May lie below the horizon.
    Vec3 sample(size_t k, float u_choice, float u, float v) const;
    /// Per solid angle; finite and, above the horizon, positive.
    float pdf(size_t k, const Vec3& wi) const;

    /// Whether the probability of guiding is the cached points' at such a surface: cached_fraction. Otherwise its BSDF
    /// and the lobes have a say, and fraction() tells.
    static bool has_cached_fraction(float alpha, float metallic, float coat_f90) {
        return !is_narrow(alpha, metallic, coat_f90);
    }
    float cached_fraction(std::span<const FoundPoint> found) const;

    size_t lobe_count(size_t k) const { return mixtures_[k].lobe_count; }
    LobeView heaviest(size_t k) const;

  private:
    /// Wider specular parts vary less over a lobe than is worth the work: with .3, a sample of the Snail, whose floor
    /// has .3, cost 2.4 times one without products instead of 1.2 times.
    static constexpr float widest_glossy_alpha = max_caster_alpha;
    /// Whether the specular part is narrow, but no mirror.
    static bool is_narrow(float alpha, float metallic, float coat_f90) {
        return alpha >= delta_alpha && alpha <= widest_glossy_alpha && (metallic > 0.0F || coat_f90 > 0.0F);
    }

    static constexpr size_t enough_lobes = 512;  ///< A group's arrays stay in the first-level cache.
    /// Further points are not asked then: many lobes overlap, and cover what moves between points by themselves.
    static constexpr size_t enough_for_mixture = 4;

    using Array = AlignedArray<float>;

    struct Mixture {
        Vec3 normal{0.0F, 1.0F, 0.0F};
        float fraction = 0.0F;
        float protective_weight = 1.0F;  ///< What the lobes leave.
        uint32_t first_lobe = 0;         ///< In `lobe_`.
        uint32_t lobe_count = 0;         ///< With products, once they are made.
        bool is_glossy = false;
        float other_radiance = 0.0F;  ///< CachedPoint::other_radiance.
    };

    float kernel_of(const FoundPoint& near) const;
    void look_from(const GuideVertex& vertex, Mixture& mixture);
    void collect(const CachedPoint& point, float kernel, const Vec3& x);
    void warp();
    void multiply();
    void weigh_glossy(Mixture& mixture);
    void keep_heavy(Mixture& mixture, float least_weight);
    void keep_heavy(const Mixture& mixture, const std::array<Array, 9>& lobes, const Array& weight,
                    const Array& determinant, float least_weight);
    void normalise(Mixture& mixture, float total);
    SlopeLobe<float> get(size_t i) const;

    const Cache& cache_;
    Options options_;
    std::array<Mixture, most_mixtures> mixtures_;
    size_t size_ = 0;
    bool has_glossy_ = false;
    size_t lobe_count_ = 0;
    // Of each lobe: where it is cached, its mixture, its point's kernel and position, the shading point.
    AlignedArray<uint32_t> cached_, mixture_;
    Array kernel_, from_x_, from_y_, from_z_, to_x_, to_y_, to_z_;
    // At the shading point. Vectors may reach behind a mixture's last lobe. What a glossy mixture keeps of its lobes
    // and products is behind all lobes.
    std::array<Array, 9> lobe_;  ///< Axis, row1 and row2, coordinate by coordinate.
    Array weight_;               ///< Probability of the lobe.
    Array density_;              ///< Factor of relative_density.
    size_t kept_end_ = 0;
    // At glossy shading points.
    LineArray<GlossyView> views_;   ///< Of each mixture.
    std::array<Array, 9> product_;  ///< As `lobe_`, without what is kept.
    Array product_density_;
    Array own_weight_, product_weight_, bsdf_weight_;  ///< What lobe, product and sampling of the BSDF bring to wo.
};

}  // namespace nephroid

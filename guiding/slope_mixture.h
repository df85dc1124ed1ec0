// Slope lobes of the cached points around a shading point, as one mixture with a protective lobe over the hemisphere.
//
// The union of several points' lobes covers solutions that appear or vanish between them; of the same solution each
// brings a copy, which costs time and no variance. Weights are the lobes' irradiance, so that a point without a caustic
// adds nothing, times a kernel of the distance.
//
// Where the shading point has a narrow specular part itself (metal, a smooth coat), each lobe is joined by its product
// with that (product_lobe.h), and weights and the guide's probability are what the products bring from lobe to wo.
//
// Mixtures are made for a group of shading points at once: most points have a few lobes, and vectors are filled with
// those of many.
#pragma once

#include <span>

#include "accel/ray_batch.h"
#include "core/casters.h"
#include "guiding/lobe_cache.h"
#include "guiding/product_lobe.h"
#include "guiding/slope_lobe_array.h"

namespace nephroid {

struct SlopeMixtureOptions {
    SlopeWarp warp = SlopeWarp::newton;
    float protective_weight = 0.02F;       ///< Of the uniform hemisphere.
    float least_alpha = max_caster_alpha;  ///< DirectionalGuide::least_alpha.
};

using SlopeCache = LobeCache<SlopeLobeArray>;

class SlopeMixtures {
  public:
    using Cache = SlopeCache;
    using Options = SlopeMixtureOptions;
    static constexpr size_t most_points = 3;
    static constexpr size_t most_mixtures = 64;  ///< Of a group.

    /// Keeps a reference to the cache.
    SlopeMixtures(const Cache& cache, const Options& options);

    void clear();
    bool is_full() const { return size_ == most_mixtures || lobe_count_ >= enough_lobes; }
    /// Another shading point, not when full; its geometric normal is the protective hemisphere's axis.
    void add(std::span<const FoundPoint> found, const GuideVertex& vertex);
    /// Moves the lobes of all added points to them. Before, nothing below may be called.
    void prepare();

    /// Probability of guiding at the k-th added point; zero: nothing is known, and nothing below may be called for it.
    float fraction(size_t k) const { return mixtures_[k].fraction; }
    /// A direction with density pdf(); u_choice in [0, 1) picks the lobe. May lie below the horizon.
    Vec3 sample(size_t k, float u_choice, float u, float v) const;
    /// Per solid angle; finite and, above the horizon, positive.
    float pdf(size_t k, const Vec3& wi) const;

    /// Otherwise it comes from the vertex's BSDF as well.
    bool has_cached_fraction(size_t k) const { return !mixtures_[k].is_glossy; }

    size_t lobe_count(size_t k) const { return mixtures_[k].lobe_count; }
    LobeView heaviest(size_t k) const;

  private:
    static constexpr size_t enough_lobes = 512;  ///< A group's arrays stay in the first-level cache.
    /// Further points are not asked then: many lobes overlap, and cover what moves between points by themselves.
    static constexpr size_t enough_for_mixture = 4;

    using Array = AlignedArray<float>;

    struct Mixture {
        Vec3 normal{0.0F, 1.0F, 0.0F};
        float fraction = 0.0F;
        float protective_weight = 1.0F;  ///< What the lobes leave.
        uint32_t first_lobe = 0;         ///< In the arrays below.
        uint32_t lobe_count = 0;
        bool is_glossy = false;       ///< The rest is set then only; products are as many as lobes.
        float other_radiance = 0.0F;  ///< CachedPoint::other_radiance.
        float diffuse_value = 0.0F;   ///< Luminance of the BSDF's diffuse part, 1/sr.
        GlossyView<float> view;
    };

    /// Adds up what the lobes of a mixture bring by one way of sampling them.
    struct Totals {
        float guided = 0.0F;   ///< By lobes and products.
        float diffuse = 0.0F;  ///< Of that, by the diffuse part.
        float bsdf = 0.0F;     ///< By sampling the BSDF.
    };

    /// Room for lobes and products, where vectors may reach behind the last one.
    Array doubled() const { return Array(2 * product_offset_ + simd_width); }
    void look_from(const GuideVertex& vertex, Mixture& mixture) const;
    Totals multiply(const Mixture& mixture);
    void weigh_glossy(Mixture& mixture);
    float density_of_lobes(size_t first, size_t count, const Triple<FloatV>& w) const;
    SlopeLobe<FloatV> load_lobe(size_t i) const;
    void collect(const CachedPoint& point, float kernel, const Vec3& x);
    void warp();
    void normalise(Mixture& mixture);
    void scale_weights(size_t first, size_t count, float scale);
    SlopeLobe<float> get(size_t i) const;

    const Cache& cache_;
    Options options_;
    std::array<Mixture, most_mixtures> mixtures_;
    size_t size_ = 0;
    size_t lobe_count_ = 0;
    // Of each lobe: where it is cached, its point's kernel and position, the shading point.
    AlignedArray<uint32_t> cached_;
    Array kernel_, from_x_, from_y_, from_z_, to_x_, to_y_, to_z_;
    // At the shading point. Vectors may reach behind a mixture's last lobe. The second halves hold the products.
    size_t product_offset_;
    std::array<Array, 9> lobe_;  ///< Axis, row1 and row2, coordinate by coordinate.
    Array weight_;               ///< Probability of the lobe.
    Array density_;              ///< Factor of relative_density.
};

}  // namespace nephroid

// Mixtures of lobes at cached points, and the guide that serves shading points from them.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "guiding/cached_points.h"
#include "guiding/directional_guide.h"

namespace nephroid {

template <class Lobe>
size_t bytes_of(const std::vector<Lobe>& lobes) {
    return lobes.size() * sizeof(Lobe);
}

/// `Lobes` is a container with size() and bytes_of, whose entries first_lobe .. first_lobe + lobe_count - 1 are a
/// point's.
template <class Lobes>
struct LobeCache {
    std::vector<CachedPoint> points;  ///< Those without lobes guide nowhere: there is no caustic as far as is known.
    Lobes lobes;
    CachedPointLookup lookup;

    size_t most_lobes() const {
        size_t most = 0;
        for (const CachedPoint& point : points) most = std::max<size_t>(most, point.lobe_count);
        return most;
    }
    size_t bytes() const { return points.size() * sizeof(CachedPoint) + bytes_of(lobes) + lookup.bytes(); }
};

/// One lobe, for people to look at.
struct LobeView {
    Vec3 axis{0.0F, 0.0F, 1.0F};  ///< Unit.
    float width = 0.0F;  ///< About the radius that holds half of it, radians; the geometric mean over directions.
};

/// The guide of a cache. A Mixture is made of (Cache, Options) and has a constant `most_points`, prepare(found points,
/// x, normal), which says the probability of guiding at x (zero: the mixture is not ready), sample and pdf.
template <class Mixture>
class CachedGuide final : public DirectionalGuide {
  public:
    using Cache = typename Mixture::Cache;
    using Options = typename Mixture::Options;

    /// Keeps a reference to the cache.
    CachedGuide(const Cache& cache, const Options& options) : cache_(cache), options_(options) {}
    std::unique_ptr<GuideWorker> make_worker() const override { return std::make_unique<Worker>(cache_, options_); }
    float least_alpha() const override { return options_.least_alpha; }

  private:
    class Worker final : public GuideWorker {
      public:
        Worker(const Cache& cache, const Options& options) : lookup_(cache.lookup), mixture_(cache, options) {}

        void guide(const GuidePoints& points, GuideBatch& batch) override {
            for (size_t k = 0; k < batch.count; ++k) {
                batch.guided[k] = 0.0F;
                if (batch.fraction[k] == 0.0F) continue;
                const Vec3 position = points.position.get(k), normal = points.geometric_normal.get(k);
                const size_t count = lookup_.find(position, normal, found_);
                const float fraction = mixture_.prepare(std::span(found_).first(count), position, normal);
                batch.fraction[k] = fraction;
                if (fraction == 0.0F) continue;
                if (batch.u_choice[k] < fraction) {
                    const float u_lobe = std::min(batch.u_choice[k] / fraction, largest_below_one);
                    batch.direction.set(k, mixture_.sample(u_lobe, batch.u[k], batch.v[k]));
                    batch.guided[k] = 1.0F;
                }
                batch.pdf[k] = mixture_.pdf(batch.direction.get(k));
                if (batch.wants_light_pdf) batch.light_pdf[k] = mixture_.pdf(points.light_direction.get(k));
            }
        }

      private:
        static constexpr float largest_below_one = 0x1.fffffep-1F;
        const CachedPointLookup& lookup_;
        Mixture mixture_;
        std::array<FoundPoint, Mixture::most_points> found_;
    };

    const Cache& cache_;
    Options options_;
};

}  // namespace nephroid

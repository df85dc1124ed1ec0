// Mixtures of lobes at cached points, and the guide that serves shading points from them.
//
// A Mixture type has a Lobe, Options, a constructor (Options, most lobes), prepare(point, lobes, x, normal), sample and
// pdf. Lobes of a point are contiguous.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "guiding/cached_points.h"
#include "guiding/directional_guide.h"

namespace nephroid {

template <class Lobe>
struct LobeCache {
    std::vector<CachedPoint> points;  ///< Those without lobes guide nowhere: where they are nearest, there is no
                                      ///< caustic as far as is known.
    std::vector<Lobe> lobes;
    CachedPointLookup lookup;

    std::span<const Lobe> lobes_of(const CachedPoint& point) const {
        return std::span(lobes).subspan(point.first_lobe, point.lobe_count);
    }
    size_t most_lobes() const {
        size_t most = 0;
        for (const CachedPoint& point : points) most = std::max<size_t>(most, point.lobe_count);
        return most;
    }
    size_t bytes() const { return points.size() * sizeof(CachedPoint) + lobes.size() * sizeof(Lobe) + lookup.bytes(); }
};

template <class Mixture>
class CachedGuide final : public DirectionalGuide {
  public:
    using Cache = LobeCache<typename Mixture::Lobe>;

    /// Keeps a reference to the cache. `fraction` in [0, 1): probability of guiding where a cached point is near.
    CachedGuide(const Cache& cache, const typename Mixture::Options& options, float fraction)
        : cache_(cache), options_(options), fraction_(fraction) {}
    std::unique_ptr<GuideWorker> make_worker() const override { return std::make_unique<Worker>(*this); }

  private:
    class Worker final : public GuideWorker {
      public:
        explicit Worker(const CachedGuide& guide)
            : guide_(guide), mixture_(guide.options_, guide.cache_.most_lobes()) {}

        void guide(const GuidePoints& points, GuideBatch& batch) override {
            const Cache& cache = guide_.cache_;
            const float fraction = guide_.fraction_;
            for (size_t k = 0; k < batch.count; ++k) {
                batch.guided[k] = 0.0F;
                if (batch.fraction[k] == 0.0F) continue;
                batch.fraction[k] = 0.0F;
                const Vec3 position = points.position.get(k), normal = points.geometric_normal.get(k);
                const uint32_t found = cache.lookup.find(position, normal);
                if (found == no_cached_point || cache.points[found].lobe_count == 0) continue;
                const CachedPoint& point = cache.points[found];
                mixture_.prepare(point, cache.lobes_of(point), position, normal);
                batch.fraction[k] = fraction;
                if (batch.u_choice[k] < fraction) {
                    const float u_lobe = std::min(batch.u_choice[k] / fraction, 0x1.fffffep-1F);
                    batch.direction.set(k, mixture_.sample(u_lobe, batch.u[k], batch.v[k]));
                    batch.guided[k] = 1.0F;
                }
                batch.pdf[k] = mixture_.pdf(batch.direction.get(k));
                if (batch.wants_light_pdf) batch.light_pdf[k] = mixture_.pdf(points.light_direction.get(k));
            }
        }

      private:
        const CachedGuide& guide_;
        Mixture mixture_;
    };

    const Cache& cache_;
    typename Mixture::Options options_;
    float fraction_;
};

}  // namespace nephroid

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
    bool leads_on = false;           ///< DirectionalGuide::leads_on: some lobe is of two or more reflections.
    bool serves_reflectors = false;  ///< Narrow metal is guided, too: there are points for it.

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

/// The guide of a cache. Mixtures are made of (Cache, Options) and hold those of a group of shading points: see
/// SlopeMixtures. Options have a least_alpha.
///
/// Most of the work is to prepare mixtures. Where the cached points alone tell how often to guide, one is prepared only
/// for a direction of its own or for a density that is wanted.
template <class Mixtures>
class CachedGuide final : public DirectionalGuide {
  public:
    using Cache = typename Mixtures::Cache;
    using Options = typename Mixtures::Options;

    /// Keeps a reference to the cache.
    CachedGuide(const Cache& cache, const Options& options) : cache_(cache), options_(options) {}
    std::unique_ptr<GuideWorker> make_worker() const override { return std::make_unique<Worker>(cache_, options_); }
    float least_alpha() const override { return cache_.serves_reflectors ? delta_alpha : options_.least_alpha; }
    bool leads_on() const override { return cache_.leads_on; }
    bool is_for_casters() const override { return Mixtures::is_for_casters; }

  private:
    class Worker final : public GuideWorker {
      public:
        Worker(const Cache& cache, const Options& options)
            : lookup_(cache.lookup), points_(cache.points), mixtures_(cache, options) {}

        void guide(const GuidePoints& points, GuideBatch& batch) override {
            if (cells_.size() < batch.count) cells_ = PathArray<uint32_t>(batch.count);
            lookup_.find_cells(points.position, batch.fraction, batch.count, cells_);
            asked_.clear();
            for (size_t k = 0; k < batch.count; ++k) {
                batch.guided[k] = 0.0F;
                if (batch.fraction[k] > 0.0F) asked_.push_back(static_cast<uint32_t>(k));
            }
            found_end_ = 0;
            for (size_t next = 0; next < asked_.size();) {
                next = collect_group(points, next, [&](uint32_t k, std::span<const FoundPoint> found) {
                    return fraction_wanted(points, batch, k, found);
                });
                for (size_t i = 0; i < group_size_; ++i) choose_direction(points, batch, i);
            }
        }

        void find_densities(const GuidePoints& points, std::span<const uint32_t> vertices, GuideBatch& batch) override {
            asked_.assign(vertices.begin(), vertices.end());
            found_end_ = 0;
            for (size_t next = 0; next < asked_.size();) {
                next = collect_group(points, next,
                                     [&](uint32_t k, std::span<const FoundPoint>) { return batch.fraction[k]; });
                for (size_t i = 0; i < group_size_; ++i) {
                    batch.pdf[group_[i]] = mixtures_.pdf(i, batch.direction.get(group_[i]));
                }
            }
        }

      private:
        static constexpr float largest_below_one = 0x1.fffffep-1F;
        // Memory's latency: cells are fetched so many vertices before cached points are found in them, and these so
        // many before their lobes are.
        static constexpr size_t cells_ahead = 8, points_ahead = 4;

        /// Cached points near a vertex.
        struct Found {
            std::array<FoundPoint, Mixtures::most_points> points;
            size_t count = 0;
        };

        Found& found_at(size_t k) { return found_[k % found_.size()]; }

        /// Cached points near the vertices asked for, the i-th and some after it.
        std::span<const FoundPoint> find_points(const GuidePoints& points, size_t i) {
            const size_t end = std::min(i + points_ahead, asked_.size());
            for (; found_end_ < end; ++found_end_) {
                if (found_end_ + cells_ahead < asked_.size())
                    lookup_.prefetch(cells_[asked_[found_end_ + cells_ahead]]);
                Found& found = found_at(found_end_);
                const uint32_t k = asked_[found_end_];
                found.count = lookup_.find_in_cell(cells_[k], points.position.get(k), points.geometric_normal.get(k),
                                                   found.points);
                for (size_t j = 0; j < found.count; ++j) __builtin_prefetch(&points_[found.points[j].index]);
            }
            return std::span(found_at(i).points).first(found_at(i).count);
        }

        /// Mixtures of the vertices asked for, from `first` on until the group is full; returns the next one.
        /// `fraction_of` (vertex, cached points near): how often to guide there; negative: no mixture is needed.
        template <class FractionOf>
        size_t collect_group(const GuidePoints& points, size_t first, const FractionOf& fraction_of) {
            mixtures_.clear();
            group_size_ = 0;
            size_t i = first;
            for (; i < asked_.size() && !mixtures_.is_full(); ++i) {
                const std::span<const FoundPoint> found = find_points(points, i);
                const float fraction = fraction_of(asked_[i], found);
                if (fraction < 0.0F) continue;
                mixtures_.add(found, points.get(asked_[i]), fraction);
                group_[group_size_++] = asked_[i];
            }
            mixtures_.prepare();
            return i;
        }

        /// Answers what the cached points alone tell, and is negative where that is enough.
        float fraction_wanted(const GuidePoints& points, GuideBatch& batch, uint32_t k,
                              std::span<const FoundPoint> found) const {
            constexpr float enough = -1.0F;
            batch.fraction[k] = 0.0F;
            if (found.empty()) return enough;
            const float fraction = batch.fraction[k] = mixtures_.cached_fraction(found);
            const bool is_known =
                Mixtures::has_cached_fraction(points.alpha[k], points.metallic[k], points.coat_f90[k]);
            batch.place[k] = is_known ? found[0].index : GuideBatch::no_place;
            if (!is_known || batch.density_wanted[k] > 0.0F || batch.u_choice[k] < fraction) return fraction;
            batch.pdf[k] = batch.light_pdf[k] = 0.0F;
            return enough;
        }

        void choose_direction(const GuidePoints& points, GuideBatch& batch, size_t i) {
            const size_t k = group_[i];
            const float fraction = batch.fraction[k] = mixtures_.fraction(i);
            if (fraction == 0.0F) return;
            if (batch.u_choice[k] < fraction) {
                const float u_lobe = std::min(batch.u_choice[k] / fraction, largest_below_one);
                batch.direction.set(k, mixtures_.sample(i, u_lobe, batch.u[k], batch.v[k]));
                batch.guided[k] = 1.0F;
            }
            batch.pdf[k] = mixtures_.pdf(i, batch.direction.get(k));
            if (batch.wants_light_pdf) batch.light_pdf[k] = mixtures_.pdf(i, points.light_direction.get(k));
        }

        const CachedPointLookup& lookup_;
        const std::vector<CachedPoint>& points_;
        Mixtures mixtures_;
        PathArray<uint32_t> cells_{0};
        std::vector<uint32_t> asked_;  ///< Vertices of the batch; keeps its capacity.
        std::array<Found, points_ahead> found_;
        size_t found_end_ = 0;  ///< Of `asked_`: those before have been found; of the last of them, `found_` tells.
        std::array<uint32_t, Mixtures::most_mixtures> group_;  ///< Vertices of the batch.
        size_t group_size_ = 0;
    };

    const Cache& cache_;
    Options options_;
};

}  // namespace nephroid

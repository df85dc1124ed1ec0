#include "integrators/guided/slope_cache.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "integrators/guided/guide_fraction.h"
#include "integrators/guided/lobe_weight.h"
#include "integrators/guided/secant_fit.h"

namespace nephroid {

namespace {

/// Half axes of a lobe's footprint are at most this share of the extent of all reflectors.
constexpr double largest_extent_share = 0.1;

/// Lobes that bring less than this share of a point's light are dropped: the protective lobe is above them.
constexpr float least_weight_share = 1e-4F;

/// Until guide_fractions has found a better one.
constexpr float trial_fraction = 0.5F;

class SlopeLobeMaker {
  public:
    SlopeLobeMaker(const RenderContext& context, const GuidedPaths& found)
        : context_(context), found_(found), weights_(context, found), fit_(context, found) {
        Bounds bounds;
        for (uint32_t i = 0; i < found.reflectors.size(); ++i) {
            for (size_t k = 0; k < 3; ++k) bounds.extend(found.reflectors.position(i, k));
        }
        if (!bounds.empty()) {
            largest_extent_ = largest_extent_share * double{glm::length(bounds.max - bounds.min)};
        }
    }

    std::vector<CachedSlopeLobe<float>> lobes_of(size_t index) const {
        std::vector<CachedSlopeLobe<float>> lobes;
        float total = 0.0F;
        for (const RepresentativePath& path : found_.paths.of_receiver(index)) {
            const CachedSlopeLobe<float> lobe = lobe_of(found_.receivers[index], path);
            if (!(lobe.weight > 0.0F) || !std::isfinite(lobe.weight)) continue;
            lobes.push_back(lobe);
            total += lobe.weight;
        }
        std::erase_if(lobes, [&](const auto& lobe) { return lobe.weight < least_weight_share * total; });
        return lobes;
    }

  private:
    CachedSlopeLobe<float> lobe_of(const Receiver& receiver, const RepresentativePath& path) const {
        const auto found = found_.paths.vertices_of(path);
        PerVertex<uint32_t> triangles{};
        ChainPosition position{};
        for (size_t i = 0; i < found.size(); ++i) {
            triangles[i] = found[i].triangle;
            position[i] = Vec2d(found[i].b1, found[i].b2);
        }
        const PathLight& light = found_.lights[path.light];
        TuplePatches tuple;
        make_tuple_chain(found_.reflectors, std::span(triangles).first(found.size()), receiver.position, light, tuple);
        const ChainEvaluation evaluation = evaluate(tuple.chain, position);
        if (!evaluation.valid) return {};
        PerVertex<double> widths = lobe_widths(tuple.chain, evaluation, light);
        LinearisedPath linear =
            linearise(tuple.chain, evaluation, std::span(widths).first(found.size()), largest_extent_);
        if (found.size() == 1) {
            fit_.apply(receiver, tuple.chain, evaluation, widths[0], largest_extent_, linear.footprint);
            linear.density = double{inv_pi} / (linear.footprint.extent[0] * linear.footprint.extent[1]);
        }
        CachedSlopeLobe<float> lobe = make_cached_lobe(tuple.chain, evaluation, linear, widths[0]);
        lobe.weight = weights_.of(receiver, path, linear.density, lobe);
        return lobe;
    }

    /// Alpha for exact paths, more for relaxed ones and for lights that are not points.
    static PerVertex<double> lobe_widths(const SpecularChain& chain, const ChainEvaluation& evaluation,
                                         const PathLight& light) {
        PerVertex<double> widths{};
        const auto length = static_cast<size_t>(chain.length);
        for (size_t i = 0; i < length; ++i) {
            const SlopeConstraint& constraint = evaluation.constraints[i];
            const double alpha = std::max(chain.vertices[i].alpha, double{delta_alpha});
            double squared = alpha * alpha + glm::dot(constraint.slope, constraint.slope);
            if (i + 1 == length && light.radius > 0.0F) {
                // A ball's points lie r / 2 from its centre in any direction, on average and squared; two directions
                // across count for the two slopes.
                double spread = 0.0;
                for (int k = 0; k < 3; ++k) spread += glm::dot(constraint.by_light[k], constraint.by_light[k]);
                squared += 0.5 * spread * double{light.radius} * double{light.radius};
            }
            widths[i] = std::sqrt(squared);
        }
        return widths;
    }

    const RenderContext& context_;
    const GuidedPaths& found_;
    LobeWeights weights_;
    SecantFit fit_;
    double largest_extent_ = 1.0;
};

}  // namespace

SlopeCache make_slope_cache(const RenderContext& context, const GuidedPaths& found, const GuidedSettings& settings) {
    const SlopeLobeMaker maker(context, found);
    const size_t count = found.receivers.size();
    std::vector<std::vector<CachedSlopeLobe<float>>> lobes(count);
    tbb::parallel_for(size_t{0}, count, [&](size_t i) { lobes[i] = maker.lobes_of(i); });
    SlopeCache cache;
    std::vector<CachedSlopeLobe<float>> all;
    for (size_t i = 0; i < count; ++i) {
        cache.points.push_back(make_cached_point(found.receivers[i], all.size(), lobes[i].size()));
        cache.points.back().fraction = lobes[i].empty() ? 0.0F : settings.guide_fraction.value_or(trial_fraction);
        all.insert(all.end(), lobes[i].begin(), lobes[i].end());
    }
    cache.lobes = SlopeLobeArray(all);
    cache.lookup = CachedPointLookup(cache.points);
    cache.leads_on = has_long_paths(found);
    if (settings.guide_fraction) return cache;
    SlopeMixtureOptions options;
    options.warp = settings.slope_warp;
    const std::vector<float> fractions = guide_fractions(context, found.receivers, cache, options);
    for (size_t i = 0; i < count; ++i) {
        if (!lobes[i].empty()) cache.points[i].fraction = fractions[i];
    }
    return cache;
}

}  // namespace nephroid

#include "integrators/guided/slope_lobe_maker.h"

#include <algorithm>
#include <cmath>

namespace nephroid {

namespace {

/// Half axes of a lobe's footprint are at most this share of the extent of all reflectors.
constexpr double largest_extent_share = 0.1;

/// Alpha for exact paths, more for relaxed ones and for lights that are not points.
PerVertex<double> lobe_widths(const SpecularChain& chain, const ChainEvaluation& evaluation, const PathLight& light) {
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

}  // namespace

SlopeLobeMaker::SlopeLobeMaker(const RenderContext& context, const GuidedPaths& found)
    : found_(found), weights_(context, found), fit_(context, found) {
    Bounds bounds;
    for (uint32_t i = 0; i < found.reflectors.size(); ++i) {
        for (size_t k = 0; k < 3; ++k) bounds.extend(found.reflectors.position(i, k));
    }
    if (!bounds.empty()) largest_extent_ = largest_extent_share * double{glm::length(bounds.max - bounds.min)};
}

CachedSlopeLobe<float> SlopeLobeMaker::lobe_of(const Receiver& receiver, const RepresentativePath& path) const {
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
    LinearisedPath linear = linearise(tuple.chain, evaluation, std::span(widths).first(found.size()), largest_extent_);
    if (found.size() == 1) {
        fit_.apply(receiver, tuple.chain, evaluation, widths[0], largest_extent_, linear.footprint);
        linear.density = double{inv_pi} / (linear.footprint.extent[0] * linear.footprint.extent[1]);
    }
    CachedSlopeLobe<float> lobe = make_cached_lobe(tuple.chain, evaluation, linear, widths[0]);
    lobe.weight = weights_.of(receiver, path, linear.density, lobe);
    if (!(lobe.weight > 0.0F) || !std::isfinite(lobe.weight)) lobe.weight = 0.0F;
    return lobe;
}

}  // namespace nephroid

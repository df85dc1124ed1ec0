#include "integrators/guided/secant_fit.h"

#include <algorithm>
#include <limits>

#include "core/rounding.h"

namespace nephroid {

namespace {

constexpr double trusted_share = 0.3;  // Of the triangle's longest edge: below, the Jacobian is exact enough.
constexpr int most_steps = 8;

}  // namespace

struct SecantFit::Query {
    const Receiver& receiver;
    const SpecularChain& chain;
    const ChainEvaluation& evaluation;
    double target;   ///< |C|^2 to be reached.
    double largest;  ///< Extent, metres.
};

SecantFit::SecantFit(const RenderContext& context, const GuidedPaths& found)
    : context_(context), found_(found), reflector_of_(context.scene.objects.size()) {
    for (uint32_t i = 0; i < found.reflectors.size(); ++i) {
        const TriangleId& id = found.reflectors.ids[i];
        auto& of_object = reflector_of_[id.object];
        if (of_object.size() <= id.primitive) of_object.resize(id.primitive + 1, no_triangle);
        of_object[id.primitive] = i;
    }
}

void SecantFit::apply(const Receiver& receiver, const SpecularChain& chain, const ChainEvaluation& evaluation,
                      double width, double largest_extent, SlopeFootprint& footprint) const {
    const Vec2d& slope = evaluation.constraints[0].slope;
    const Query query{receiver, chain, evaluation, glm::dot(slope, slope) + width * width, largest_extent};
    for (size_t k = 0; k < 2; ++k) {
        double& extent = footprint.extent[k];
        if (extent < trusted_share * chain.vertices[0].patch->size) continue;
        const Vec2d& direction = footprint.direction[k];
        // The two sides differ where slopes change unevenly; one lobe serves both.
        extent = 0.5 * (extent_along(query, direction, extent) + extent_along(query, -direction, extent));
    }
}

double SecantFit::extent_along(const Query& query, const Vec2d& direction, double first_guess) const {
    double low = 0.0, high = std::numeric_limits<double>::infinity();
    double extent = std::min(first_guess, query.largest);
    for (int step = 0; step < most_steps; ++step) {
        if (squared_slope(query, extent * direction) > query.target) {
            high = extent;
        } else {
            low = extent;
            if (low >= query.largest) return query.largest;
        }
        extent =
            high < std::numeric_limits<double>::infinity() ? 0.5 * (low + high) : std::min(2.0 * low, query.largest);
    }
    return extent;
}

/// |C|^2 where the receiver sees the point at the offset in the path's plane; infinite off the reflectors.
double SecantFit::squared_slope(const Query& query, const Vec2d& offset) const {
    constexpr double nothing = std::numeric_limits<double>::infinity();
    const SurfacePatch& first = *query.chain.vertices[0].patch;
    const Vec3d target = query.evaluation.points[0].position + offset.x * first.axes[0] + offset.y * first.axes[1];
    const Receiver& receiver = query.receiver;
    const Vec3 direction = glm::normalize(Vec3(target - Vec3d(receiver.position)));
    const Vec3 origin = offset_ray_origin(receiver.position, receiver.error, receiver.geometric_normal, direction);
    const Hit hit = context_.accelerator.intersect({origin, direction});
    if (hit.object >= reflector_of_.size()) return nothing;
    const auto& of_object = reflector_of_[hit.object];
    if (hit.primitive >= of_object.size() || of_object[hit.primitive] == no_triangle) return nothing;
    const SurfacePatch patch = found_.reflectors.patch(of_object[hit.primitive]);
    const PatchPoint point = evaluate(patch, Vec2d(hit.u, hit.v));
    const SlopeConstraint constraint = evaluate_constraint(patch, point, Interaction(), {query.chain.receiver, false},
                                                           query.chain.light, Derivatives::own);
    return constraint.valid ? glm::dot(constraint.slope, constraint.slope) : nothing;
}

}  // namespace nephroid

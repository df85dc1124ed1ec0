#include "pathcut/edge_minimum.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace nephroid {

namespace {

constexpr int max_refinements = 24;
constexpr double finest = 1e-10;  // Of an edge's parameter.

Vec2d point_on_edge(int edge, double t) {
    switch (edge) {
        case 0:
            return {t, 0.0};
        case 1:
            return {1.0 - t, t};
        default:
            return {0.0, 1.0 - t};
    }
}

ChainState state_on_edge(const SpecularChain& chain, int edge, double t, SolverWork& work) {
    ChainPosition position{};
    position[0] = point_on_edge(edge, t);
    return make_state(chain, position, Region::triangles, work);
}

/// Half the derivative of |C|^2 by the edge's parameter, and the Gauss-Newton step to where it vanishes.
struct EdgeDerivative {
    double gradient = 0.0;
    double step = 0.0;
};
EdgeDerivative derivative_on_edge(const SpecularChain& chain, int edge, const ChainState& state) {
    const SlopeConstraint& constraint = state.evaluation.constraints[0];
    const Vec2d change = constraint.by_vertex * edge_vector(*chain.vertices[0].patch, edge);
    const double gradient = glm::dot(constraint.slope, change), curvature = glm::dot(change, change);
    return {gradient, curvature > 0.0 ? -gradient / curvature : 0.0};
}

/// Refines a minimum at `t` that lies between `low` and `high`: Gauss-Newton steps, bisection where they leave the
/// bracket that the sign of the derivative keeps.
void refine(const SpecularChain& chain, int edge, double low, double high, double t, ChainState& best,
            SolverWork& work) {
    ChainState current = best;
    for (int i = 0; i < max_refinements && high - low > finest; ++i) {
        if (!std::isfinite(current.merit)) {
            // An inadmissible stretch inside of the bracket: return to the side of the best point.
            const Vec2d offset = best.position[0] - point_on_edge(edge, 0.0);
            const double best_t =
                glm::length(offset) / glm::length(point_on_edge(edge, 1.0) - point_on_edge(edge, 0.0));
            (t > best_t ? high : low) = t;
            t = 0.5 * (t + best_t);
        } else {
            const EdgeDerivative derivative = derivative_on_edge(chain, edge, current);
            (derivative.gradient > 0.0 ? high : low) = t;
            const double next = t + derivative.step;
            if (std::abs(derivative.step) < finest) return;
            t = next > low && next < high ? next : 0.5 * (low + high);
        }
        current = state_on_edge(chain, edge, t, work);
        if (current.merit < best.merit) best = current;
    }
}

}  // namespace

ChainState minimum_on_edges(const SpecularChain& chain, SolverWork& work) {
    std::array<ChainState, 3> corners;
    ChainState best;
    best.merit = INFINITY;
    for (int k = 0; k < 3; ++k) {
        ChainState& corner = corners[static_cast<size_t>(k)];
        corner = state_on_edge(chain, k, 0.0, work);
        if (corner.merit < best.merit) best = corner;
    }
    for (int edge = 0; edge < 3; ++edge) {
        const ChainState &from = corners[static_cast<size_t>(edge)], &to = corners[static_cast<size_t>((edge + 1) % 3)];
        const ChainState middle = state_on_edge(chain, edge, 0.5, work);
        const double lowest = std::min({from.merit, middle.merit, to.merit});
        if (!std::isfinite(lowest)) continue;
        const double t = middle.merit == lowest ? 0.5 : from.merit == lowest ? 0.0 : 1.0;
        ChainState candidate = middle.merit == lowest ? middle : from.merit == lowest ? from : to;
        refine(chain, edge, std::max(0.0, t - 0.5), std::min(1.0, t + 0.5), t, candidate, work);
        if (candidate.merit < best.merit) best = candidate;
    }
    return best;
}

}  // namespace nephroid

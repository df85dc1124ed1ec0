#include "pathcut/newton_solver.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pathcut/early_rejection.h"
#include "pathcut/edge_minimum.h"

namespace nephroid {

namespace {

constexpr double inside_tolerance = 1e-9;  // Barycentric: solutions on an edge belong to both of its triangles.

bool is_finite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool is_solvable(const SpecularChain& chain) {
    if (chain.length < 1 || chain.length > max_chain_length) return false;
    if (!is_finite(chain.receiver) || !is_finite(chain.light.point)) return false;
    return std::all_of(chain.vertices.begin(), chain.vertices.begin() + chain.length,
                       [](const ChainVertex& v) { return v.patch != nullptr && !v.patch->degenerate; });
}

ChainPosition centres() {
    ChainPosition position;
    position.fill(triangle_centre);
    return position;
}

bool all_inside(const SpecularChain& chain, const ChainPosition& position) {
    return std::all_of(position.begin(), position.begin() + chain.length,
                       [](const Vec2d& b) { return is_inside(b, inside_tolerance); });
}

ChainPosition closest_inside(const SpecularChain& chain, ChainPosition position) {
    for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
        position[i] = closest_inside(*chain.vertices[i].patch, position[i]);
    }
    return position;
}

SolveStatus classify(const SpecularChain& chain, const ChainState& state) {
    if (!state.evaluation.admissible) return SolveStatus::failed;
    if (largest_slope(chain, state.evaluation) <= exact_slope) return SolveStatus::exact;
    for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
        if (!(glm::length(state.evaluation.constraints[i].slope) <= chain.vertices[i].max_slope)) {
            return SolveStatus::rejected;
        }
    }
    return SolveStatus::relaxed;
}

SpecularPath make_path(const SpecularChain& chain, const ChainState& state, const SolverWork& work) {
    SpecularPath path;
    path.work = work;
    path.status = classify(chain, state);
    if (path.status == SolveStatus::failed) return path;
    path.length = chain.length;
    path.residual = largest_slope(chain, state.evaluation);
    // Once more, with the derivatives that the search may have done without.
    const ChainEvaluation evaluation = evaluate(chain, state.position);
    const auto length = static_cast<size_t>(chain.length);
    for (size_t i = 0; i < length; ++i) {
        const PatchPoint& point = evaluation.points[i];
        const SlopeConstraint& constraint = evaluation.constraints[i];
        path.vertices[i] = {state.position[i], point.position, point.normal,
                            constraint.s,      constraint.t,   constraint.slope};
    }
    path.jacobian = jacobian(chain, evaluation);
    path.by_receiver = evaluation.constraints[0].by_viewer;
    path.by_light_source = evaluation.constraints[length - 1].by_light;
    return path;
}

/// Takes `candidate` to the bottom of its valley inside of the triangles, and keeps it if it is the lowest so far.
void improve(const SpecularChain& chain, const SolverOptions& options, ChainState candidate, ChainState& best,
             SolverWork& work) {
    if (!std::isfinite(candidate.merit)) return;
    descend(chain, candidate, Region::triangles, options.max_iterations, work);
    if (candidate.merit < best.merit) best = candidate;
}

/// The lowest of the paths through points near the triangles' corners and centres: where centres alone are
/// inadmissible.
ChainState lowest_sample(const SpecularChain& chain, SolverWork& work) {
    constexpr int points = 4;
    constexpr std::array<Vec2d, points> samples{triangle_centre, Vec2d(0.1, 0.1), Vec2d(0.8, 0.1), Vec2d(0.1, 0.8)};
    constexpr int max_samples = 64;  // All of them for up to three vertices.
    ChainState best;
    best.merit = INFINITY;
    int count = 1;
    for (int i = 0; i < chain.length; ++i) count *= points;
    for (int sample = 0; sample < std::min(count, max_samples); ++sample) {
        ChainPosition position{};
        for (int i = 0, digits = sample; i < chain.length; ++i, digits /= points) {
            position[static_cast<size_t>(i)] = samples[static_cast<size_t>(digits % points)];
        }
        const ChainState state = make_state(chain, position, Region::triangles, work);
        if (state.merit < best.merit) best = state;
    }
    return best;
}

/// The path of smallest slopes inside of the triangles, after the search on the planes ended at `unbounded`.
ChainState minimum_inside(const SpecularChain& chain, const SolverOptions& options, const ChainPosition& unbounded,
                          SolverWork& work) {
    ChainState best;
    best.merit = INFINITY;
    const ChainPosition projected = closest_inside(chain, unbounded);
    if (chain.length == 1) {
        improve(chain, options, minimum_on_edges(chain, work), best, work);
        // Slopes that cannot vanish may be smallest in the interior, too.
        if (all_inside(chain, unbounded)) {
            improve(chain, options, make_state(chain, projected, Region::triangles, work), best, work);
        }
        return best;
    }
    improve(chain, options, make_state(chain, projected, Region::triangles, work), best, work);
    improve(chain, options, make_state(chain, centres(), Region::triangles, work), best, work);
    if (!std::isfinite(best.merit)) improve(chain, options, lowest_sample(chain, work), best, work);
    return best;
}

SpecularPath local_minimum(const SpecularChain& chain, const SolverOptions& options, SolverWork& work) {
    ChainState best;
    best.merit = INFINITY;
    const ChainPosition start = closest_inside(chain, *options.start);
    improve(chain, options, make_state(chain, start, Region::triangles, work), best, work);
    return make_path(chain, best, work);
}

SpecularPath rejected_path(const SolverWork& work) {
    SpecularPath path;
    path.status = SolveStatus::rejected;
    path.work = work;
    return path;
}

}  // namespace

SpecularPath solve_specular_path(const SpecularChain& chain, const SolverOptions& options) {
    SolverWork work;
    if (!is_solvable(chain)) return {};
    if (options.newton && options.local && options.start != nullptr) return local_minimum(chain, options, work);
    const bool guessed = options.newton && options.start != nullptr;
    ChainState state = make_state(chain, guessed ? *options.start : centres(), Region::planes, work);
    if (!options.newton) return make_path(chain, state, work);

    if (!guessed && is_hopeless(chain, state.evaluation, options.rejection_margin)) return rejected_path(work);
    if (state.evaluation.valid) descend(chain, state, Region::planes, options.max_iterations, work, options.furthest);
    if (state.evaluation.admissible && all_inside(chain, state.position) &&
        largest_slope(chain, state.evaluation) <= exact_slope) {
        state.position = closest_inside(chain, state.position);
        return make_path(chain, state, work);
    }
    if (!options.relaxed) return rejected_path(work);
    const ChainState best = minimum_inside(chain, options, state.position, work);
    return make_path(chain, best, work);
}

}  // namespace nephroid

// Damped Gauss-Newton descent on the slopes of a chain: Newton's method where the slopes can reach zero, and a search
// for the smallest slopes where they cannot.
#pragma once

#include <cstdint>

#include "pathcut/specular_chain.h"

namespace nephroid {

/// Slopes at which a path counts as exactly specular: 1e-4 of the smallest alpha, and above what rounding leaves at 1e5
/// times the scene's size from the origin.
inline constexpr double exact_slope = 1e-8;

/// Where vertices may move.
enum class Region : uint8_t {
    planes,     ///< Anywhere on the patches' extensions; paths that reflect on the wrong side may be passed through.
    triangles,  ///< Inside the triangles, along admissible paths only.
};

/// A path while it is searched for.
struct ChainState {
    ChainPosition position{};
    ChainEvaluation evaluation;
    double merit = 0.0;  ///< Sum of squared slopes, in units of the vertices' alpha over the chain's smallest; infinite
                         ///< where the path is not allowed.
};

/// Work done, for statistics.
struct SolverWork {
    int iterations = 0;   ///< Linear systems solved.
    int evaluations = 0;  ///< Paths evaluated.
};

ChainState make_state(const SpecularChain& chain, const ChainPosition& position, Region region, SolverWork& work);

/// Moves `state` (of finite merit) downhill until the slopes are zero, or stationary within the region, or
/// `max_iterations` are used up. The merit never grows. Does not allocate.
///
/// Levenberg-Marquardt with a projected active set: a vertex at the border of its triangle slides along it while the
/// gradient pushes outwards. No damping as long as full steps succeed, hence quadratic convergence near solutions;
/// singular Jacobians (caustic folds) raise the damping.
///
/// On the planes, the search ends where a vertex is further than `furthest` from its triangle's centre, in barycentric
/// units: interpolated normals mean little that far out.
void descend(const SpecularChain& chain, ChainState& state, Region region, int max_iterations, SolverWork& work,
             double furthest = 16.0);

}  // namespace nephroid

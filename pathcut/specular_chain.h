// A chain of patches between a receiver and a light, and the half-vector constraints of a path through it.
//
// The path is receiver = y_0, y_1, ..., y_k, y_{k+1} = light, with y_i on the chain's i-th patch: numbered from the
// receiver, as a path tracer meets the vertices. In arrays, y_1 has index 0.
#pragma once

#include <array>

#include "pathcut/half_vector_constraint.h"

namespace nephroid {

inline constexpr int max_chain_length = 4;

template <class T>
using PerVertex = std::array<T, static_cast<size_t>(max_chain_length)>;

struct ChainVertex {
    const SurfacePatch* patch = nullptr;
    Interaction interaction;
    double alpha = 0.0;  ///< Roughness; below 1e-4 it counts as 1e-4. Slopes of a chain are compared in units of it.
    double max_slope = 0.0;  ///< Largest |C| of an accepted solution: `acceptance_slope`, or a multiple of alpha.
};

struct SpecularChain {
    PerVertex<ChainVertex> vertices;  ///< The first `length` count.
    int length = 0;                   ///< 1 .. max_chain_length.
    Vec3d receiver{0.0};
    PathEnd light;
};

/// One barycentric pair for each vertex: where on its patches a path runs.
using ChainPosition = PerVertex<Vec2d>;

/// All points and constraints of a path.
struct ChainEvaluation {
    PerVertex<PatchPoint> points;
    PerVertex<SlopeConstraint> constraints;
    bool valid = false;       ///< All constraints are.
    bool admissible = false;  ///< All constraints are.
};

/// `derivatives` by neighbours are what couples a chain of two and more; for one vertex the solver needs its own alone.
ChainEvaluation evaluate(const SpecularChain& chain, const ChainPosition& position,
                         Derivatives derivatives = Derivatives::all);

/// The largest |C| of all vertices; infinite if not valid.
double largest_slope(const SpecularChain& chain, const ChainEvaluation& evaluation);

/// Blocks of the Jacobian of all C with respect to all plane coordinates: block tridiagonal.
struct ChainJacobian {
    PerVertex<glm::dmat2> by_own{};     ///< dC_i / d y_i.
    PerVertex<glm::dmat2> by_viewer{};  ///< dC_i / d y_{i-1}; zero for the first vertex.
    PerVertex<glm::dmat2> by_light{};   ///< dC_i / d y_{i+1}; zero for the last vertex.
};

ChainJacobian jacobian(const SpecularChain& chain, const ChainEvaluation& evaluation);

/// Determinant of the whole matrix, (1/m)^(2 length); zero where a leading block is singular.
double determinant(const ChainJacobian& jacobian, int length);

}  // namespace nephroid

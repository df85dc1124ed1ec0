// The representative specular path through a chain of triangles: the exact specular path where there is one inside of
// them, and otherwise the path whose half vectors are closest to the normals (Sec. 3.3 and Fig. 4, Li et al. 2022).
#pragma once

#include "pathcut/slope_descent.h"

namespace nephroid {

enum class SolveStatus : uint8_t {
    exact,     ///< All slopes are zero (below exact_slope), inside of the triangles.
    relaxed,   ///< The smallest slopes inside of the triangles; each vertex's is at most its max_slope.
    rejected,  ///< No path through the triangles has slopes within max_slope: no light worth guiding to. `length` is 0
               ///< if that was clear without a search; otherwise the path of smallest slopes is returned.
    failed,    ///< No admissible path was found: surfaces face away, degenerate patches, non-finite or wrong input.
};

struct SolverOptions {
    /// Where exact paths are looked for from; the triangles' centres if null. A good guess saves most of the work.
    const ChainPosition* start = nullptr;
    /// How far (barycentric, from the triangles' centres) the search for exact paths may stray.
    double furthest = 16.0;
    /// Only go downhill inside of the triangles from `start`: for who knows where slopes are smallest, and not zero.
    bool local = false;
    bool relaxed = true;      ///< Otherwise exact paths alone are looked for, and the rest is `rejected`.
    bool newton = true;       ///< Otherwise the path through the triangles' centres (Fig. 13, Li et al. 2022).
    int max_iterations = 24;  ///< Of each descent.
    /// A chain is rejected without a search if its slopes, linear about the centres, stay above max_slope everywhere in
    /// the triangles by more than this share of their change over the triangles. Infinite: always search.
    double rejection_margin = 0.5;
};

/// A vertex of the path found; tangents and slope as in SlopeConstraint.
struct PathVertex {
    Vec2d barycentrics{0.0};  ///< Inside the triangle.
    Vec3d position{0.0};
    Vec3d normal{0.0};  ///< Unit shading normal.
    Vec3d s{0.0}, t{0.0};
    Vec2d slope{0.0};
};

struct SpecularPath {
    SolveStatus status = SolveStatus::failed;
    int length = 0;
    PerVertex<PathVertex> vertices;     ///< The first `length` count; y_1, next to the receiver, is the first.
    ChainJacobian jacobian;             ///< By plane coordinates (axes of the vertices' patches), 1/m.
    glm::dmat3x2 by_receiver{0.0};      ///< dC of the first vertex by the receiver's position, 1/m.
    glm::dmat3x2 by_light_source{0.0};  ///< dC of the last vertex by the light's position (1/m) or direction.
    double residual = 0.0;              ///< Largest |C| of all vertices.
    SolverWork work;
};

/// All values of the result are finite, whatever the input; they are zero but for `work` if `length` is 0.
/// For one reflection all edges are searched; for more, several descents inside of the triangles are made, and the best
/// of their minima is taken. Does not allocate.
SpecularPath solve_specular_path(const SpecularChain& chain, const SolverOptions& options = {});

}  // namespace nephroid

#include "pathcut/slope_descent.h"

#include <algorithm>
#include <cmath>

#include "pathcut/acceptance.h"

namespace nephroid {

namespace {

constexpr int max_unknowns = 2 * max_chain_length;
constexpr double first_damping = 1e-4;  // Relative to the mean diagonal; below it, steps are undamped.
constexpr double last_damping = 1e8;
constexpr double longest_step = 2.0;     // In sizes of a patch: interpolated normals mean little further out.
constexpr double shortest_step = 1e-13;  // In sizes of a patch.
constexpr double border = 1e-12;         // Barycentric coordinates below it are on the border.

using Vector = std::array<double, max_unknowns>;
using Matrix = std::array<Vector, max_unknowns>;

/// Directions in which a vertex may move, in plane coordinates, as long as its patch.
struct FreeDirections {
    PerVertex<std::array<Vec2d, 2>> direction;
    PerVertex<int> count{};
};

/// Slopes, weighted, and their derivatives by the plane coordinates of each vertex in units of its patch's size.
struct LinearModel {
    PerVertex<Vec2d> slope;
    ChainJacobian jacobian;
    PerVertex<Vec2d> downhill;  ///< Minus half the merit's gradient.
};

/// Rows are compared in units of alpha: a degree matters less on a rougher surface.
double weight(const SpecularChain& chain, size_t i) {
    double smallest = INFINITY;
    for (size_t j = 0; j < static_cast<size_t>(chain.length); ++j) {
        smallest = std::min(smallest, std::max(chain.vertices[j].alpha, smallest_alpha));
    }
    return smallest / std::max(chain.vertices[i].alpha, smallest_alpha);
}

LinearModel make_model(const SpecularChain& chain, const ChainEvaluation& evaluation) {
    const auto length = static_cast<size_t>(chain.length);
    LinearModel model;
    model.jacobian = jacobian(chain, evaluation);
    ChainJacobian& j = model.jacobian;
    for (size_t i = 0; i < length; ++i) {
        const double w = weight(chain, i);
        model.slope[i] = evaluation.constraints[i].slope * w;
        j.by_own[i] *= w * chain.vertices[i].patch->size;
        if (i > 0) j.by_viewer[i] *= w * chain.vertices[i - 1].patch->size;
        if (i + 1 < length) j.by_light[i] *= w * chain.vertices[i + 1].patch->size;
    }
    for (size_t i = 0; i < length; ++i) {
        // vector * matrix is the product with the transposed matrix.
        model.downhill[i] = -(model.slope[i] * j.by_own[i]);
        if (i > 0) model.downhill[i] -= model.slope[i - 1] * j.by_light[i - 1];
        if (i + 1 < length) model.downhill[i] -= model.slope[i + 1] * j.by_viewer[i + 1];
    }
    return model;
}

/// The directions in which `downhill` leads without leaving the triangle at once.
int free_directions_inside(const SurfacePatch& patch, const Vec2d& b, const Vec2d& downhill,
                           std::array<Vec2d, 2>& directions) {
    const std::array<double, 3> distance{b.y, 1.0 - b.x - b.y, b.x};  // From edges 0-1, 1-2, 2-0, barycentric.
    std::array<Vec2d, 3> along, inward;
    std::array<bool, 3> at_edge{};
    bool pushes_out = false;
    for (size_t k = 0; k < 3; ++k) {
        along[k] = glm::normalize(edge_vector(patch, static_cast<int>(k)));
        inward[k] = Vec2d(-along[k].y, along[k].x);  // Edges run counterclockwise about the geometric normal.
        at_edge[k] = distance[k] <= border;
        pushes_out = pushes_out || (at_edge[k] && glm::dot(downhill, inward[k]) < 0.0);
    }
    if (!pushes_out) {
        directions = {Vec2d(patch.size, 0.0), Vec2d(0.0, patch.size)};
        return 2;
    }
    double best = 0.0;
    for (size_t k = 0; k < 3; ++k) {
        if (!at_edge[k] || !(glm::dot(downhill, inward[k]) < 0.0)) continue;
        const double slide = glm::dot(downhill, along[k]);
        bool leaves = false;
        for (size_t other = 0; other < 3; ++other) {
            leaves = leaves || (other != k && at_edge[other] && slide * glm::dot(along[k], inward[other]) < 0.0);
        }
        if (leaves || !(std::abs(slide) > best)) continue;
        best = std::abs(slide);
        directions[0] = along[k] * patch.size;
    }
    return best > 0.0 ? 1 : 0;
}

FreeDirections find_free_directions(const SpecularChain& chain, const ChainPosition& position, const LinearModel& model,
                                    Region region) {
    FreeDirections free;
    for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
        const SurfacePatch& patch = *chain.vertices[i].patch;
        free.direction[i] = {Vec2d(patch.size, 0.0), Vec2d(0.0, patch.size)};
        free.count[i] = 2;
        if (region == Region::triangles) {
            free.count[i] = free_directions_inside(patch, position[i], model.downhill[i], free.direction[i]);
        }
    }
    return free;
}

/// The normal equations J^T J x = J^T (-slope) of the free directions.
struct NormalEquations {
    Matrix matrix{};
    Vector right{};
    int size = 0;
};

NormalEquations make_normal_equations(const SpecularChain& chain, const LinearModel& model,
                                      const FreeDirections& free) {
    // Columns of J: for each free direction the change of all slopes, of which three vertices see it.
    std::array<PerVertex<Vec2d>, max_unknowns> columns;
    NormalEquations equations;
    const auto length = static_cast<size_t>(chain.length);
    for (size_t i = 0; i < length; ++i) {
        const double size = chain.vertices[i].patch->size;
        for (size_t k = 0; k < static_cast<size_t>(free.count[i]); ++k) {
            const Vec2d direction = free.direction[i][k] / size;
            PerVertex<Vec2d>& column = columns[static_cast<size_t>(equations.size)];
            column.fill(Vec2d(0.0));
            column[i] = model.jacobian.by_own[i] * direction;
            if (i > 0) column[i - 1] = model.jacobian.by_light[i - 1] * direction;
            if (i + 1 < length) column[i + 1] = model.jacobian.by_viewer[i + 1] * direction;
            equations.right[static_cast<size_t>(equations.size)] = glm::dot(model.downhill[i], direction);
            ++equations.size;
        }
    }
    for (size_t a = 0; a < static_cast<size_t>(equations.size); ++a) {
        for (size_t b = 0; b <= a; ++b) {
            double sum = 0.0;
            for (size_t i = 0; i < length; ++i) sum += glm::dot(columns[a][i], columns[b][i]);
            equations.matrix[a][b] = equations.matrix[b][a] = sum;
        }
    }
    return equations;
}

/// Solves by Cholesky's method; false if the damped matrix is singular to working precision.
bool solve(const NormalEquations& equations, double damping, Vector& x) {
    Matrix l = equations.matrix;
    const auto n = static_cast<size_t>(equations.size);
    double mean = 0.0;
    for (size_t i = 0; i < n; ++i) mean += equations.matrix[i][i] / static_cast<double>(n);
    if (!(mean > 0.0) || !std::isfinite(mean)) return false;
    for (size_t i = 0; i < n; ++i) l[i][i] += damping * mean;
    for (size_t i = 0; i < n; ++i) {
        for (size_t j = 0; j <= i; ++j) {
            double sum = l[i][j];
            for (size_t k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
            if (i == j && !(sum > 1e-15 * mean)) return false;
            l[i][j] = i == j ? std::sqrt(sum) : sum / l[j][j];
        }
    }
    for (size_t i = 0; i < n; ++i) {
        double sum = equations.right[i];
        for (size_t k = 0; k < i; ++k) sum -= l[i][k] * x[k];
        x[i] = sum / l[i][i];
    }
    for (size_t i = n; i-- > 0;) {
        double sum = x[i];
        for (size_t k = i + 1; k < n; ++k) sum -= l[k][i] * x[k];
        x[i] = sum / l[i][i];
    }
    return true;
}

/// The position after a step of `x` along the free directions; the step is shortened where it is too long, and its
/// length in sizes of a patch returned.
double take_step(const SpecularChain& chain, const FreeDirections& free, Vector x, Region region,
                 ChainPosition& position) {
    double longest = 0.0;
    size_t unknown = 0;
    for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
        double square = 0.0;
        for (int k = 0; k < free.count[i]; ++k, ++unknown) square += x[unknown] * x[unknown];
        longest = std::max(longest, std::sqrt(square));
    }
    const double scale = longest > longest_step ? longest_step / longest : 1.0;
    unknown = 0;
    for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
        Vec2d delta(0.0);
        for (size_t k = 0; k < static_cast<size_t>(free.count[i]); ++k, ++unknown) {
            delta += free.direction[i][k] * (x[unknown] * scale);
        }
        const SurfacePatch& patch = *chain.vertices[i].patch;
        position[i] = moved(patch, position[i], delta);
        if (region == Region::triangles) position[i] = closest_inside(patch, position[i]);
    }
    return longest * scale;
}

bool is_far_out(const SpecularChain& chain, const ChainPosition& position, double furthest) {
    return std::any_of(position.begin(), position.begin() + chain.length,
                       [=](const Vec2d& b) { return !(glm::length(b - triangle_centre) < furthest); });
}

}  // namespace

ChainState make_state(const SpecularChain& chain, const ChainPosition& position, Region region, SolverWork& work) {
    ++work.evaluations;
    const Derivatives needed = chain.length == 1 ? Derivatives::own : Derivatives::all;
    ChainState state{position, evaluate(chain, position, needed), 0.0};
    if (!state.evaluation.valid || (region == Region::triangles && !state.evaluation.admissible)) {
        state.merit = INFINITY;
        return state;
    }
    for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
        const Vec2d slope = state.evaluation.constraints[i].slope * weight(chain, i);
        state.merit += glm::dot(slope, slope);
    }
    return state;
}

void descend(const SpecularChain& chain, ChainState& state, Region region, int max_iterations, SolverWork& work,
             double furthest) {
    constexpr double finished_slope = 1e-3 * exact_slope;
    double damping = 0.0;
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
        if (largest_slope(chain, state.evaluation) <= finished_slope || is_far_out(chain, state.position, furthest))
            return;
        const LinearModel model = make_model(chain, state.evaluation);
        const FreeDirections free = find_free_directions(chain, state.position, model, region);
        const NormalEquations equations = make_normal_equations(chain, model, free);
        if (equations.size == 0) return;
        const double merit_before = state.merit;
        double step = 0.0;
        while (true) {
            if (damping > last_damping) return;
            ++work.iterations;
            Vector x{};
            if (solve(equations, damping, x)) {
                ChainPosition position = state.position;
                step = take_step(chain, free, x, region, position);
                const ChainState trial = make_state(chain, position, region, work);
                if (trial.merit < state.merit) {
                    state = trial;
                    break;
                }
                // At the noise of an exact solution, or at a minimum: nothing to be gained by shorter steps.
                if (step < shortest_step || largest_slope(chain, state.evaluation) < exact_slope) return;
            }
            damping = std::max(damping * 10.0, first_damping);
        }
        damping = damping <= first_damping ? 0.0 : damping * 0.1;
        if (step < shortest_step || state.merit > merit_before * (1.0 - 1e-12)) return;
    }
}

}  // namespace nephroid

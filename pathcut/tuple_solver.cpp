#include "pathcut/tuple_solver.h"

#include <algorithm>
#include <cmath>

#include "pathcut/acceptance.h"
#include "pathcut/cut_test.h"

namespace nephroid {

namespace {

constexpr double on_edge = 1e-9;  // Barycentric distance within which a path runs along an edge.

/// By how much the half vector at a patch turns, at most, within a sphere light: an angle, radians.
double half_vector_spread(const SurfacePatch& patch, const Vec3d& viewer, const PathLight& light) {
    if (!(light.radius > 0.0F)) return 0.0;
    const Vec3d centre = (patch.positions[0] + patch.positions[1] + patch.positions[2]) / 3.0;
    const Vec3d to_light = Vec3d(light.point) - centre;
    const double distance = glm::length(to_light);
    const double h = glm::length(to_light / distance + glm::normalize(viewer - centre));
    const double chord = chord_of_sine(static_cast<float>(double{light.radius} / distance));
    return chord < h ? std::asin(chord / h) : 2.0;
}

/// Barycentric coordinates of a point of the patch's plane.
Vec2d locate(const SurfacePatch& patch, const Vec3d& point) {
    const Vec3d from_corner = point - patch.positions[0];
    return moved(patch, Vec2d(0.0), Vec2d(glm::dot(from_corner, patch.axes[0]), glm::dot(from_corner, patch.axes[1])));
}

/// Half the gradient of the merit (squared slopes in units of alpha) by the plane coordinates of vertex i.
Vec2d half_gradient(const SpecularChain& chain, const ChainEvaluation& evaluation, size_t i) {
    const ChainJacobian blocks = jacobian(chain, evaluation);
    const auto weighted = [&](size_t j) {
        const double alpha = std::max(chain.vertices[j].alpha, smallest_alpha);
        return evaluation.constraints[j].slope / (alpha * alpha);
    };
    Vec2d gradient = weighted(i) * blocks.by_own[i];  // vector * matrix: the product with the transposed matrix.
    if (i > 0) gradient += weighted(i - 1) * blocks.by_light[i - 1];
    if (i + 1 < static_cast<size_t>(chain.length)) gradient += weighted(i + 1) * blocks.by_viewer[i + 1];
    return gradient;
}

/// How fast slopes of one reflection change about a path, |det dC/dy|, 1/m^2; infinite for more reflections, whose
/// creases are not told.
double steepness_of(const ChainEvaluation& evaluation, int length) {
    return length == 1 ? std::abs(glm::determinant(evaluation.constraints[0].by_vertex)) : INFINITY;
}

/// A path with one vertex moved to the same point on a neighbouring triangle.
struct Crossing {
    SurfacePatch patch;
    Vec2d downhill;  ///< Steepest way down there, plane coordinates, unit; zero if there is none, or behind a crease.
};

/// `steepness`: on this side, if creases count.
Crossing cross_over(const ReflectorTree& reflectors, SpecularChain chain, ChainPosition position, size_t i,
                    uint32_t triangle, double steepness = INFINITY) {
    Crossing crossing{reflectors.patch(triangle), Vec2d(0.0)};
    const Vec3d point = evaluate(*chain.vertices[i].patch, position[i]).position;
    chain.vertices[i].patch = &crossing.patch;
    position[i] = locate(crossing.patch, point);
    const ChainEvaluation evaluation = evaluate(chain, position);
    if (!evaluation.admissible || steepness_of(evaluation, chain.length) > crease_ratio * steepness) return crossing;
    const Vec2d gradient = half_gradient(chain, evaluation, i);
    const double length = glm::length(gradient);
    if (length > 0.0) crossing.downhill = gradient / -length;
    return crossing;
}

constexpr double level = 1e-6;  // Sine of slopes too gentle to tell from none.

/// Whether the way down leads from a point of edge `edge` into the triangle.
bool falls_from_edge(const Crossing& crossing, uint32_t edge) {
    const Vec2d along = glm::normalize(edge_vector(crossing.patch, static_cast<int>(edge)));
    return glm::dot(crossing.downhill, Vec2d(-along.y, along.x)) > level;  // Counterclockwise: left is inside.
}

/// Unit directions of the edges that leave corner `corner`, the first and, counterclockwise, the second.
std::array<Vec2d, 2> edges_at_corner(const SurfacePatch& patch, uint32_t corner) {
    return {glm::normalize(edge_vector(patch, static_cast<int>(corner))),
            -glm::normalize(edge_vector(patch, static_cast<int>((corner + 2) % 3)))};
}

/// Whether the steepest way down leads between the edges, at least by an angle with this sine.
bool falls_between(const std::array<Vec2d, 2>& edges, const Vec2d& down, double sine) {
    return edges[0].x * down.y - edges[0].y * down.x > sine && down.x * edges[1].y - down.y * edges[1].x > sine;
}

/// Whether any way down leads from corner `corner` into the triangle.
bool falls_from_corner(const Crossing& crossing, uint32_t corner) {
    const std::array<Vec2d, 2> edges = edges_at_corner(crossing.patch, corner);
    const Vec2d& down = crossing.downhill;
    return glm::dot(down, edges[0]) > level || glm::dot(down, edges[1]) > level || falls_between(edges, down, level);
}

/// Calls test(triangle, its corner) for the other triangles around a corner until that returns true; returns the
/// triangle then, else no_triangle.
template <class Test>
uint32_t find_around_corner(const ReflectorTree& reflectors, uint32_t triangle, uint32_t corner, const Test& test) {
    // Around to the left over the edge that ends at the corner; then, if a border stopped that, around to the right.
    HalfEdge h = reflectors.twins[triangle][(corner + 2) % 3];
    while (h != no_half_edge && triangle_of(h) != triangle) {
        const uint32_t next = triangle_of(h), at = edge_of(h);  // The twin starts at the corner.
        if (test(next, at)) return next;
        h = reflectors.twins[next][(at + 2) % 3];
    }
    if (h != no_half_edge) return no_triangle;
    h = reflectors.twins[triangle][corner];
    while (h != no_half_edge && triangle_of(h) != triangle) {
        const uint32_t next = triangle_of(h), at = (edge_of(h) + 1) % 3;  // The twin ends at the corner.
        if (test(next, at)) return next;
        h = reflectors.twins[next][at];
    }
    return no_triangle;
}

uint32_t next_triangle(const ReflectorTree& reflectors, const SpecularChain& chain, const ChainPosition& position,
                       size_t i, uint32_t triangle) {
    const Vec2d& b = position[i];
    const std::array<double, 3> weight{1.0 - b.x - b.y, b.x, b.y};
    for (uint32_t corner = 0; corner < 3; ++corner) {
        if (weight[corner] >= 1.0 - on_edge) {
            return find_around_corner(reflectors, triangle, corner, [&](uint32_t next, uint32_t at) {
                return falls_from_corner(cross_over(reflectors, chain, position, i, next), at);
            });
        }
    }
    const double steepness = steepness_of(evaluate(chain, position), chain.length);
    for (uint32_t edge = 0; edge < 3; ++edge) {
        const HalfEdge twin = reflectors.twins[triangle][edge];
        if (weight[(edge + 2) % 3] > on_edge || twin == no_half_edge) continue;
        const Crossing crossing = cross_over(reflectors, chain, position, i, triangle_of(twin), steepness);
        if (falls_from_edge(crossing, edge_of(twin))) return triangle_of(twin);
    }
    return no_triangle;
}

/// Looks for a triangle in which the path's slopes fall further.
void find_continuation(const ReflectorTree& reflectors, std::span<const uint32_t> triangles, const SpecularChain& chain,
                       TupleSolution& solution) {
    ChainPosition position{};
    for (size_t i = 0; i < triangles.size(); ++i) position[i] = solution.path.vertices[i].barycentrics;
    for (size_t i = 0; i < triangles.size(); ++i) {
        const uint32_t next = next_triangle(reflectors, chain, position, i, triangles[i]);
        // Not into the triangle of a neighbouring vertex: light cannot go from a triangle to itself.
        if (next == no_triangle || (i > 0 && next == triangles[i - 1]) ||
            (i + 1 < triangles.size() && next == triangles[i + 1])) {
            continue;
        }
        solution.continued = true;
        solution.next_vertex = i;
        solution.next_triangle = next;
        return;
    }
}

}  // namespace

void make_tuple_chain(const ReflectorTree& reflectors, std::span<const uint32_t> triangles, const Vec3& receiver,
                      const PathLight& light, TuplePatches& result) {
    SpecularChain& chain = result.chain;
    chain = {};
    chain.length = static_cast<int>(triangles.size());
    chain.receiver = Vec3d(receiver);
    chain.light = light.end();
    for (size_t i = 0; i < triangles.size(); ++i) {
        result.patches[i] = reflectors.patch(triangles[i]);
        chain.vertices[i] = {
            &result.patches[i], {}, double{reflectors.alpha(triangles[i])}, double{reflectors.max_slope(triangles[i])}};
    }
    if (light.radius > 0.0F) {
        const size_t last = triangles.size() - 1;
        const Vec3d viewer = last == 0 ? chain.receiver : evaluate(result.patches[last - 1], triangle_centre).position;
        double& limit = chain.vertices[last].max_slope;
        const double angle = std::atan(limit) + half_vector_spread(result.patches[last], viewer, light);
        limit = angle < 1.57 ? std::tan(angle) : INFINITY;
    }
}

TupleSolution solve_tuple(const ReflectorTree& reflectors, std::span<const uint32_t> triangles, const Vec3& receiver,
                          const PathLight& light, Selection selection, const SolverOptions& options) {
    TuplePatches tuple;
    make_tuple_chain(reflectors, triangles, receiver, light, tuple);
    TupleSolution solution;
    solution.path = solve_specular_path(tuple.chain, options);
    const SolveStatus status = solution.path.status;
    if (status != SolveStatus::exact && status != SolveStatus::relaxed) return solution;
    if (status == SolveStatus::relaxed && options.newton && selection == Selection::local_minima) {
        find_continuation(reflectors, triangles, tuple.chain, solution);
    }
    solution.accepted = !solution.continued && light.shines_on(solution.path.vertices[triangles.size() - 1].position);
    return solution;
}

bool falls_away_at_corner(const ReflectorTree& reflectors, uint32_t triangle, uint32_t corner, const Vec3& receiver,
                          const PathLight& light) {
    constexpr double clear_sine = 0.3;
    TuplePatches tuple;
    make_tuple_chain(reflectors, std::span(&triangle, 1), receiver, light, tuple);
    ChainPosition position{};
    position[0] = Vec2d(corner == 1 ? 1.0 : 0.0, corner == 2 ? 1.0 : 0.0);
    return find_around_corner(reflectors, triangle, corner, [&](uint32_t next, uint32_t at) {
               const Crossing crossing = cross_over(reflectors, tuple.chain, position, 0, next);
               return falls_between(edges_at_corner(crossing.patch, at), crossing.downhill, clear_sine);
           }) != no_triangle;
}

TupleSolution walk_to_minimum(const ReflectorTree& reflectors, std::span<uint32_t> triangles, const Vec3& receiver,
                              const PathLight& light, const SolverOptions& options, int max_steps, SolverWork& work) {
    TupleSolution solution;
    for (int step = 0; step <= max_steps; ++step) {
        solution = solve_tuple(reflectors, triangles, receiver, light, Selection::local_minima, options);
        work.iterations += solution.path.work.iterations;
        work.evaluations += solution.path.work.evaluations;
        if (!solution.continued) return solution;
        triangles[solution.next_vertex] = solution.next_triangle;
    }
    return solution;
}

}  // namespace nephroid

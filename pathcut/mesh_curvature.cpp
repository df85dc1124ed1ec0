// Jet fitting, because CGAL's corrected curvatures exist from version 5.6 on only; Debian 12 and Ubuntu 22.04 have 5.5
// and 5.4.
#include "pathcut/mesh_curvature.h"

#include <CGAL/Monge_via_jet_fitting.h>
#include <CGAL/Simple_cartesian.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace nephroid {

namespace {

constexpr size_t wanted_points = 24;     // Of a neighbourhood: 1.6 times the coefficients of a fourth-degree jet.
constexpr int most_rings = 4;            // Along borders a ring has half as many.
constexpr size_t most_steps = 128;       // Neighbours that are looked at per vertex: hubs of fans have thousands.
constexpr size_t most_points = 256;      // Of a neighbourhood.
constexpr double smallest_cosine = 0.5;  // Between the normals of a neighbourhood.
constexpr double largest_condition = 1e5;

/// Least squares by Householder reflections with pivoting: what CGAL would otherwise need Eigen for.
struct LeastSquares {
    class Vector {
      public:
        explicit Vector(int size) : values_(static_cast<size_t>(size), 0.0) {}
        void set(size_t i, double value) { values_[i] = value; }
        double operator()(size_t i) const { return values_[i]; }
        double* vector() { return values_.data(); }
        std::vector<double>& values() { return values_; }

      private:
        std::vector<double> values_;
    };

    class Matrix {
      public:
        Matrix(int rows, int columns) : columns_(static_cast<size_t>(columns), Vector(rows)) {}
        void set(size_t row, size_t column, double value) { columns_[column].set(row, value); }
        std::vector<Vector>& columns() { return columns_; }

      private:
        std::vector<Vector> columns_;
    };

    /// Replaces the first entries of `right` by the solution, and returns the condition number's estimate (the ratio of
    /// the triangular factor's diagonal, of columns scaled to length one). Singular: infinite, and zeros for solution.
    static double solve(Matrix& matrix, Vector& right);
};

double dot_from(const std::vector<double>& a, const std::vector<double>& b, size_t first) {
    return std::inner_product(a.begin() + static_cast<std::ptrdiff_t>(first), a.end(),
                              b.begin() + static_cast<std::ptrdiff_t>(first), 0.0);
}

/// b - 2 v (v.b) / (v.v), on the entries from `first` on.
void reflect(const std::vector<double>& v, double square, std::vector<double>& b, size_t first) {
    const double factor = 2.0 * dot_from(v, b, first) / square;
    for (size_t i = first; i < b.size(); ++i) b[i] -= factor * v[i];
}

double LeastSquares::solve(Matrix& matrix, Vector& right) {
    const size_t unknowns = matrix.columns().size();
    std::vector<std::vector<double>> columns;
    std::vector<double> scales, x(unknowns, 0.0);
    for (Vector& column : matrix.columns()) {
        columns.push_back(std::move(column.values()));
        const double length = std::sqrt(dot_from(columns.back(), columns.back(), 0));
        scales.push_back(length > 0.0 ? 1.0 / length : 0.0);
        for (double& value : columns.back()) value *= scales.back();
    }
    std::vector<size_t> order(unknowns);
    std::iota(order.begin(), order.end(), size_t{0});
    std::vector<double> rest(unknowns), diagonal;
    for (size_t k = 0; k < unknowns; ++k) {
        for (size_t j = k; j < unknowns; ++j) rest[order[j]] = dot_from(columns[order[j]], columns[order[j]], k);
        const auto pivot = std::max_element(order.begin() + static_cast<std::ptrdiff_t>(k), order.end(),
                                            [&](size_t a, size_t b) { return rest[a] < rest[b]; });
        std::swap(order[k], *pivot);
        std::vector<double> v = columns[order[k]];
        const double length = std::sqrt(rest[order[k]]);
        const double value = v[k] > 0.0 ? -length : length;
        v[k] -= value;
        const double square = dot_from(v, v, k);
        if (!(length * largest_condition > 1.0) || !(square > 0.0)) {
            std::fill(right.values().begin(), right.values().end(), 0.0);
            return std::numeric_limits<double>::infinity();
        }
        for (size_t j = k; j < unknowns; ++j) reflect(v, square, columns[order[j]], k);
        reflect(v, square, right.values(), k);
        diagonal.push_back(value);
    }
    for (size_t k = unknowns; k-- > 0;) {
        double sum = right(k);
        for (size_t j = k + 1; j < unknowns; ++j) sum -= columns[order[j]][k] * x[order[j]];
        x[order[k]] = sum / diagonal[k];
    }
    for (size_t j = 0; j < unknowns; ++j) right.set(j, x[j] * scales[j]);
    return std::abs(diagonal.front() / diagonal.back());
}

using Kernel = CGAL::Simple_cartesian<double>;

/// Fits heights above the plane across a given normal. CGAL's own choice is the plane of the points' principal
/// components, which stands upright on long strips: those of a surface bend by more than they are wide.
class JetFitting : public CGAL::Monge_via_jet_fitting<Kernel, Kernel, LeastSquares> {
  public:
    /// The surface's second order at the first point, from a jet of the degree. At least as many points as
    /// coefficients.
    Monge_form fit(const std::vector<Kernel::Point_3>& points, size_t degree, const Vec3d& normal) {
        deg = static_cast<int>(degree);
        deg_monge = 2;
        nb_d_jet_coeff = static_cast<int>((degree + 1) * (degree + 2) / 2);
        nb_input_pts = static_cast<int>(points.size());
        const auto [u, v] = flat_at(normal).direction;
        change_world2fitting = Aff_transformation(u.x, u.y, u.z, v.x, v.y, v.z, normal.x, normal.y, normal.z);
        LAMatrix matrix(nb_input_pts, nb_d_jet_coeff);
        LAVector heights(nb_input_pts);
        fill_matrix(points.begin(), points.end(), degree, matrix, heights);
        solve_linear_system(matrix, heights);
        Monge_form form;
        form.set_up(2);
        compute_Monge_basis(heights.vector(), form);
        form.comply_wrt_given_normal(Kernel::Vector_3(normal.x, normal.y, normal.z));
        return form;
    }
};

/// The mesh with one vertex per position.
struct WeldedMesh {
    std::vector<uint32_t> vertex_of;   ///< From the mesh's vertices.
    std::vector<Vec3d> positions;      ///< As in the mesh; zero where not finite.
    std::vector<Vec3d> normals;        ///< Weighted by area, unit; zero where they cancel.
    std::vector<size_t> first;         ///< Of each vertex's neighbours; one more entry at the end.
    std::vector<uint32_t> neighbours;  ///< Ascending, without repetitions.
};

bool is_finite(const Vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Vec3d direction_or_zero(const Vec3d& v) {
    const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    if (!(largest > 0.0) || !std::isfinite(largest)) return Vec3d(0.0);
    return glm::normalize(v / largest);
}

/// Every vertex of a position that is not finite stays alone, at the origin.
void weld(const Mesh& mesh, WeldedMesh& welded) {
    std::vector<uint32_t> order(mesh.positions.size());
    std::iota(order.begin(), order.end(), 0U);
    const auto key = [&](uint32_t vertex) {
        const Vec3& p = mesh.positions[vertex];
        return is_finite(p) ? std::array{p.x, p.y, p.z} : std::array{std::numeric_limits<float>::max(), 0.0F, 0.0F};
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
    welded.vertex_of.resize(order.size());
    for (size_t i = 0; i < order.size(); ++i) {
        const Vec3& p = mesh.positions[order[i]];
        if (i == 0 || !is_finite(p) || key(order[i]) != key(order[i - 1])) {
            welded.positions.push_back(is_finite(p) ? Vec3d(p) : Vec3d(0.0));
        }
        welded.vertex_of[order[i]] = static_cast<uint32_t>(welded.positions.size() - 1);
    }
}

void connect(const Mesh& mesh, WeldedMesh& welded) {
    std::vector<std::array<uint32_t, 2>> edges;
    edges.reserve(mesh.triangles.size() * 6);
    welded.normals.assign(welded.positions.size(), Vec3d(0.0));
    for (const Triangle& triangle : mesh.triangles) {
        const auto is_usable = [&](uint32_t vertex) { return is_finite(mesh.positions[vertex]); };
        if (!std::all_of(triangle.begin(), triangle.end(), is_usable)) continue;
        std::array<uint32_t, 3> v{};
        std::transform(triangle.begin(), triangle.end(), v.begin(), [&](uint32_t i) { return welded.vertex_of[i]; });
        const Vec3d& origin = welded.positions[v[0]];
        const Vec3d normal = glm::cross(welded.positions[v[1]] - origin, welded.positions[v[2]] - origin);
        for (size_t k = 0; k < 3; ++k) {
            welded.normals[v[k]] += normal;
            if (v[k] == v[(k + 1) % 3]) continue;
            edges.push_back({v[k], v[(k + 1) % 3]});
            edges.push_back({v[(k + 1) % 3], v[k]});
        }
    }
    for (Vec3d& normal : welded.normals) normal = direction_or_zero(normal);
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    welded.first.assign(welded.positions.size() + 1, 0);
    for (const auto& edge : edges) ++welded.first[edge[0] + 1];
    std::partial_sum(welded.first.begin(), welded.first.end(), welded.first.begin());
    welded.neighbours.reserve(edges.size());
    for (const auto& edge : edges) welded.neighbours.push_back(edge[1]);
}

/// Collects vertices around a vertex, ring by ring.
class NeighbourhoodFinder {
  public:
    explicit NeighbourhoodFinder(const WeldedMesh& mesh) : mesh_(mesh), visit_(mesh.positions.size(), 0) {}

    /// The vertex first. Valid until the next call.
    const std::vector<uint32_t>& find(uint32_t centre) {
        ++current_visit_;
        found_.assign(1, centre);
        visit_[centre] = current_visit_;
        size_t ring_begin = 0;
        for (int ring = 0; ring < most_rings && found_.size() < wanted_points; ++ring) {
            const size_t ring_end = found_.size();
            for (size_t i = ring_begin; i < ring_end; ++i) add_neighbours(found_[i], mesh_.normals[centre]);
            ring_begin = ring_end;
        }
        return found_;
    }

  private:
    void add_neighbours(uint32_t vertex, const Vec3d& normal) {
        const size_t begin = mesh_.first[vertex], end = mesh_.first[vertex + 1];
        const size_t stride = 1 + (end - begin) / most_steps;
        for (size_t i = begin; i < end && found_.size() < most_points; i += stride) {
            const uint32_t neighbour = mesh_.neighbours[i];
            if (visit_[neighbour] == current_visit_) continue;
            visit_[neighbour] = current_visit_;
            // Behind a fold, points would not lie on the graph of a function.
            if (glm::dot(mesh_.normals[neighbour], normal) >= smallest_cosine) found_.push_back(neighbour);
        }
    }

    const WeldedMesh& mesh_;
    std::vector<uint32_t> visit_;  ///< Number of the last search that came by.
    uint32_t current_visit_ = 0;
    std::vector<uint32_t> found_;
};

Vec3d to_vector(const Kernel::Vector_3& v) {
    return {v.x(), v.y(), v.z()};
}

/// The jet of the degree through the points, of which the first is the vertex; false where it means nothing.
bool fit_jet(const std::vector<Kernel::Point_3>& points, size_t degree, const Vec3d& mean_normal,
             PrincipalCurvatures& result) {
    if (points.size() * 5 < (degree + 1) * (degree + 2) / 2 * 6) return false;
    JetFitting fitting;
    const JetFitting::Monge_form form = fitting.fit(points, degree, mean_normal);
    if (!(fitting.condition_number() <= largest_condition)) return false;
    result.normal = direction_or_zero(to_vector(form.normal_direction()));
    result.direction[0] = direction_or_zero(to_vector(form.maximal_principal_direction()));
    result.direction[1] = glm::cross(result.normal, result.direction[0]);
    result.curvature = {form.principal_curvatures(0), form.principal_curvatures(1)};
    const double sum =
        glm::length(result.normal) + glm::length(result.direction[0]) + result.curvature[0] + result.curvature[1];
    return std::isfinite(sum) && glm::dot(result.normal, mean_normal) >= smallest_cosine;
}

PrincipalCurvatures fit_vertex(const WeldedMesh& mesh, uint32_t vertex, NeighbourhoodFinder& finder) {
    const Vec3d& mean_normal = mesh.normals[vertex];
    if (mean_normal == Vec3d(0.0)) return {};
    const std::vector<uint32_t>& neighbourhood = finder.find(vertex);
    const Vec3d centre = mesh.positions[vertex];
    double extent = 0.0;
    for (const uint32_t i : neighbourhood) extent = std::max(extent, glm::length(mesh.positions[i] - centre));
    // In units of the neighbourhood and relative to it, so that no scale nor place is special.
    std::vector<Kernel::Point_3> points;
    for (const uint32_t i : neighbourhood) {
        const Vec3d p = (mesh.positions[i] - centre) / extent;
        points.emplace_back(p.x, p.y, p.z);
    }
    PrincipalCurvatures result;
    for (size_t degree = 4; degree >= 2; --degree) {
        if (!fit_jet(points, degree, mean_normal, result)) continue;
        for (double& curvature : result.curvature) curvature /= extent;
        return result;
    }
    return flat_at(mean_normal);
}

}  // namespace

std::vector<PrincipalCurvatures> fit_mesh_curvature(const Mesh& mesh) {
    WeldedMesh welded;
    weld(mesh, welded);
    connect(mesh, welded);
    std::vector<PrincipalCurvatures> fitted(welded.positions.size());
    tbb::enumerable_thread_specific<NeighbourhoodFinder> finders([&] { return NeighbourhoodFinder(welded); });
    tbb::parallel_for(tbb::blocked_range<uint32_t>(0, static_cast<uint32_t>(fitted.size()), 256),
                      [&](const auto& range) {
                          for (uint32_t i = range.begin(); i < range.end(); ++i)
                              fitted[i] = fit_vertex(welded, i, finders.local());
                      });
    std::vector<PrincipalCurvatures> result;
    result.reserve(mesh.positions.size());
    for (const uint32_t vertex : welded.vertex_of) result.push_back(fitted[vertex]);
    return result;
}

}  // namespace nephroid

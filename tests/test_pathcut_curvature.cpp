// Principal curvatures from shading normals and from positions alone, against the exact values of smooth surfaces.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "pathcut/mesh_curvature.h"

using namespace nephroid;

namespace {

constexpr double pi_d = 3.141592653589793;

/// A point of an exact surface.
struct ExactPoint {
    Vec3d position, normal;
    std::array<double, 2> curvature;  ///< Larger one first.
    Vec3d first_direction{0.0};       ///< Of the larger one; zero for umbilics.
};

/// A surface over the unit square; rows and columns may close.
struct ExactSurface {
    std::string name;
    std::function<ExactPoint(double, double)> at;
    bool closed_u, closed_v;
};

ExactPoint sphere_point(double u, double v) {
    const double phi = 2.0 * pi_d * u, sine = v == 0.0 || v == 1.0 ? 0.0 : std::sin(pi_d * v);
    const Vec3d n(sine * std::cos(phi), sine * std::sin(phi), -std::cos(pi_d * v));
    return {n * 2.0, n, {-0.5, -0.5}};
}

ExactPoint cylinder_point(double u, double v) {
    const double phi = 2.0 * pi_d * u;
    const Vec3d n(std::cos(phi), std::sin(phi), 0.0);
    return {n * 0.5 + Vec3d(0.0, 0.0, 3.0 * v), n, {0.0, -2.0}, {0.0, 0.0, 1.0}};
}

ExactPoint torus_point(double u, double v) {
    const double phi = 2.0 * pi_d * u, theta = 2.0 * pi_d * v;
    const Vec3d out(std::cos(phi), std::sin(phi), 0.0), along(-out.y, out.x, 0.0);
    const Vec3d n = out * std::cos(theta) + Vec3d(0.0, 0.0, std::sin(theta));
    const double about_axis = -std::cos(theta) / (1.0 + 0.4 * std::cos(theta));
    return {out + n * 0.4, n, {about_axis, -2.5}, along};
}

/// z = x y over a square of two metres.
ExactPoint saddle_point(double u, double v) {
    const double x = 2.0 * u - 1.0, y = 2.0 * v - 1.0, w2 = 1.0 + x * x + y * y;
    const double mean = -x * y / (w2 * std::sqrt(w2)), gauss = -1.0 / (w2 * w2);
    const double root = std::sqrt(mean * mean - gauss);
    ExactPoint point{Vec3d(x, y, x * y), Vec3d(-y, -x, 1.0) / std::sqrt(w2), {mean + root, mean - root}};
    // The asymptotic directions are the coordinate lines; principal directions halve the angle between them.
    point.first_direction = glm::normalize(glm::normalize(Vec3d(1.0, 0.0, y)) + glm::normalize(Vec3d(0.0, 1.0, x)));
    return point;
}

const std::array<ExactSurface, 4> surfaces{
    ExactSurface{"sphere", sphere_point, true, false}, ExactSurface{"cylinder", cylinder_point, true, false},
    ExactSurface{"torus", torus_point, true, true}, ExactSurface{"saddle", saddle_point, false, false}};

struct Grid {
    Mesh mesh;
    std::vector<Vec2d> parameters;  ///< Of each vertex.
};

/// `columns` x `rows` quads; along closed borders vertices of the same position, as at a texture's seam. Quads that are
/// collapsed at a pole keep their triangle without area.
Grid tessellate(const ExactSurface& surface, uint32_t columns, uint32_t rows, double scale = 1.0,
                const Vec3d& offset = Vec3d(0.0)) {
    Grid grid;
    for (uint32_t j = 0; j <= rows; ++j) {
        for (uint32_t i = 0; i <= columns; ++i) {
            const Vec2d parameter(double(i) / columns, double(j) / rows);
            const double u = surface.closed_u && i == columns ? 0.0 : parameter.x;
            const double v = surface.closed_v && j == rows ? 0.0 : parameter.y;
            const ExactPoint point = surface.at(u, v);
            grid.parameters.push_back(parameter);
            grid.mesh.positions.emplace_back(point.position * scale + offset);
            grid.mesh.normals.emplace_back(point.normal);
        }
    }
    for (uint32_t j = 0; j < rows; ++j) {
        for (uint32_t i = 0; i < columns; ++i) {
            const uint32_t a = j * (columns + 1) + i, b = a + 1, c = a + columns + 1, d = c + 1;
            grid.mesh.triangles.push_back({a, b, d});
            grid.mesh.triangles.push_back({a, d, c});
        }
    }
    return grid;
}

SurfacePatch patch_of(const Mesh& mesh, const Triangle& triangle) {
    std::array<Vec3d, 3> positions, normals;
    for (size_t k = 0; k < 3; ++k) {
        positions[k] = Vec3d(mesh.positions[triangle[k]]);
        normals[k] = Vec3d(mesh.normals[triangle[k]]);
    }
    return make_surface_patch(positions, normals);
}

struct Errors {
    double median = 0.0, largest = 0.0;  ///< Of curvatures, relative to the stronger exact one.
    double median_angle = 0.0;           ///< Of the first direction and of the normal, radians.
};

class ErrorCollector {
  public:
    void add(const PrincipalCurvatures& found, const ExactPoint& exact, double scale) {
        const double strongest = std::max(std::abs(exact.curvature[0]), std::abs(exact.curvature[1]));
        const double difference = std::max(std::abs(found.curvature[0] * scale - exact.curvature[0]),
                                           std::abs(found.curvature[1] * scale - exact.curvature[1]));
        errors_.push_back(difference / strongest);
        double angle = std::acos(std::min(glm::dot(found.normal, exact.normal), 1.0));
        if (exact.first_direction != Vec3d(0.0)) {
            const double cosine = std::abs(glm::dot(found.direction[0], exact.first_direction));
            angle = std::max(angle, std::acos(std::min(cosine, 1.0)));
        }
        angles_.push_back(angle);
    }
    Errors result() {
        std::sort(errors_.begin(), errors_.end());
        std::sort(angles_.begin(), angles_.end());
        return {errors_[errors_.size() / 2], errors_.back(), angles_[angles_.size() / 2]};
    }

  private:
    std::vector<double> errors_, angles_;
};

/// At the centre of each triangle, or at another point.
Errors patch_errors(const ExactSurface& surface, const Grid& grid, const Vec2d& barycentrics, double scale = 1.0) {
    ErrorCollector collector;
    for (const Triangle& triangle : grid.mesh.triangles) {
        const SurfacePatch patch = patch_of(grid.mesh, triangle);
        if (patch.degenerate) continue;
        const Vec2d parameter = grid.parameters[triangle[0]] * (1.0 - barycentrics.x - barycentrics.y) +
                                grid.parameters[triangle[1]] * barycentrics.x +
                                grid.parameters[triangle[2]] * barycentrics.y;
        collector.add(principal_curvatures(patch, barycentrics), surface.at(parameter.x, parameter.y), scale);
    }
    return collector.result();
}

Errors fit_errors(const ExactSurface& surface, const Grid& grid, double scale = 1.0) {
    const std::vector<PrincipalCurvatures> fitted = fit_mesh_curvature(grid.mesh);
    ErrorCollector collector;
    for (size_t i = 0; i < fitted.size(); ++i) {
        collector.add(fitted[i], surface.at(grid.parameters[i].x, grid.parameters[i].y), scale);
    }
    return collector.result();
}

bool is_frame(const PrincipalCurvatures& c) {
    const double error = glm::length(glm::cross(c.direction[0], c.direction[1]) - c.normal) +
                         std::abs(glm::length(c.normal) - 1.0) + std::abs(glm::length(c.direction[0]) - 1.0) +
                         std::abs(glm::length(c.direction[1]) - 1.0);
    return error < 1e-9 && std::isfinite(c.curvature[0]) && std::isfinite(c.curvature[1]) &&
           c.curvature[0] >= c.curvature[1];
}

void report(const std::string& method, const ExactSurface& surface, const Errors& coarse, const Errors& fine) {
    MESSAGE(method << ", " << surface.name << ": median error " << coarse.median << " -> " << fine.median
                   << ", largest " << coarse.largest << " -> " << fine.largest << ", median angle "
                   << coarse.median_angle << " -> " << fine.median_angle);
}

void check_flat_frame(const PrincipalCurvatures& c) {
    CHECK(is_frame(c));
    CHECK(c.curvature == std::array{0.0, 0.0});
}

}  // namespace

TEST_CASE("curvatures of patches converge to the exact ones") {
    for (const ExactSurface& surface : surfaces) {
        const Grid coarse = tessellate(surface, 48, 24), fine = tessellate(surface, 192, 96);
        for (const Vec2d& b : {triangle_centre, Vec2d(0.1, 0.2)}) {
            const Errors first = patch_errors(surface, coarse, b), second = patch_errors(surface, fine, b);
            report(b == triangle_centre ? "patch, centre" : "patch, near a corner", surface, first, second);
            CHECK(first.median < 0.035);
            CHECK(first.largest < 0.13);
            // First order: four times as fine, about a quarter of the error.
            CHECK(second.median < 0.3 * first.median);
            CHECK(second.largest < 0.3 * first.largest);
            CHECK(second.median_angle < 0.3 * first.median_angle);
        }
    }
}

TEST_CASE("curvatures fitted to positions converge to the exact ones") {
    for (const ExactSurface& surface : surfaces) {
        const Grid coarse = tessellate(surface, 48, 24), fine = tessellate(surface, 192, 96);
        const Errors first = fit_errors(surface, coarse), second = fit_errors(surface, fine);
        report("fit", surface, first, second);
        CHECK(first.median < 0.035);
        CHECK(first.largest < 0.05);
        CHECK(second.median < 2e-4);
        CHECK(second.largest < 3e-3);
        CHECK(second.median_angle < 2e-4);
    }
}

TEST_CASE("curvatures scale with the inverse length, also away from the origin") {
    const ExactSurface& torus = surfaces[2];
    const Errors patch_expected = patch_errors(torus, tessellate(torus, 64, 32), triangle_centre);
    const Errors fit_expected = fit_errors(torus, tessellate(torus, 64, 32));
    for (const double scale : {1e-4, 1.0, 1e5}) {
        for (const double offset : {0.0, 50.0}) {
            const Grid grid = tessellate(torus, 64, 32, scale, Vec3d(offset, -offset, 0.5 * offset) * scale);
            const Errors patch = patch_errors(torus, grid, triangle_centre, scale);
            const Errors fit = fit_errors(torus, grid, scale);
            CHECK(patch.largest == doctest::Approx(patch_expected.largest).epsilon(0.02));
            CHECK(fit.median == doctest::Approx(fit_expected.median).epsilon(0.02));
            CHECK(fit.largest < 1.2 * fit_expected.largest);
        }
    }
}

TEST_CASE("signs and directions: positive where the surface bends towards the normal") {
    const ExactSurface& cylinder = surfaces[1];
    Grid grid = tessellate(cylinder, 96, 48);
    const Triangle triangle = grid.mesh.triangles[grid.mesh.triangles.size() / 2];
    const PrincipalCurvatures outside = principal_curvatures(patch_of(grid.mesh, triangle), triangle_centre);
    CHECK(outside.curvature[1] == doctest::Approx(-2.0).epsilon(0.01));
    CHECK(std::abs(outside.direction[0].z) == doctest::Approx(1.0).epsilon(0.01));
    CHECK(fit_mesh_curvature(grid.mesh)[triangle[0]].curvature[1] == doctest::Approx(-2.0).epsilon(0.01));

    for (Vec3& normal : grid.mesh.normals) normal = -normal;
    for (Triangle& t : grid.mesh.triangles) std::swap(t[1], t[2]);
    const PrincipalCurvatures inside = principal_curvatures(patch_of(grid.mesh, triangle), triangle_centre);
    CHECK(inside.curvature[0] == doctest::Approx(2.0).epsilon(0.01));
    CHECK(std::abs(inside.direction[1].z) == doctest::Approx(1.0).epsilon(0.01));
    CHECK(fit_mesh_curvature(grid.mesh)[triangle[0]].curvature[0] == doctest::Approx(2.0).epsilon(0.01));
}

TEST_CASE("patches without curvature or area give a frame and zero") {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const std::array<Vec3d, 3> corners{Vec3d(0.0), Vec3d(1.0, 0.0, 0.0), Vec3d(0.0, 1.0, 0.0)};
    const Vec3d up(0.0, 0.0, 1.0), aside(1.0, 0.0, 0.0);
    const std::array<Vec3d, 3> bent{up, glm::normalize(up + aside), glm::normalize(up - aside)};
    const auto at = [](const std::array<Vec3d, 3>& p, const std::array<Vec3d, 3>& n, const Vec2d& b) {
        return principal_curvatures(make_surface_patch(p, n), b);
    };
    check_flat_frame(at(corners, {up, up, up}, triangle_centre));
    check_flat_frame(at({corners[0], corners[1], corners[1]}, bent, triangle_centre));
    check_flat_frame(at({corners[0], corners[0], corners[0]}, bent, triangle_centre));
    check_flat_frame(at({Vec3d(nan), corners[1], corners[2]}, bent, triangle_centre));
    check_flat_frame(at(corners, {Vec3d(nan), Vec3d(nan), Vec3d(0.0)}, triangle_centre));
    check_flat_frame(at(corners, {aside, aside, aside}, triangle_centre));
    check_flat_frame(at(corners, {up, -up, up}, Vec2d(0.5, 0.0)));
    check_flat_frame(at(corners, bent, Vec2d(nan, 0.0)));
    CHECK(is_frame(at(corners, bent, Vec2d(INFINITY, 0.0))));
    CHECK(is_frame(at(corners, {up, -up, aside}, Vec2d(0.4999, 0.0))));
    CHECK(is_frame(at({corners[0], corners[1] * 1e-300, corners[2] * 1e-300}, bent, triangle_centre)));
    CHECK(is_frame(at({corners[0], corners[1] * 1e300, corners[2] * 1e300}, bent, triangle_centre)));
}

TEST_CASE("equal curvatures do not disturb the directions") {
    const Vec3d u(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0), n(0.0, 0.0, 1.0);
    for (const double tilt : {0.0, 1e-300, 1e-17, 1e-12}) {
        const PrincipalCurvatures c = diagonalise({3.0, tilt, 3.0}, u, v, n);
        CHECK(is_frame(c));
        CHECK(c.curvature[0] == doctest::Approx(3.0));
        CHECK(c.curvature[1] == doctest::Approx(3.0));
    }
    const PrincipalCurvatures c = diagonalise({1.0, 2.0, 4.0}, u, v, n);
    CHECK(c.curvature[0] == doctest::Approx(5.0));
    CHECK(c.curvature[1] == doctest::Approx(0.0));
    CHECK(std::abs(glm::dot(c.direction[0], glm::normalize(Vec3d(1.0, 2.0, 0.0)))) == doctest::Approx(1.0));
}

TEST_CASE("fitting to meshes of any kind gives frames; flat where there is nothing to fit") {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    Mesh mesh;
    SUBCASE("no vertices") {}
    SUBCASE("one triangle, one unused vertex") {
        mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}};
        mesh.triangles = {{0, 1, 2}};
    }
    SUBCASE("triangles without area") {
        mesh.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 0, 0}};
        mesh.triangles = {{0, 1, 2}, {0, 0, 1}, {0, 3, 1}};
    }
    SUBCASE("positions that are no numbers") {
        mesh.positions = {{nan, 0, 0}, {1, 0, 0}, {0, 1, 0}, {INFINITY, 0, 0}};
        mesh.triangles = {{0, 1, 2}, {1, 2, 3}};
    }
    SUBCASE("a sheet and its back side") {
        mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
        mesh.triangles = {{0, 1, 2}, {0, 2, 1}};
    }
    SUBCASE("a box: its faces are too far from each other's directions") {
        for (int i = 0; i < 8; ++i) mesh.positions.emplace_back(i & 1, (i >> 1) & 1, i >> 2);
        mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                          {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    }
    const std::vector<PrincipalCurvatures> fitted = fit_mesh_curvature(mesh);
    CHECK(fitted.size() == mesh.positions.size());
    for (const PrincipalCurvatures& c : fitted) check_flat_frame(c);
}

TEST_CASE("fans of many triangles, lost vertices and doubled triangles do not disturb the fit") {
    const ExactSurface& sphere = surfaces[0];
    Grid grid = tessellate(sphere, 2000, 24);  // Poles with 2000 neighbours.
    const auto count = static_cast<uint32_t>(grid.mesh.positions.size());
    grid.mesh.positions.emplace_back(std::numeric_limits<float>::quiet_NaN());
    grid.mesh.triangles.push_back({0, count, count - 1});
    for (uint32_t i = 0; i < 100; ++i) grid.mesh.triangles.push_back(grid.mesh.triangles[i * 7]);
    const std::vector<PrincipalCurvatures> fitted = fit_mesh_curvature(grid.mesh);
    check_flat_frame(fitted[count]);
    size_t wrong = 0;
    for (uint32_t i = 0; i < count; ++i) {
        REQUIRE(is_frame(fitted[i]));
        if (std::abs(fitted[i].curvature[0] + 0.5) > 0.1) ++wrong;
    }
    MESSAGE(wrong << " of " << count << " curvatures on needles 40 times as long as wide and more are off by a fifth");
    CHECK(wrong < count / 100);
}

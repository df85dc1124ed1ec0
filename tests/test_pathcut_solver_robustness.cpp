// Representative paths where no exact path exists, against brute force, and where geometry is extreme.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "pathcut/acceptance.h"
#include "pathcut/newton_solver.h"
#include "tests/pathcut_chains.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

/// About one edge length of 1 at `centre`, facing `facing`, with normals that turn by up to `bend` radians.
SurfacePatch random_patch(Generator& generator, const Vec3d& centre, const Vec3d& facing, double bend) {
    while (true) {
        std::array<Vec3d, 3> p, n;
        for (size_t i = 0; i < 3; ++i) {
            p[i] = centre + random_point(generator, 0.6);
            p[i] -= facing * (0.8 * glm::dot(p[i] - centre, facing));
            n[i] = glm::normalize(facing + random_point(generator, bend));
        }
        const SurfacePatch patch = make_surface_patch(p, n);
        if (glm::length(patch.barycentric_gradient[0]) + glm::length(patch.barycentric_gradient[1]) < 8.0) return patch;
    }
}

/// The points of a triangular grid.
std::vector<Vec2d> grid_points(int steps) {
    std::vector<Vec2d> points;
    for (int i = 0; i <= steps; ++i) {
        for (int j = 0; i + j <= steps; ++j) points.emplace_back(Vec2d(i, j) / static_cast<double>(steps));
    }
    return points;
}

struct Comparison {
    int solves = 0, worse = 0, exact = 0, relaxed = 0, missed = 0;
    double iterations = 0.0, evaluations = 0.0;
    /// `brute` is the smallest merit that brute force found, infinite if no admissible path.
    void add(const SpecularChain& chain, const SpecularPath& path, double brute) {
        ++solves;
        exact += path.status == SolveStatus::exact ? 1 : 0;
        relaxed += path.status == SolveStatus::relaxed ? 1 : 0;
        iterations += path.work.iterations;
        evaluations += path.work.evaluations;
        if (!std::isfinite(brute)) return;
        double merit = 0.0;
        for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
            merit += glm::dot(path.vertices[i].slope, path.vertices[i].slope);
        }
        missed += path.status == SolveStatus::failed ? 1 : 0;
        worse += path.status == SolveStatus::failed || merit > brute * (1.0 + 1e-6) + 1e-12 ? 1 : 0;
    }
    void report(const char* name) const {
        MESSAGE(std::string(name) << ": " << solves << " solves, " << exact << " exact, " << relaxed << " relaxed, "
                                  << worse << " above the grid's minimum, " << missed << " of them failed; iterations "
                                  << iterations / solves << ", evaluations " << evaluations / solves);
    }
};

}  // namespace

TEST_CASE("solver: one reflection is never worse than the best point of a grid") {
    Generator generator(1);
    const std::vector<Vec2d> grid = grid_points(40);
    for (const double bend : {0.02, 0.2, 0.6}) {
        Comparison comparison;
        for (int i = 0; i < 400; ++i) {
            const SurfacePatch patch = random_patch(generator, Vec3d(0.0), Vec3d(0.0, 0.0, 1.0), bend);
            const Vec3d receiver = random_point(generator, 3.0) + Vec3d(0.0, 0.0, 3.5);
            const PathEnd light{random_point(generator, 3.0) + Vec3d(0.0, 0.0, 3.5)};
            const SpecularChain chain = chain_of({&patch}, receiver, light);
            double brute = INFINITY;
            SolverWork work;
            for (const Vec2d& b : grid) brute = std::min(brute, make_state(chain, {b}, Region::triangles, work).merit);
            comparison.add(chain, solve_specular_path(chain), brute);
        }
        comparison.report(bend < 0.1 ? "bend 0.02" : bend < 0.5 ? "bend 0.2" : "bend 0.6");
        // Normals that turn by 0.6 radians inside of one triangle fold the slopes: several minima may exist.
        CHECK(comparison.worse <= (bend < 0.5 ? 0 : comparison.solves / 50));
        CHECK(comparison.missed == 0);
    }
}

TEST_CASE("solver: two reflections are rarely worse than the best pair of two grids") {
    Generator generator(2);
    const std::vector<Vec2d> grid = grid_points(8);
    Comparison comparison;
    int acceptable = 0, lost = 0;  // By early rejection.
    for (int i = 0; i < 400; ++i) {
        const SurfacePatch first = random_patch(generator, Vec3d(0.0, 0.0, 0.0), Vec3d(0.0, 0.0, 1.0), 0.2);
        const SurfacePatch second = random_patch(generator, Vec3d(3.0, 0.0, 3.0), Vec3d(0.0, 0.0, -1.0), 0.2);
        const Vec3d receiver = Vec3d(-3.0, 0.0, 3.0) + random_point(generator, 1.0);
        const PathEnd light{Vec3d(6.0, 0.0, 0.0) + random_point(generator, 1.0)};
        const SpecularChain chain = chain_of({&first, &second}, receiver, light);
        double brute = INFINITY;
        SolverWork work;
        for (const Vec2d& a : grid) {
            for (const Vec2d& b : grid)
                brute = std::min(brute, make_state(chain, {a, b}, Region::triangles, work).merit);
        }
        comparison.add(chain, solve_specular_path(chain), brute);
        for (const double max_slope : {0.02, 0.1}) {
            SpecularChain limited = chain;
            limited.vertices[0].max_slope = limited.vertices[1].max_slope = max_slope;
            const SpecularPath full = solve_specular_path(limited, {.rejection_margin = INFINITY});
            const bool accepted = full.status == SolveStatus::exact || full.status == SolveStatus::relaxed;
            lost += accepted && solve_specular_path(limited).length == 0 ? 1 : 0;
            acceptable += accepted ? 1 : 0;
        }
    }
    comparison.report("two reflections");
    CHECK(acceptable > 20);
    CHECK(lost == 0);
    CHECK(comparison.worse <= comparison.solves / 50);
    CHECK(comparison.missed <= comparison.solves / 100);
}

TEST_CASE("solver: triangle centres without Newton's method, and acceptance by Eq. 1") {
    Generator generator(3);
    int exact = 0, relaxed = 0, rejected = 0;
    for (int i = 0; i < 500; ++i) {
        const SurfacePatch patch = random_patch(generator, Vec3d(0.0), Vec3d(0.0, 0.0, 1.0), 0.1);
        const Vec3d receiver = random_point(generator, 1.0) + Vec3d(0.0, 0.0, 3.5);
        const double max_slope = acceptance_slope(0.05, 0.01);
        const SpecularChain chain =
            chain_of({&patch}, receiver, {random_point(generator, 1.0) + Vec3d(0.0, 0.0, 3.5)}, max_slope);
        const SpecularPath centre = solve_specular_path(chain, {.newton = false}), path = solve_specular_path(chain);
        const bool accepted = path.status == SolveStatus::exact || path.status == SolveStatus::relaxed;
        if (accepted) CHECK(path.residual <= max_slope);
        if (centre.status != SolveStatus::failed) {
            CHECK(glm::length(centre.vertices[0].position - evaluate(patch, triangle_centre).position) < 1e-14);
            if (path.length > 0) CHECK(path.residual <= centre.residual * (1.0 + 1e-12));
            if (centre.status != SolveStatus::rejected) CHECK(accepted);
        }
        exact += path.status == SolveStatus::exact ? 1 : 0;
        relaxed += path.status == SolveStatus::relaxed ? 1 : 0;
        rejected += path.status == SolveStatus::rejected ? 1 : 0;
    }
    CHECK((exact > 0 && relaxed > 0 && rejected > 0));

    // Eq. 1 itself, and its clamp: a formula below -1 prunes nothing, an epsilon above the lobe's peak all but C = 0.
    CHECK(1.0 - acceptance_one_minus_cos(0.05, 0.01) ==
          doctest::Approx(std::log(0.01 * M_PI * 0.0025) * 0.0025 / 2.0 + 1.0));
    CHECK(acceptance_slope(1e-4, 0.01) == doctest::Approx(1e-4 * std::sqrt(-std::log(0.01 * M_PI * 1e-8))));
    CHECK(acceptance_one_minus_cos(1.0, 1e-3) == 2.0);
    CHECK(acceptance_slope(1.0, 1e-3) == INFINITY);
    CHECK(acceptance_slope(1.0, 1.0) == 0.0);
    for (double previous = 0.0, alpha = 1e-5; alpha < 1.0; alpha *= 1.1) {
        CHECK(acceptance_slope(alpha, 0.01) > previous);
        previous = acceptance_slope(alpha, 0.01);
        if (std::isinf(previous)) break;
    }
}

TEST_CASE("solver: scale and offset do not matter") {
    Generator generator(4);
    int different = 0;
    for (int i = 0; i < 300; ++i) {
        const SurfacePatch patch = random_patch(generator, Vec3d(0.0), Vec3d(0.0, 0.0, 1.0), 0.1);
        const Vec3d receiver = random_point(generator, 1.0) + Vec3d(0.0, 0.0, 3.5);
        const Vec3d light = random_point(generator, 1.0) + Vec3d(0.0, 0.0, 3.5);
        const SpecularPath path = solve_specular_path(chain_of({&patch}, receiver, {light}));
        for (const double scale : {1e-4, 1.0, 1e5}) {
            for (const Vec3d& offset : {Vec3d(0.0), Vec3d(1e5, -1e5, 1e5) * scale}) {
                const auto placed = [&](const Vec3d& p) { return offset + scale * p; };
                const SurfacePatch copy = make_surface_patch(
                    {placed(patch.positions[0]), placed(patch.positions[1]), placed(patch.positions[2])},
                    patch.normals);
                const SpecularPath same = solve_specular_path(chain_of({&copy}, placed(receiver), {placed(light)}));
                CHECK(is_finite(same));
                // Rounding of the positions, 1e-11 at this offset, moves a smooth minimum by its square root.
                const double tolerance = (path.status == SolveStatus::exact ? 1e-6 : 2e-5) * scale;
                bool agrees = same.status == path.status && std::abs(same.residual - path.residual) < 1e-8;
                if (agrees && path.length > 0) {
                    agrees = glm::length(same.vertices[0].position - placed(path.vertices[0].position)) < tolerance;
                }
                different += agrees ? 0 : 1;
            }
        }
    }
    CHECK(different == 0);
}

TEST_CASE("solver: extremes have defined results and nothing non-finite leaves") {
    Generator generator(5);
    const double nan = std::numeric_limits<double>::quiet_NaN(), huge = std::numeric_limits<double>::max();
    const Vec3d up(0.0, 0.0, 1.0);
    const SurfacePatch patch = random_patch(generator, Vec3d(0.0), up, 0.2);
    const SurfacePatch zero = make_surface_patch({Vec3d(1.0), Vec3d(1.0), Vec3d(1.0)}, {up, up, up});
    const Vec3d on = evaluate(patch, Vec2d(0.2, 0.3)).position, corner = patch.positions[0];
    const auto status = [&](const SpecularChain& chain) {
        for (const bool newton : {true, false}) CHECK(is_finite(solve_specular_path(chain, {.newton = newton})));
        return solve_specular_path(chain).status;
    };
    CHECK(status(chain_of({&zero}, 3.0 * up, {2.0 * up})) == SolveStatus::failed);
    CHECK(status(chain_of({&patch, &zero}, 3.0 * up, {2.0 * up})) == SolveStatus::failed);
    CHECK(status(chain_of({}, 3.0 * up, {2.0 * up})) == SolveStatus::failed);
    CHECK(status(chain_of({&patch}, -3.0 * up, {2.0 * up})) == SolveStatus::failed);
    CHECK(status(chain_of({&patch}, Vec3d(nan), {2.0 * up})) == SolveStatus::failed);
    CHECK(status(chain_of({&patch}, 3.0 * up, {Vec3d(nan), true})) == SolveStatus::failed);
    CHECK(status(chain_of({&patch}, 3.0 * up, {Vec3d(0.0), true})) == SolveStatus::failed);
    status(chain_of({&patch}, Vec3d(huge), {2.0 * up}));
    // Light or receiver on the reflector, at a corner, at the centre where the search starts; the same patch twice.
    for (const Vec3d& end : {on, corner, evaluate(patch, triangle_centre).position}) {
        status(chain_of({&patch}, end, {2.0 * up}));
        status(chain_of({&patch}, 2.0 * up, {end}));
        status(chain_of({&patch}, end, {end}));
        status(chain_of({&patch, &patch}, end, {2.0 * up}));
        status(chain_of({&patch, &patch, &patch, &patch}, 2.0 * up, {end}));
    }
    // Normals that contradict the geometry, each other, or lie in the plane.
    for (const auto& n : {std::array<Vec3d, 3>{-up, -up, -up},
                          {up, -up, up},
                          {Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(-1, -1, 0)},
                          {Vec3d(1, 0, 0), Vec3d(1, 0, 0), Vec3d(1, 0, 0)}}) {
        const SurfacePatch odd = make_surface_patch(patch.positions, n);
        status(chain_of({&odd}, 3.0 * up, {2.0 * up + Vec3d(0.3, 0.1, 0.0)}));
        status(chain_of({&odd, &patch}, 3.0 * up, {2.0 * up, true}));
    }
    const SurfacePatch flipped =
        make_surface_patch(patch.positions, {-patch.normals[0], -patch.normals[1], -patch.normals[2]});
    CHECK(solve_specular_path(chain_of({&flipped}, 3.0 * up, {2.0 * up})).residual ==
          doctest::Approx(solve_specular_path(chain_of({&patch}, 3.0 * up, {2.0 * up})).residual));
    // Anything at all.
    for (int i = 0; i < 20000; ++i) {
        const auto point = [&] { return random_point(generator, 1.0) * std::pow(10.0, uniform(generator, -8.0, 8.0)); };
        std::array<SurfacePatch, 2> patches;
        for (SurfacePatch& p : patches) {
            const Vec3d first = point(), second = i % 7 == 0 ? first * (1.0 + 1e-9) : point();
            p = make_surface_patch({first, second, point()}, {point(), point(), point()});
        }
        const PathEnd light{point(), i % 3 == 0};
        SpecularChain chain =
            i % 2 == 0 ? chain_of({&patches[0]}, point(), light) : chain_of({&patches[0], &patches[1]}, point(), light);
        chain.vertices[0].alpha = i % 5 == 0 ? 1.0 : 1e-4;
        if (!is_finite(solve_specular_path(chain))) CHECK(false);
    }
}

TEST_CASE("solver: receiver on a caustic's fold, where the Jacobian is singular") {
    // A concave mirror with parallel light: rays near its axis focus at half the radius; receivers there and about.
    const auto mirror = [](double x, double y) {
        const Vec3d p(x, y, 1.0 - std::sqrt(1.0 - x * x - y * y));
        return std::pair(p, Vec3d(0.0, 0.0, 1.0) - p);
    };
    int smooth = 0;
    for (int i = -20; i <= 20; ++i) {
        const auto [p0, n0] = mirror(-0.05, -0.05);
        const auto [p1, n1] = mirror(0.05, -0.05);
        const auto [p2, n2] = mirror(0.0, 0.07);
        const SurfacePatch patch = make_surface_patch({p0, p1, p2}, {n0, n1, n2});
        const Vec3d receiver(0.0, 0.0, 0.5 + 1e-4 * i);
        const SpecularPath path = solve_specular_path(chain_of({&patch}, receiver, {Vec3d(0.0, 0.0, 1.0), true}));
        CHECK(is_finite(path));
        CHECK(path.status != SolveStatus::failed);
        CHECK(path.residual < 1e-3);
        smooth += path.status == SolveStatus::exact ? 1 : 0;
    }
    CHECK(smooth > 30);
}

namespace {

/// A height field's point and normal: a bumpy plane.
std::pair<Vec3d, Vec3d> bumpy(double x, double y) {
    const double z =
        0.03 * std::sin(9.0 * x) * std::sin(11.0 * y) + 0.02 * std::sin(23.0 * x + 1.0) * std::cos(19.0 * y);
    const double dx =
        0.27 * std::cos(9.0 * x) * std::sin(11.0 * y) + 0.46 * std::cos(23.0 * x + 1.0) * std::cos(19.0 * y);
    const double dy =
        0.33 * std::sin(9.0 * x) * std::cos(11.0 * y) - 0.38 * std::sin(23.0 * x + 1.0) * std::sin(19.0 * y);
    return {Vec3d(x, y, z), glm::normalize(Vec3d(-dx, -dy, 1.0))};
}

}  // namespace

TEST_CASE("solver: convergence on a bumpy plane of 31 k triangles") {
    constexpr int cells = 125;
    std::vector<SurfacePatch> patches;
    for (int i = 0; i < cells; ++i) {
        for (int j = 0; j < cells; ++j) {
            const auto at = [&](int a, int b) {
                return bumpy(-1.0 + 2.0 * (i + a) / cells, -1.0 + 2.0 * (j + b) / cells);
            };
            const auto a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
            patches.push_back(make_surface_patch({a.first, b.first, c.first}, {a.second, b.second, c.second}));
            patches.push_back(make_surface_patch({a.first, c.first, d.first}, {a.second, c.second, d.second}));
        }
    }
    for (const double alpha : {0.005, 0.05}) {
        Generator generator(6);
        const double max_slope = acceptance_slope(alpha, 0.01);
        std::vector<SpecularChain> chains;
        for (int i = 0; i < 20; ++i) {
            const Vec3d receiver(uniform(generator, -1.0, 1.0), 1.5, uniform(generator, 0.1, 1.0));
            for (const SurfacePatch& patch : patches) {
                SpecularChain chain = chain_of({&patch}, receiver, {Vec3d(0.2, -2.0, 2.0)}, max_slope);
                chain.vertices[0].alpha = alpha;
                // What a tight search would leave: some point of a grid is close to acceptable.
                SolverWork work;
                const ChainState centre = make_state(chain, {triangle_centre}, Region::triangles, work);
                if (centre.merit < (max_slope + 0.1) * (max_slope + 0.1)) chains.push_back(chain);
            }
        }
        std::array<int, 4> count{};
        double iterations = 0.0, evaluations = 0.0;
        const auto start = std::chrono::steady_clock::now();
        for (const SpecularChain& chain : chains) {
            const SpecularPath path = solve_specular_path(chain);
            ++count[static_cast<size_t>(path.status)];
            iterations += path.work.iterations;
            evaluations += path.work.evaluations;
        }
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        int lost = 0;
        for (const SpecularChain& chain : chains) {
            const SpecularPath quick = solve_specular_path(chain);
            if (quick.length > 0) continue;
            const SpecularPath full = solve_specular_path(chain, {.rejection_margin = INFINITY});
            lost += full.status == SolveStatus::exact || full.status == SolveStatus::relaxed ? 1 : 0;
        }
        CHECK(lost == 0);
        const auto n = static_cast<double>(chains.size());
        MESSAGE("alpha " << alpha << ": " << chains.size() << " chains, exact " << count[0] << ", relaxed " << count[1]
                         << ", rejected " << count[2] << ", failed " << count[3] << "; iterations " << iterations / n
                         << ", evaluations " << evaluations / n << ", " << 1e6 * seconds / n << " us per solve");
        CHECK(count[3] == 0);
        CHECK(count[0] > 0);
    }
}

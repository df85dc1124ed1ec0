// The representative path through a chain of triangles, against closed forms and against brute force.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "pathcut/newton_solver.h"
#include "tests/pathcut_chains.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

using Real = long double;

Vec3d random_direction(Generator& generator) {
    return glm::normalize(Vec3d(std::normal_distribution<double>()(generator),
                                std::normal_distribution<double>()(generator),
                                std::normal_distribution<double>()(generator)));
}

struct SurfaceSample {
    Vec3d position, normal;
};
using Surface = std::function<SurfaceSample(const Vec2d& uv)>;

/// A small triangle on a smooth surface about the point at `uv`, which it holds somewhere in its inside.
SurfacePatch patch_about(Generator& generator, const Surface& surface, const Vec2d& uv, double size) {
    while (true) {
        std::array<Vec2d, 3> corners;
        for (Vec2d& corner : corners) corner = Vec2d(uniform(generator, -size, size), uniform(generator, -size, size));
        const auto side = [&](size_t a, size_t b) { return corners[a].x * corners[b].y - corners[a].y * corners[b].x; };
        const double s0 = side(0, 1), s1 = side(1, 2), s2 = side(2, 0), least = 0.02 * size * size;
        if (!(s0 > least && s1 > least && s2 > least) && !(s0 < -least && s1 < -least && s2 < -least)) continue;
        std::array<Vec3d, 3> p, n;
        for (size_t i = 0; i < 3; ++i) {
            const SurfaceSample sample = surface(uv + corners[i]);
            p[i] = sample.position;
            n[i] = sample.normal;
        }
        return make_surface_patch(p, n);
    }
}

/// The zero of an increasing function, by bisection.
Real find_zero(const std::function<Real(Real)>& f, Real low, Real high) {
    for (int i = 0; i < 200; ++i) {
        const Real middle = (low + high) / 2;
        (f(middle) > 0 ? high : low) = middle;
    }
    return (low + high) / 2;
}

/// Angle on the unit circle at which a ray from l is reflected to x, both outside and given in the plane (Alhazen).
Real reflection_angle(const Vec2d& x, const Vec2d& l) {
    const auto from_normal = [](const Vec2d& to, Real angle) {
        const Real c = std::cos(angle), s = std::sin(angle), dx = Real(to.x) - c, dy = Real(to.y) - s;
        return std::atan2(c * dy - s * dx, c * dx + s * dy);
    };
    const Real a = std::atan2(Real(x.y), Real(x.x)), b = std::atan2(Real(l.y), Real(l.x));
    return find_zero([&](Real angle) { return -(from_normal(x, angle) + from_normal(l, angle)); }, std::min(a, b),
                     std::max(a, b));
}

struct Statistics {
    int solves = 0, exact = 0, iterations = 0, most_iterations = 0, evaluations = 0;
    double worst = 0.0;
    void add(const SpecularPath& path, double error) {
        ++solves;
        exact += path.status == SolveStatus::exact ? 1 : 0;
        iterations += path.work.iterations;
        most_iterations = std::max(most_iterations, path.work.iterations);
        evaluations += path.work.evaluations;
        worst = std::max(worst, path.status == SolveStatus::exact ? error : INFINITY);
    }
    void report(const char* name) const {
        MESSAGE(std::string(name) << ": " << exact << " of " << solves << " exact, iterations "
                                  << double(iterations) / solves << " (at most " << most_iterations << "), evaluations "
                                  << double(evaluations) / solves << ", largest error " << worst);
    }
};

}  // namespace

TEST_CASE("solver: flat mirror, image point") {
    Generator generator(1);
    Statistics statistics;
    for (int i = 0; i < 2000; ++i) {
        const double scale = i % 3 == 0 ? 1e-4 : i % 3 == 1 ? 1.0 : 1e5;
        const Vec3d offset = i % 2 == 0 ? Vec3d(0.0) : scale * Vec3d(1e5, -1e5, 1e5);
        const Vec3d y(uniform(generator, -0.5, 0.5), uniform(generator, -0.3, 0.3), 0.0);
        const Vec3d wo = glm::normalize(Vec3d(uniform(generator, -2.0, 2.0), uniform(generator, -2.0, 2.0), 1.0));
        const Vec3d wi(-wo.x, -wo.y, wo.z);
        const SurfacePatch patch =
            make_surface_patch({offset + scale * Vec3d(-2.0, -1.0, 0.0), offset + scale * Vec3d(2.0, -1.0, 0.0),
                                offset + scale * Vec3d(0.0, 2.0, 0.0)},
                               {Vec3d(0.0), Vec3d(0.0), Vec3d(0.0)});
        const PathEnd light =
            i % 5 == 0 ? PathEnd{wi, true} : PathEnd{offset + scale * (y + uniform(generator, 0.3, 9.0) * wi)};
        const SpecularPath path =
            solve_specular_path(chain_of({&patch}, offset + scale * (y + uniform(generator, 0.3, 9.0) * wo), light));
        statistics.add(path, glm::length(path.vertices[0].position - (offset + scale * y)) / scale);
    }
    statistics.report("flat mirror");
    CHECK(statistics.worst < 1e-6);
}

TEST_CASE("solver: sphere, Alhazen's problem") {
    Generator generator(2);
    Statistics statistics;
    for (int i = 0; i < 1000; ++i) {
        const Vec3d e1 = random_direction(generator), e2 = glm::normalize(glm::cross(e1, random_direction(generator)));
        const Vec3d e3 = glm::cross(e1, e2);
        const double turn = uniform(generator, 0.1, 1.5);
        const Vec2d x(uniform(generator, 1.5, 8.0), 0.0),
            l = uniform(generator, 1.5, 8.0) * Vec2d(std::cos(turn), std::sin(turn));
        const auto angle = static_cast<double>(reflection_angle(x, l));
        const Surface sphere = [&](const Vec2d& uv) -> SurfaceSample {
            const Vec3d n =
                e1 * (std::cos(uv.x) * std::cos(uv.y)) + e2 * (std::sin(uv.x) * std::cos(uv.y)) + e3 * std::sin(uv.y);
            return {n, n};
        };
        const Vec3d exact = sphere(Vec2d(angle, 0.0)).position;
        // The light must not be behind the horizon of the reflecting point.
        if (glm::dot(exact, e1 * x.x) < 1.05 || glm::dot(exact, e1 * l.x + e2 * l.y) < 1.05) continue;
        const SurfacePatch patch = patch_about(generator, sphere, Vec2d(angle, 0.0), 3e-4);
        const SpecularPath path = solve_specular_path(chain_of({&patch}, e1 * x.x, {e1 * l.x + e2 * l.y}));
        statistics.add(path, glm::length(path.vertices[0].position - exact));
    }
    statistics.report("sphere");
    CHECK(statistics.solves > 500);
    CHECK(statistics.worst < 1e-6);
}

TEST_CASE("solver: cylinder") {
    Generator generator(3);
    Statistics statistics;
    const Surface cylinder = [](const Vec2d& uv) -> SurfaceSample {
        const Vec3d n(std::cos(uv.x), std::sin(uv.x), 0.0);
        return {n + Vec3d(0.0, 0.0, uv.y), n};
    };
    for (int i = 0; i < 1000; ++i) {
        const double turn = uniform(generator, 0.1, 1.5);
        const Vec2d x(uniform(generator, 1.5, 8.0), 0.0),
            l = uniform(generator, 1.5, 8.0) * Vec2d(std::cos(turn), std::sin(turn));
        const double xz = uniform(generator, -3.0, 3.0), lz = uniform(generator, -3.0, 3.0);
        const auto angle = static_cast<double>(reflection_angle(x, l));
        const Vec2d n(std::cos(angle), std::sin(angle));
        if (glm::dot(n, x) < 1.05 || glm::dot(n, l) < 1.05) continue;
        // Seen along the axis the path is reflected in the plane; unfolded, it is straight along the axis.
        const double dx = glm::length(x - n), dl = glm::length(l - n), z = (xz * dl + lz * dx) / (dx + dl);
        const SurfacePatch patch = patch_about(generator, cylinder, Vec2d(angle, z), 3e-4);
        const SpecularPath path = solve_specular_path(chain_of({&patch}, Vec3d(x, xz), {Vec3d(l, lz)}));
        statistics.add(path, glm::length(path.vertices[0].position - Vec3d(n, z)));
    }
    statistics.report("cylinder");
    CHECK(statistics.solves > 500);
    CHECK(statistics.worst < 1e-6);
}

TEST_CASE("solver: paraboloid, light in the focus; and receiver in the focus, where the Jacobian is singular") {
    Generator generator(4);
    Statistics statistics, focus;
    const double f = 0.7;
    const Surface paraboloid = [f](const Vec2d& uv) -> SurfaceSample {
        return {Vec3d(uv, glm::dot(uv, uv) / (4.0 * f)), glm::normalize(Vec3d(-uv / (2.0 * f), 1.0))};
    };
    for (int i = 0; i < 1000; ++i) {
        const Vec2d at(uniform(generator, -1.0, 1.0), uniform(generator, -1.0, 1.0));
        const SurfacePatch patch = patch_about(generator, paraboloid, at, 3e-4);
        const SpecularPath path =
            solve_specular_path(chain_of({&patch}, Vec3d(at, uniform(generator, 1.0, 5.0)), {Vec3d(0.0, 0.0, f)}));
        statistics.add(path, glm::length(path.vertices[0].position - paraboloid(at).position));
        // Every point of the mirror sends the light to its focus: any is right, as far as the patch is a paraboloid.
        const SpecularPath any =
            solve_specular_path(chain_of({&patch}, Vec3d(0.0, 0.0, f), {Vec3d(0.0, 0.0, 1.0), true}));
        CHECK(is_finite(any));
        CHECK((any.status == SolveStatus::exact || any.status == SolveStatus::relaxed));
        CHECK(any.residual < 1e-6);
        focus.add(any, 0.0);
    }
    statistics.report("paraboloid");
    focus.report("paraboloid, receiver in the focus");
    CHECK(statistics.worst < 1e-6);
}

TEST_CASE("solver: two flat mirrors, image of the image") {
    Generator generator(5);
    Statistics statistics;
    for (int i = 0; i < 2000; ++i) {
        // Backwards: a path that is reflected twice defines the mirrors' normals.
        const Vec3d receiver = random_point(generator, 1.0),
                    y1 = receiver + Vec3d(0.0, 0.0, 3.0) + random_point(generator, 0.5);
        const Vec3d y2 = y1 + Vec3d(3.0, 0.0, 0.0) + random_point(generator, 0.5);
        const Vec3d light = y2 + Vec3d(0.0, 0.0, -3.0) + random_point(generator, 0.5);
        const auto mirror = [&](const Vec3d& before, const Vec3d& at, const Vec3d& after) {
            const Vec3d n = glm::normalize(glm::normalize(before - at) + glm::normalize(after - at));
            const Vec3d e1 = glm::normalize(glm::cross(n, Vec3d(0.1, 1.0, 0.2))), e2 = glm::cross(n, e1);
            const double turn = uniform(generator, 0.0, 1.0);
            std::array<Vec3d, 3> p;
            for (size_t k = 0; k < 3; ++k) {
                const double angle = turn + 2.0943951 * static_cast<double>(k);
                p[k] = at + e1 * std::cos(angle) + e2 * std::sin(angle) + 0.2 * (e1 * uniform(generator, -1.0, 1.0));
            }
            return make_surface_patch(p, {Vec3d(0.0), Vec3d(0.0), Vec3d(0.0)});
        };
        const SurfacePatch first = mirror(receiver, y1, y2), second = mirror(y1, y2, light);
        const PathEnd end = i % 4 == 0 ? PathEnd{glm::normalize(light - y2), true} : PathEnd{light};
        const SpecularPath path = solve_specular_path(chain_of({&first, &second}, receiver, end));
        statistics.add(
            path, std::max(glm::length(path.vertices[0].position - y1), glm::length(path.vertices[1].position - y2)));
    }
    statistics.report("two flat mirrors");
    CHECK(statistics.worst < 1e-6);
}

TEST_CASE("solver: three and four reflections on curved patches are found back") {
    Generator generator(6);
    for (const int length : {3, 4}) {
        Statistics statistics;
        for (int i = 0; i < 500; ++i) {
            // A zigzag path between two walls; patches whose normals turn by some degrees about the specular one.
            std::vector<Vec3d> y;
            for (int k = 0; k <= length + 1; ++k)
                y.push_back(Vec3d(1.5 * k, k % 2 == 0 ? 0.0 : 2.0, 0.0) + random_point(generator, 0.3));
            std::vector<SurfacePatch> patches;
            for (size_t k = 1; k <= static_cast<size_t>(length); ++k) {
                const Vec3d n = glm::normalize(glm::normalize(y[k - 1] - y[k]) + glm::normalize(y[k + 1] - y[k]));
                const Vec3d e1 = glm::normalize(glm::cross(n, Vec3d(0.1, 0.2, 1.0))), e2 = glm::cross(n, e1);
                const double convexity = uniform(generator, 0.2, 1.0);
                const Surface paraboloid = [&](const Vec2d& uv) -> SurfaceSample {
                    return {y[k] + e1 * uv.x + e2 * uv.y - n * (0.5 * convexity * glm::dot(uv, uv)),
                            glm::normalize(n + convexity * (e1 * uv.x + e2 * uv.y))};
                };
                patches.push_back(patch_about(generator, paraboloid, Vec2d(0.0), 1e-3));
            }
            SpecularChain chain = chain_of({}, y[0], {y[static_cast<size_t>(length) + 1]});
            for (const SurfacePatch& patch : patches)
                chain.vertices[static_cast<size_t>(chain.length++)] = {&patch, {}, 0.01, no_limit};
            const SpecularPath path = solve_specular_path(chain);
            double error = 0.0;
            for (size_t k = 0; k < patches.size(); ++k)
                error = std::max(error, glm::length(path.vertices[k].position - y[k + 1]));
            statistics.add(path, error);
        }
        statistics.report(length == 3 ? "three curved patches" : "four curved patches");
        // The patches' chords are up to 1e-7 off the paraboloids, which the chain amplifies.
        CHECK(statistics.worst < 1e-5);
    }
}

TEST_CASE("solver: refraction by a flat interface obeys Snell's law") {
    Generator generator(7);
    Statistics statistics;
    const Surface plane = [](const Vec2d& uv) -> SurfaceSample { return {Vec3d(uv, 0.0), Vec3d(0.0, 0.0, 1.0)}; };
    for (int i = 0; i < 1000; ++i) {
        const double above = uniform(generator, 0.5, 3.0), below = uniform(generator, 0.5, 3.0),
                     across = uniform(generator, 0.0, 3.0);
        const auto excess = [&](Real t) {
            return t / std::hypot(t, Real(above)) - Real(1.5) * (across - t) / std::hypot(across - t, Real(below));
        };
        const Vec2d y(static_cast<double>(find_zero(excess, 0, across)), 0.0);
        const SurfacePatch patch = patch_about(generator, plane, y, 0.2);
        SpecularChain chain = chain_of({&patch}, Vec3d(across, 0.0, -below), {Vec3d(0.0, 0.0, above)});
        chain.vertices[0].interaction = {1.0, 1.5, true};
        const SpecularPath path = solve_specular_path(chain);
        statistics.add(path, glm::length(path.vertices[0].position - Vec3d(y, 0.0)));
    }
    statistics.report("flat interface");
    CHECK(statistics.worst < 1e-6);
}

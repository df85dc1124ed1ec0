// Surface patches and the half-vector constraint, against finite differences in long double.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "pathcut/half_vector_constraint.h"

using namespace nephroid;

namespace {

using Real = long double;
using Vec3l = glm::tvec3<Real>;
using Vec2l = glm::tvec2<Real>;
using Generator = std::mt19937_64;

double uniform(Generator& generator, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
}
Vec3d random_point(Generator& generator, double extent) {
    return {uniform(generator, -extent, extent), uniform(generator, -extent, extent),
            uniform(generator, -extent, extent)};
}

SurfacePatch random_patch(Generator& generator, double scale, const Vec3d& offset) {
    std::array<Vec3d, 3> p, n;
    const Vec3d normal = glm::normalize(random_point(generator, 1.0));
    for (size_t i = 0; i < 3; ++i) {
        p[i] = offset + random_point(generator, scale);
        n[i] = glm::normalize(normal + random_point(generator, 0.4));
    }
    return make_surface_patch(p, n);
}

/// The obvious twin in long double: everything that the constraint depends on, as plain numbers.
struct Configuration {
    const SurfacePatch* patch;
    Vec2d barycentrics;
    Interaction interaction;
    PathEnd viewer, light;
};
struct Displacement {
    Vec2l vertex{0};
    Vec3l viewer{0}, light{0};
};

/// The slope of a displaced configuration, in the frame (s, t) at n carried along to the displaced normal by the
/// smallest rotation.
Vec2l slope_at(const Configuration& c, const Displacement& d, const SlopeConstraint& frame, const Vec3d& frame_normal) {
    const SurfacePatch& patch = *c.patch;
    Vec2l b(c.barycentrics);
    for (int k = 0; k < 2; ++k) b += Vec2l(patch.barycentric_gradient[static_cast<size_t>(k)]) * d.vertex[k];
    const auto mix = [&](const std::array<Vec3d, 3>& v) {
        return Vec3l(v[0]) * (1 - b.x - b.y) + Vec3l(v[1]) * b.x + Vec3l(v[2]) * b.y;
    };
    const Vec3l position = mix(patch.positions), n = glm::normalize(mix(patch.normals));
    const Vec3l wo = glm::normalize(Vec3l(c.viewer.point) + d.viewer - position);
    const Vec3l l = Vec3l(c.light.point) + d.light;
    const Vec3l wi = glm::normalize(c.light.at_infinity ? l : l - position);
    const Vec3l h = glm::normalize(wi * Real(c.interaction.eta_i) + wo * Real(c.interaction.eta_o));
    const Vec3l n0 = glm::normalize(Vec3l(frame_normal));
    const auto transported = [&](const Vec3l& v) { return v - (n0 + n) * (glm::dot(v, n) / (1 + glm::dot(n0, n))); };
    return Vec2l(glm::dot(h, transported(Vec3l(frame.s))), glm::dot(h, transported(Vec3l(frame.t)))) / glm::dot(h, n);
}

/// Largest difference between an analytic derivative and central differences, relative to `norm`.
template <class Move>
double derivative_error(const Configuration& c, const SlopeConstraint& frame, const Vec3d& normal,
                        const Vec2d& analytic, double step, double norm, Move move) {
    Displacement forward, backward;
    move(forward, Real(step));
    move(backward, Real(-step));
    const Vec2l difference =
        (slope_at(c, forward, frame, normal) - slope_at(c, backward, frame, normal)) / Real(2 * step);
    return static_cast<double>(glm::length(difference - Vec2l(analytic))) / norm;
}

double norm_of(const glm::dmat2& m) {
    return std::hypot(glm::length(m[0]), glm::length(m[1]));
}
double norm_of(const glm::dmat3x2& m) {
    return std::hypot(glm::length(m[0]), glm::length(m[1]), glm::length(m[2]));
}

/// Largest relative error of the slope and of its derivatives.
double constraint_error(const Configuration& c, double step) {
    const PatchPoint point = evaluate(*c.patch, c.barycentrics);
    const SlopeConstraint result = evaluate_constraint(*c.patch, point, c.interaction, c.viewer, c.light);
    REQUIRE(result.valid);
    const Vec2l slope = slope_at(c, {}, result, point.normal);
    double error = static_cast<double>(glm::length(slope - Vec2l(result.slope))) / (1e-3 + glm::length(result.slope));
    for (int k = 0; k < 2; ++k) {
        error = std::max(error,
                         derivative_error(c, result, point.normal, result.by_vertex[k], step, norm_of(result.by_vertex),
                                          [k](Displacement& d, Real e) { d.vertex[k] = e; }));
    }
    const double light_step = c.light.at_infinity ? 1e-5 : step;
    for (int k = 0; k < 3; ++k) {
        error = std::max(error,
                         derivative_error(c, result, point.normal, result.by_viewer[k], step, norm_of(result.by_viewer),
                                          [k](Displacement& d, Real e) { d.viewer[k] = e; }));
        error = std::max(
            error, derivative_error(c, result, point.normal, result.by_light[k], light_step, norm_of(result.by_light),
                                    [k](Displacement& d, Real e) { d.light[k] = e; }));
    }
    return error;
}

bool all_finite(const SlopeConstraint& c) {
    return std::isfinite(c.slope.x + c.slope.y + norm_of(c.by_vertex) + norm_of(c.by_viewer) + norm_of(c.by_light)) &&
           std::isfinite(glm::length(c.s) + glm::length(c.t));
}

bool all_finite(const PatchPoint& p) {
    return std::isfinite(glm::length(p.position) + glm::length(p.normal) + glm::length(p.normal_derivative[0]) +
                         glm::length(p.normal_derivative[1]));
}

}  // namespace

TEST_CASE("slope constraint: value and derivatives agree with finite differences to 1e-6") {
    Generator generator(1);
    for (const double scale : {1e-4, 1.0, 1e5}) {
        double worst = 0.0;
        int tested = 0;
        while (tested < 3000) {
            const SurfacePatch patch = random_patch(generator, scale, Vec3d(0.0));
            Configuration c{&patch, Vec2d(uniform(generator, -0.3, 0.7), uniform(generator, -0.3, 0.7)), {}, {}, {}};
            const int kind = tested % 4;
            c.viewer = {random_point(generator, 3.0 * scale), false};
            c.light = {random_point(generator, 3.0 * scale), false};
            if (kind == 1) c.light = {glm::normalize(random_point(generator, 1.0)), true};
            if (kind == 2) c.interaction = {1.0, 1.5, true};
            if (kind == 3) c.interaction = {1.5, 1.5, false};
            const PatchPoint point = evaluate(patch, c.barycentrics);
            const SlopeConstraint result = evaluate_constraint(patch, point, c.interaction, c.viewer, c.light);
            // Finite differences need room: not next to the ends, the patch's thin sides, or the pole of the slope.
            const double nearest = std::min(glm::length(c.viewer.point - point.position),
                                            c.light.at_infinity ? scale : glm::length(c.light.point - point.position));
            const double gradient =
                glm::length(patch.barycentric_gradient[0]) + glm::length(patch.barycentric_gradient[1]);
            if (!result.valid || nearest < 0.1 * scale || gradient * scale > 50.0 || glm::length(result.slope) > 5.0)
                continue;
            worst = std::max(worst, constraint_error(c, 1e-6 * scale));
            ++tested;
        }
        MESSAGE("scale " << scale << ": largest relative error " << worst);
        CHECK(worst < 1e-6);
    }
}

TEST_CASE("slope constraint: a mirror and a flat interface have slope zero at the specular point") {
    const std::array<Vec3d, 3> floor{Vec3d(-9.0, -9.0, 0.0), Vec3d(9.0, -9.0, 0.0), Vec3d(0.0, 9.0, 0.0)};
    const SurfacePatch patch = make_surface_patch(floor, {Vec3d(0.0), Vec3d(0.0), Vec3d(0.0)});
    const Vec2d centre = triangle_centre;  // (0, -3, 0)
    const SlopeConstraint mirror =
        evaluate_constraint(patch, evaluate(patch, centre), {}, {Vec3d(1.0, -3.0, 1.0)}, {Vec3d(-2.0, -3.0, 2.0)});
    CHECK(glm::length(mirror.slope) < 1e-15);
    CHECK(mirror.admissible);
    const double sine = 0.5, refracted = sine / 1.5;
    const Interaction glass{1.0, 1.5, true};
    const SlopeConstraint interface = evaluate_constraint(
        patch, evaluate(patch, centre), glass, {Vec3d(refracted, -3.0, -std::sqrt(1.0 - refracted * refracted))},
        {Vec3d(-sine, 0.0, std::sqrt(1.0 - sine * sine)), true});
    CHECK(glm::length(interface.slope) < 1e-14);
    CHECK(interface.admissible);
    // The angle of the half vector: light and viewer both at 0.3 radians from the normal on the same side.
    const Vec3d tilted(std::sin(0.3), 0.0, std::cos(0.3));
    const SlopeConstraint off = evaluate_constraint(patch, evaluate(patch, centre), {}, {tilted, true}, {tilted, true});
    CHECK(glm::length(off.slope) == doctest::Approx(std::tan(0.3)).epsilon(1e-14));
}

TEST_CASE("slope constraint: extremes are flagged, nothing non-finite leaves") {
    const std::array<Vec3d, 3> p{Vec3d(0.0), Vec3d(1.0, 0.0, 0.0), Vec3d(0.0, 1.0, 0.0)};
    const std::array<Vec3d, 3> n{Vec3d(0.1, 0.0, 1.0), Vec3d(0.0, 0.1, 1.0), Vec3d(0.0, 0.0, 1.0)};
    const SurfacePatch patch = make_surface_patch(p, n);
    const PatchPoint point = evaluate(patch, triangle_centre);
    const Vec3d y = point.position, up(0.2, 0.3, 2.0);
    const double huge = std::numeric_limits<double>::max(), nan = std::numeric_limits<double>::quiet_NaN();
    CHECK(!evaluate_constraint(patch, point, {}, {y}, {up}).valid);  // viewer on the vertex
    CHECK(!evaluate_constraint(patch, point, {}, {up}, {y}).valid);  // light on the vertex
    CHECK(!evaluate_constraint(patch, point, {}, {y + Vec3d(1, 0, 0)}, {y - Vec3d(1, 0, 0)}).valid);  // wi = -wo
    CHECK(!evaluate_constraint(patch, point, {}, {Vec3d(nan, 0, 0)}, {up}).valid);
    CHECK(!evaluate_constraint(patch, point, {}, {up}, {Vec3d(0.0), true}).valid);
    CHECK(!evaluate_constraint(patch, point, {}, {y + glm::normalize(patch.axes[0])}, {y + patch.axes[0]}).admissible);
    CHECK(!evaluate_constraint(patch, point, {}, {up}, {Vec3d(0.2, 0.3, -2.0)}).admissible);  // light below
    CHECK(evaluate_constraint(patch, point, {}, {up}, {up}).admissible);
    Generator generator(2);
    size_t non_finite = 0;
    for (int i = 0; i < 20000; ++i) {
        const double scale = std::pow(10.0, uniform(generator, -320.0, 308.0));
        const Vec3d near = y + random_point(generator, 1.0) * scale;
        const Vec3d grazing = y + patch.axes[0] * uniform(generator, -2.0, 2.0) + patch.geometric_normal * scale;
        non_finite += all_finite(evaluate_constraint(patch, point, {}, {near}, {up})) ? 0 : 1;
        non_finite += all_finite(evaluate_constraint(patch, point, {}, {grazing}, {near})) ? 0 : 1;
        non_finite +=
            all_finite(evaluate_constraint(patch, point, {}, {up}, {random_point(generator, 1.0) * scale, true})) ? 0
                                                                                                                  : 1;
        non_finite +=
            all_finite(evaluate_constraint(patch, point, {1.0, 1.5, true}, {near}, {Vec3d(huge), true})) ? 0 : 1;
    }
    CHECK(non_finite == 0);
}

TEST_CASE("surface patches: interpolation, projection and plane coordinates") {
    Generator generator(3);
    double worst = 0.0;
    for (int i = 0; i < 2000; ++i) {
        const SurfacePatch patch = random_patch(generator, 1.0, Vec3d(1e5, -1e5, 1e5));
        const Vec2d b(uniform(generator, -1.0, 1.0), uniform(generator, -1.0, 1.0));
        const Vec2d delta(uniform(generator, -0.1, 0.1), uniform(generator, -0.1, 0.1));
        const Vec3d from = evaluate(patch, b).position, to = evaluate(patch, moved(patch, b, delta)).position;
        const double conditioning =
            glm::length(patch.barycentric_gradient[0]) + glm::length(patch.barycentric_gradient[1]);
        if (conditioning > 50.0) continue;
        worst = std::max(worst, glm::length(to - from - patch.axes[0] * delta.x - patch.axes[1] * delta.y));
        const Vec2d inside = closest_inside(patch, b);
        CHECK(is_inside(inside, 1e-12));
        // No corner and no point of a grid is closer.
        const double distance = glm::length(evaluate(patch, inside).position - from);
        for (int j = 0; j <= 8; ++j) {
            for (int k = 0; k + j <= 8; ++k) {
                CHECK(distance <= glm::length(evaluate(patch, Vec2d(j, k) / 8.0).position - from) + 1e-9);
            }
        }
    }
    CHECK(worst < 1e-9);
    const SurfacePatch patch = random_patch(generator, 1.0, Vec3d(0.0));
    const Vec2d corner = moved(patch, Vec2d(0.0), edge_vector(patch, 0));
    CHECK(glm::length(corner - Vec2d(1.0, 0.0)) < 1e-10);
}

TEST_CASE("surface patches: degenerate triangles and normals have defined results") {
    const Vec3d a(1.0, 2.0, 3.0), b(4.0, 2.0, 3.0), c(2.0, 2.0, 3.0), z(0.0, 0.0, 1.0);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::array<Vec3d, 3> normals{z, z, z};
    for (const SurfacePatch& patch :
         {make_surface_patch({a, a, a}, normals), make_surface_patch({a, a, b}, normals),
          make_surface_patch({a, b, c}, normals), make_surface_patch({a, b, b}, {Vec3d(0.0), Vec3d(0.0), Vec3d(0.0)}),
          make_surface_patch({a, b, Vec3d(nan)}, normals),
          make_surface_patch({a, b, c + Vec3d(0.0, 1e-13, 0.0)}, normals)}) {
        CHECK(patch.degenerate);
        CHECK(glm::length(patch.geometric_normal) == doctest::Approx(1.0));
        CHECK(std::abs(glm::dot(patch.axes[0], patch.geometric_normal)) < 1e-12);
        CHECK(all_finite(evaluate(patch, triangle_centre)));
        CHECK(is_inside(closest_inside(patch, Vec2d(2.0, 3.0)), 1e-12));
        CHECK(!evaluate_constraint(patch, evaluate(patch, triangle_centre), {}, {z * 9.0}, {z * 8.0}).admissible);
    }
    // A needle and tiny or huge triangles are triangles.
    for (const double scale : {1e-100, 1e-4, 1.0, 1e5, 1e100}) {
        const SurfacePatch needle =
            make_surface_patch({Vec3d(0.0), Vec3d(scale, 0.0, 0.0), Vec3d(0.0, 1e-8 * scale, 0.0)}, normals);
        CHECK(!needle.degenerate);
        CHECK(needle.geometric_normal.z == doctest::Approx(1.0));
        CHECK(all_finite(evaluate(needle, triangle_centre)));
    }
    const SurfacePatch no_normals =
        make_surface_patch({Vec3d(0.0), Vec3d(1, 0, 0), Vec3d(0, 1, 0)}, {Vec3d(0.0), Vec3d(nan), Vec3d(0.0)});
    CHECK(evaluate(no_normals, triangle_centre).normal == z);
    const SurfacePatch opposite = make_surface_patch({Vec3d(0.0), Vec3d(1, 0, 0), Vec3d(0, 1, 0)}, {z, -z, z});
    CHECK(evaluate(opposite, Vec2d(0.5, 0.0)).normal == z);
}

// Slope lobes: exact densities for any map, the constraint's formulas against the solver's, warps against exact
// solutions, extremes.
#include <doctest/doctest.h>

#include <array>
#include <bit>
#include <cmath>
#include <random>

#include "core/warp.h"
#include "guiding/line_array.h"
#include "guiding/slope_path.h"
#include "integrators/guided/guided_integrator.h"
#include "integrators/path/wave.h"
#include "tests/caustic_scenes.h"
#include "tests/statistics.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

class Random {
  public:
    explicit Random(uint32_t seed) : generator_(seed) {}
    double operator()(double low, double high) { return std::uniform_real_distribution<double>(low, high)(generator_); }
    Vec3d direction() {
        for (;;) {
            const Vec3d v((*this)(-1.0, 1.0), (*this)(-1.0, 1.0), (*this)(-1.0, 1.0));
            const double length = glm::length(v);
            if (length > 0.1 && length < 1.0) return v / length;
        }
    }

  private:
    std::mt19937 generator_;
};

/// A lobe of the given half axes (tangents of angles) about an axis.
SlopeLobe<float> lobe_about(const Vec3& axis, float first, float second, float turn) {
    const Frame<float> frame = make_frame(to_triple(axis));
    const Triple<float> s = frame.s * std::cos(turn) + frame.t * std::sin(turn);
    const Triple<float> t = frame.t * std::cos(turn) - frame.s * std::sin(turn);
    return {to_triple(axis), s * (1.0F / first), t * (1.0F / second)};
}

/// A patch of a ball about the origin, its receiver and its light, such that the path is specular at the patch's
/// middle.
struct BallPath {
    double radius;
    SurfacePatch patch;
    SpecularChain chain;
    ChainPosition position;
};

BallPath ball_path(double scale, double patch_size, double alpha) {
    BallPath path;
    path.radius = 0.5 * scale;
    std::array<Vec3d, 3> positions, normals;
    for (size_t k = 0; k < 3; ++k) {
        const double angle = 2.0943951 * static_cast<double>(k);
        normals[k] = glm::normalize(Vec3d(patch_size * std::cos(angle), patch_size * std::sin(angle), 1.0));
        positions[k] = path.radius * normals[k];
    }
    path.patch = make_surface_patch(positions, normals);
    path.chain.length = 1;
    path.chain.vertices[0].alpha = alpha;
    path.position[0] = triangle_centre;
    const Vec3d y = evaluate(path.patch, triangle_centre).position;
    path.chain.receiver = y + scale * Vec3d(1.0, 0.0, 1.2);
    path.chain.light = {y + 2.0 * scale * Vec3d(-1.0, 0.0, 1.2), false};
    return path;
}

/// The chain points into the path, which must stay where it is.
ChainEvaluation evaluate_path(BallPath& path) {
    path.chain.vertices[0].patch = &path.patch;
    return evaluate(path.chain, path.position);
}

}  // namespace

TEST_CASE("cached lobes are gathered as they were set") {
    constexpr size_t fields = sizeof(CachedSlopeLobe<float>) / sizeof(float), size = 20;
    LineArray<CachedSlopeLobe> lobes(size);
    const auto value_of = [](size_t lobe, size_t field) { return static_cast<float>(100 * lobe + field); };
    for (size_t i = 0; i < size; ++i) {
        std::array<float, fields> values;
        for (size_t f = 0; f < fields; ++f) values[f] = value_of(i, f);
        lobes.set(i, std::bit_cast<CachedSlopeLobe<float>>(values));
    }
    std::array<uint32_t, simd_width> index;
    for (size_t lane = 0; lane < simd_width; ++lane) index[lane] = static_cast<uint32_t>((lane * 7 + 2) % size);
    for (const size_t count : {size_t{1}, simd_width - 1, simd_width, simd_width + 1}) {
        std::array<uint32_t, simd_width> read = index;
        for (size_t lane = count; lane < simd_width; ++lane) read[lane] = ~0U;  // Not to be followed.
        const auto values = std::bit_cast<std::array<FloatV, fields>>(lobes.gather(read.data(), count));
        for (size_t f = 0; f < fields; ++f) {
            for (size_t lane = 0; lane < simd_width; ++lane) {
                CHECK(static_cast<float>(values[f][lane]) == value_of(index[lane < count ? lane : 0], f));
            }
        }
    }
}

TEST_CASE("samples of a slope lobe match its density, from pin-holes to the hemisphere (chi-square)") {
    const Vec3 axis = glm::normalize(Vec3(0.3F, -0.5F, 0.8F));
    for (const float width : {1e-4F, 1e-3F, 0.03F, 1.0F}) {
        for (const float anisotropy : {1.0F, 20.0F}) {
            // Wider ones have their light at the gnomonic plane's horizon, within one bin.
            if (width * anisotropy > 1.0F) continue;
            const SlopeLobe<float> lobe = lobe_about(axis, width, width * anisotropy, 0.7F);
            const double scale = double{lobe.determinant()} * double{inv_pi};
            const auto result = testing::chi_square_directions(
                [&](Vec2 u, float choice) -> testing::DirectionDraw {
                    return {sample_slope_lobe(lobe, choice, u.x, u.y), true};
                },
                [&](const Vec3& d) { return scale * double{relative_density(lobe, to_triple(d))}; }, axis,
                0.03 * double{width});
            INFO("width ", width, " anisotropy ", anisotropy, ": ", result.worst_bin, ", integral ", result.integral);
            CHECK(result.p_value > 1e-4);
        }
    }
}

TEST_CASE("lobes of any shape are either unusable or sampled with their density") {
    Random random(12);
    int usable = 0;
    for (int i = 0; i < 300; ++i) {
        const Vec3 axis(random.direction());
        const auto width = static_cast<float>(std::pow(10.0, random(-4.0, 0.0)));
        const auto anisotropy = static_cast<float>(std::pow(10.0, random(0.0, 12.0)));
        SlopeLobe<float> lobe = lobe_about(axis, width, width * anisotropy, static_cast<float>(random(0.0, 6.0)));
        // Shear as well: rows that are nearly parallel.
        if (i % 3 == 0) lobe.row2 = lobe.row2 + lobe.row1 * static_cast<float>(random(-1.0, 1.0));
        if (!is_usable(lobe)) continue;
        ++usable;
        // The mean of uniform / (half uniform + half the lobe) over samples of that mixture is one.
        const double uniform = 0.25 * double{inv_pi}, scale = double{lobe.determinant()} * double{inv_pi};
        double sum = 0.0;
        constexpr int samples = 20000;
        for (int k = 0; k < samples; ++k) {
            const auto u = static_cast<float>(random(0.0, 1.0)), v = static_cast<float>(random(0.0, 1.0));
            const Vec3 w = k % 2 == 0 ? Vec3(random.direction())
                                      : sample_slope_lobe(lobe, static_cast<float>(random(0.0, 1.0)), u, v);
            sum += uniform / (0.5 * uniform + 0.5 * scale * double{relative_density(lobe, to_triple(w))});
        }
        INFO("width ", width, ", anisotropy ", anisotropy);
        CHECK(sum / samples == doctest::Approx(1.0).epsilon(0.04));
    }
    CHECK(usable > 50);
}

TEST_CASE("the density times the sampling map's Jacobian is one") {
    Random random(2);
    for (int i = 0; i < 200; ++i) {
        const Vec3 axis(random.direction());
        const auto width = static_cast<float>(std::pow(10.0, random(-2.0, -0.3)));
        const SlopeLobe<float> lobe =
            lobe_about(axis, width, width * static_cast<float>(random(1.0, 5.0)), static_cast<float>(random(0.0, 6.0)));
        const Vec2 m(static_cast<float>(random(-2.0, 2.0)), static_cast<float>(random(-2.0, 2.0)));
        // d omega / dm by differences; the density over m is that of slopes.
        const float step = 1e-2F;
        const Vec3 a = direction_at_slope(lobe, m + Vec2(step, 0.0F)) - direction_at_slope(lobe, m - Vec2(step, 0.0F));
        const Vec3 b = direction_at_slope(lobe, m + Vec2(0.0F, step)) - direction_at_slope(lobe, m - Vec2(0.0F, step));
        const double area = double{glm::length(glm::cross(a, b))} / (4.0 * double{step} * double{step});
        const double squared = double{glm::dot(m, m)};
        const double per_slope =
            0.85 / std::pow(1.0 + squared, 2.0) + 0.15 / 25.0 / std::pow(1.0 + squared / 25.0, 2.0);
        const double density =
            double{lobe.determinant()} * double{relative_density(lobe, to_triple(direction_at_slope(lobe, m)))};
        CHECK(density * area == doctest::Approx(per_slope).epsilon(2e-2));
    }
}

TEST_CASE("slope and Jacobian of a cached lobe are those of the solver's constraint") {
    Random random(3);
    for (int i = 0; i < 500; ++i) {
        std::array<Vec3d, 3> positions, normals;
        const Vec3d n = random.direction();
        for (size_t k = 0; k < 3; ++k) {
            positions[k] = 0.3 * random.direction();
            normals[k] = glm::normalize(n + 0.2 * random.direction());
        }
        const SurfacePatch patch = make_surface_patch(positions, normals);
        if (patch.degenerate) continue;
        SpecularChain chain;
        chain.length = 1;
        chain.vertices[0].patch = &patch;
        chain.vertices[0].alpha = 0.01;
        chain.receiver = 2.0 * n + random.direction();
        chain.light = i % 3 == 0 ? PathEnd{glm::normalize(n + 0.5 * random.direction()), true}
                                 : PathEnd{3.0 * n + random.direction(), false};
        const ChainEvaluation evaluation = evaluate(chain, {triangle_centre});
        if (!evaluation.valid) continue;
        const std::array<double, 1> widths{0.01};
        const LinearisedPath linear = linearise(chain, evaluation, widths, 1.0);
        const CachedSlopeLobe<float> lobe = make_cached_lobe(chain, evaluation, linear, widths[0]);
        const Triple<float> x = to_triple(Vec3(chain.receiver));
        const SlopeAtPoint<float> at = slope_at(lobe, x, lobe.y, lobe.normal, lobe.tangent);
        const SlopeJacobian<float> j = slope_jacobian(lobe, at);
        const SlopeConstraint& exact = evaluation.constraints[0];
        CHECK(double{at.half.slope.c1} == doctest::Approx(exact.slope.x).epsilon(1e-4));
        CHECK(double{at.half.slope.c2} == doctest::Approx(exact.slope.y).epsilon(1e-4));
        const double size = std::sqrt(glm::dot(exact.by_vertex[0], exact.by_vertex[0]) +
                                      glm::dot(exact.by_vertex[1], exact.by_vertex[1]));
        CHECK(std::abs(double{j.j11} - exact.by_vertex[0].x) < 1e-4 * size);
        CHECK(std::abs(double{j.j21} - exact.by_vertex[0].y) < 1e-4 * size);
        CHECK(std::abs(double{j.j12} - exact.by_vertex[1].x) < 1e-4 * size);
        CHECK(std::abs(double{j.j22} - exact.by_vertex[1].y) < 1e-4 * size);
    }
}

TEST_CASE("a lobe's footprint is where slopes reach its width, at every scale and roughness") {
    for (const double scale : {1e-4, 1.0, 1e5}) {
        for (const double alpha : {1e-4, 1e-2, 0.2, 1.0}) {
            BallPath path = ball_path(scale, 0.01, alpha);
            const ChainEvaluation evaluation = evaluate_path(path);
            REQUIRE(evaluation.valid);
            const std::array<double, 1> widths{alpha};
            const LinearisedPath linear = linearise(path.chain, evaluation, widths, 1e3 * scale);
            const glm::dmat2& j = evaluation.constraints[0].by_vertex;
            for (size_t k = 0; k < 2; ++k) {
                const Vec2d reached = j * (linear.footprint.extent[k] * linear.footprint.direction[k]);
                CHECK(glm::length(reached) == doctest::Approx(alpha).epsilon(1e-3));
            }
            const double area = linear.footprint.extent[0] * linear.footprint.extent[1];
            CHECK(linear.density == doctest::Approx(double{inv_pi} / area).epsilon(1e-3));
        }
    }
}

TEST_CASE("a singular Jacobian leaves a lobe of the largest extent, finite in every number") {
    // Receiver and light at the centre of a mirror's curvature: all of the mirror reflects the light there.
    std::array<Vec3d, 3> positions, normals;
    for (size_t k = 0; k < 3; ++k) {
        const double angle = 2.0943951 * static_cast<double>(k);
        const Vec3d out = glm::normalize(Vec3d(0.1 * std::cos(angle), 0.1 * std::sin(angle), -1.0));
        positions[k] = out;
        normals[k] = -out;
    }
    const SurfacePatch patch = make_surface_patch(positions, normals);
    SpecularChain chain;
    chain.length = 1;
    chain.vertices[0].patch = &patch;
    chain.vertices[0].alpha = 0.005;
    chain.receiver = Vec3d(1e-9, 0.0, 0.0);
    chain.light = {Vec3d(-1e-9, 0.0, 0.0), false};
    const ChainEvaluation evaluation = evaluate(chain, {triangle_centre});
    REQUIRE(evaluation.valid);
    const std::array<double, 1> widths{0.005};
    const LinearisedPath linear = linearise(chain, evaluation, widths, 0.2);
    for (const double extent : linear.footprint.extent) {
        CHECK(extent <= 0.2000001);
        CHECK(extent > 0.02);
    }
    const CachedSlopeLobe<float> lobe = make_cached_lobe(chain, evaluation, linear, widths[0]);
    for (const Vec3 x : {Vec3(0.0F), Vec3(0.05F, 0.0F, 0.02F), Vec3(0.0F, -0.3F, 0.1F)}) {
        const SlopeLobe<float> moved = warped(lobe, to_triple(x), to_triple(Vec3(0.0F)), SlopeWarp::newton);
        CHECK(std::isfinite(moved.determinant()));
        CHECK(moved.determinant() > 0.0F);
        CHECK(dot(moved.axis, moved.axis) == doctest::Approx(1.0F).epsilon(1e-5));
    }
}

TEST_CASE("warps follow the specular point of a ball") {
    // Exact: the point of the ball where the mirror reflects the light to x, by bisection in the plane of all three.
    BallPath path = ball_path(1.0, 0.01, 0.005);
    const ChainEvaluation evaluation = evaluate_path(path);
    const std::array<double, 1> widths{0.005};
    const CachedSlopeLobe<float> lobe =
        make_cached_lobe(path.chain, evaluation, linearise(path.chain, evaluation, widths, 10.0), widths[0]);
    const Vec3 cached(path.chain.receiver);
    const auto specular_direction = [&](const Vec3d& x) {
        double low = -0.5, high = 0.5;  // Angles from the z axis towards x.
        for (int i = 0; i < 60; ++i) {
            const double angle = 0.5 * (low + high);
            const Vec3d n(std::sin(angle), 0.0, std::cos(angle));
            const Vec3d y = path.radius * n;
            const Vec3d h = glm::normalize(x - y) + glm::normalize(path.chain.light.point - y);
            (h.x * n.z - h.z * n.x > 0.0 ? low : high) = angle;
        }
        const Vec3d y = path.radius * Vec3d(std::sin(low), 0.0, std::cos(low));
        return glm::normalize(y - x);
    };
    struct Expectation {
        double distance, none, implicit, newton;
    };
    // Errors of the direction relative to the lobe's own width of about 0.002: Newton's stay far below it.
    for (const Expectation& e : {Expectation{0.01, 0.1, 1e-4, 2e-5}, {0.1, 0.1, 1e-2, 1e-3}}) {
        const Vec3d x = path.chain.receiver + Vec3d(e.distance, 0.0, 0.3 * e.distance);
        const Vec3d exact = specular_direction(x);
        const auto error = [&](SlopeWarp warp) {
            const SlopeLobe<float> moved = warped(lobe, to_triple(Vec3(x)), to_triple(cached), warp);
            return glm::length(Vec3d(to_vec3(moved.axis)) - exact);
        };
        INFO("distance ", e.distance, ": none ", error(SlopeWarp::none), ", implicit ", error(SlopeWarp::implicit),
             ", newton ", error(SlopeWarp::newton));
        CHECK(error(SlopeWarp::none) < e.none);
        CHECK(error(SlopeWarp::implicit) < e.implicit);
        CHECK(error(SlopeWarp::newton) < e.newton);
        CHECK(error(SlopeWarp::newton) < error(SlopeWarp::none));
    }
}

TEST_CASE("warped lobes are finite or unusable, never NaN with weight, for arbitrary input") {
    Random random(9);
    for (int i = 0; i < 20000; ++i) {
        const double scale = std::pow(10.0, random(-4.0, 5.0));
        CachedSlopeLobe<float> lobe{};
        const auto triple = [&](double size) { return to_triple(Vec3(size * random.direction())); };
        lobe.y = triple(scale);
        lobe.e1 = triple(1.0);
        lobe.e2 = to_triple(glm::normalize(glm::cross(to_vec3(lobe.e1), Vec3(random.direction()))));
        lobe.normal = to_triple(glm::cross(to_vec3(lobe.e1), to_vec3(lobe.e2)));
        lobe.tangent = lobe.e1;
        lobe.dn1 = triple(random(0.0, 10.0) / scale);
        lobe.dn2 = triple(random(0.0, 10.0) / scale);
        lobe.light = i % 5 == 0 ? lobe.y : triple(scale);
        lobe.j11 = lobe.j22 = static_cast<float>(std::pow(10.0, random(0.0, 5.0)) / scale);
        lobe.squared_floor = i % 3 == 0 ? 0.0F : lobe.j11 * lobe.j11 * 1e-6F;
        lobe.reach = static_cast<float>(scale);
        lobe.is_single = 1.0F;
        const Triple<float> x = i % 7 == 0 ? lobe.y : triple(scale);
        const SlopeLobe<float> moved = warped(lobe, x, triple(scale), SlopeWarp::newton);
        const float determinant = moved.determinant();
        if (!is_usable(moved)) continue;
        const float density = determinant * relative_density(moved, moved.axis);
        CHECK(std::isfinite(density));
        CHECK(density > 0.0F);
    }
}

TEST_CASE("the mixture as used at real shading points: directions of guide and BSDF together (chi-square)") {
    for (const bool slope : {true, false}) {
        for (const float alpha : {0.005F, 0.05F}) {
            const testing::CausticScene caustic = testing::sphere_caustic(alpha);
            testing::PreparedScene prepared(caustic.scene, caustic.camera, 32, 32);
            GuidedSettings settings = slope ? GuidedSettings() : paper_settings();
            settings.cached_points = 500;
            settings.bounces = 1;
            const GuidedIntegrator integrator(prepared.context, find_casters(caustic.scene), {32, 32, {0, 0, 32, 32}},
                                              settings);
            const std::unique_ptr<GuideWorker> worker = integrator.guide()->make_worker();
            const Vec3 x = caustic.floor_points[0], normal(0.0F, 1.0F, 0.0F);
            VertexWave vertices(1);
            TripleArray light(1);
            vertices.position.set(0, x);
            vertices.geometric_normal.set(0, normal);
            vertices.shading_normal.set(0, normal);
            vertices.wo.set(0, normal);
            vertices.alpha[0] = 1.0F;
            GuideBatch batch(1);
            batch.count = 1;
            const auto ask = [&](const Vec3& direction, float u_choice, Vec2 u) {
                batch.fraction[0] = 1.0F;
                batch.direction.set(0, direction);
                batch.u_choice[0] = u_choice;
                batch.u[0] = u.x;
                batch.v[0] = u.y;
                worker->guide(guide_points(vertices, vertices.wo, light), batch);
            };
            const auto facts = integrator.facts_at(x, normal);
            REQUIRE(facts);
            REQUIRE(facts->lobe_count > 0);
            const auto result = testing::chi_square_directions(
                [&](Vec2 u, float choice) -> testing::DirectionDraw {
                    const Frame<float> frame = make_frame(to_triple(normal));
                    ask(to_vec3(frame.to_world(square_to_cosine_hemisphere(u.x, u.y))), choice, u);
                    return {batch.direction.get(0), true};
                },
                [&](const Vec3& d) {
                    ask(d, 0.999999F, Vec2(0.5F));
                    const double cosine = std::max(double{glm::dot(normal, d)}, 0.0) * double{inv_pi};
                    return (1.0 - double{batch.fraction[0]}) * cosine +
                           double{batch.fraction[0]} * double{batch.pdf[0]};
                },
                facts->heaviest.axis, 0.05 * double{facts->heaviest.width});
            INFO(std::string(slope ? "slope" : "sg"), " alpha ", alpha, ": ", result.worst_bin, ", integral ",
                 result.integral);
            CHECK(result.p_value > 1e-4);
        }
    }
}

TEST_CASE("densities that were left out at first are the same later") {
    const testing::CausticScene caustic = testing::sphere_caustic(0.02F);
    testing::PreparedScene prepared(caustic.scene, caustic.camera, 32, 32);
    GuidedSettings settings;
    settings.cached_points = 500;
    settings.bounces = 1;
    const GuidedIntegrator integrator(prepared.context, find_casters(caustic.scene), {32, 32, {0, 0, 32, 32}},
                                      settings);
    REQUIRE(integrator.guide()->is_for_casters());
    const std::unique_ptr<GuideWorker> worker = integrator.guide()->make_worker();
    constexpr size_t count = 300;
    VertexWave vertices(count);
    GuideBatch at_once(count), later(count);
    Random random(9);
    const Vec3 up(0.0F, 1.0F, 0.0F);
    for (size_t k = 0; k < count; ++k) {
        const Vec3 x = caustic.floor_points[k % 2];
        vertices.position.set(k, x + Vec3(random(-0.2, 0.2), 0.0, random(-0.2, 0.2)));
        for (TripleArray* direction : {&vertices.geometric_normal, &vertices.shading_normal, &vertices.wo}) {
            direction->set(k, up);
        }
        vertices.base.set(k, Vec3(0.6F));
        // Some glossy: there the lobes have a say in how often they are asked.
        vertices.alpha[k] = k % 5 == 0 ? 0.05F : 1.0F;
        vertices.coat_f0.set(k, Vec3(0.04F));
        vertices.coat_f90[k] = k % 5 == 0 ? 1.0F : 0.0F;
        Vec3d direction = random.direction();
        direction.y = std::abs(direction.y);
        const auto choice = static_cast<float>(random(0.0, 1.0)), u = static_cast<float>(random(0.0, 1.0));
        for (GuideBatch* batch : {&at_once, &later}) {
            batch->count = count;
            batch->fraction[k] = k % 7 == 0 ? 0.0F : 1.0F;
            batch->u_choice[k] = choice;
            batch->u[k] = batch->v[k] = u;
            batch->direction.set(k, Vec3(direction));
        }
        later.density_wanted[k] = 0.0F;
    }
    const GuidePoints points = guide_points(vertices, vertices.wo, vertices.wo);
    worker->guide(points, at_once);
    worker->guide(points, later);
    std::vector<uint32_t> left_out;
    for (size_t k = 0; k < count; ++k) {
        if (later.fraction[k] > 0.0F && later.pdf[k] == 0.0F) left_out.push_back(static_cast<uint32_t>(k));
    }
    CHECK(left_out.size() > count / 10);
    CHECK(left_out.size() < count / 2);
    worker->find_densities(points, left_out, later);
    for (size_t k = 0; k < count; ++k) {
        CHECK(later.fraction[k] == at_once.fraction[k]);
        if (at_once.fraction[k] == 0.0F) continue;
        CHECK(later.guided[k] == at_once.guided[k]);
        CHECK(later.place[k] == at_once.place[k]);
        CHECK(later.direction.get(k) == at_once.direction.get(k));
        CHECK(later.pdf[k] == doctest::Approx(at_once.pdf[k]).epsilon(1e-5));
    }
}

// Found on the Ring's floor, where a lobe leads to the rim: one of 48 samples was 14,000 W/(m^2 sr) instead of .18.
TEST_CASE("narrow lobes with nearly parallel rows are sampled where their density is") {
    const SlopeLobe<float> raw{
        {-0.742927F, 0.410868F, 0.528438F}, {-694742.0F, -784763.0F, -366568.0F}, {1.56857e6F, 1.7608e6F, 836196.0F}};
    const auto across = [&](const Triple<float>& row) { return row - raw.axis * dot(row, raw.axis); };
    const SlopeLobe<float> parallel{raw.axis, across(raw.row1), across(raw.row2)};
    const SlopeLobe<float> lobe = with_orthogonal_rows(parallel);
    CHECK(lobe.determinant() == doctest::Approx(parallel.determinant()).epsilon(0.01));
    CHECK(std::abs(dot(lobe.row1, lobe.row2)) <
          1e-3F * std::sqrt(dot(lobe.row1, lobe.row1) * dot(lobe.row2, lobe.row2)));
    // Rounding of a direction is a tenth of this lobe's width, and of the parallel rows' centre dozens.
    for (int i = 0; i < 400; ++i) {
        const float radius = 0.01F * static_cast<float>(i), turn = 2.4F * static_cast<float>(i);
        const Vec3 w = direction_at_slope(lobe, {radius * std::cos(turn), radius * std::sin(turn)});
        const float squared = radius * radius;
        const float expected =
            (1.0F - wide_share) * slope_profile(squared) + wide_share / 25.0F * slope_profile(squared / 25.0F);
        const float ratio = relative_density(lobe, to_triple(w)) / expected;
        CHECK(ratio > 0.4F);
        CHECK(ratio < 2.5F);
    }
}

TEST_CASE("orthogonal rows: the same density, also of orthogonal, parallel and missing ones") {
    std::mt19937 generator(5);
    std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
    const auto random = [&](float scale) {
        return Triple<float>{scale * uniform(generator), scale * uniform(generator), 0.0F};
    };
    const Triple<float> axis{0.0F, 0.0F, 1.0F};
    for (int i = 0; i < 200; ++i) {
        const SlopeLobe<float> lobe{axis, random(100.0F), random(i % 2 == 0 ? 100.0F : 3.0F)};
        const SlopeLobe<float> same = with_orthogonal_rows(lobe);
        const Vec3 w = glm::normalize(Vec3(0.02F * uniform(generator), 0.02F * uniform(generator), 1.0F));
        CHECK(relative_density(same, to_triple(w)) ==
              doctest::Approx(relative_density(lobe, to_triple(w))).epsilon(1e-3));
        CHECK(std::abs(dot(same.row1, same.row2)) < 1e-2F);
    }
    const Triple<float> x{10.0F, 0.0F, 0.0F}, y{0.0F, 10.0F, 0.0F}, none{0.0F, 0.0F, 0.0F};
    for (const auto& [row1, row2] : {std::pair(x, y), std::pair(x, x), std::pair(x, none), std::pair(none, none)}) {
        const SlopeLobe<float> lobe = with_orthogonal_rows<float>({axis, row1, row2});
        CHECK(std::isfinite(lobe.row1.x + lobe.row1.y + lobe.row2.x + lobe.row2.y));
        CHECK(dot(lobe.row1, lobe.row1) + dot(lobe.row2, lobe.row2) ==
              doctest::Approx(dot(row1, row1) + dot(row2, row2)));
    }
}

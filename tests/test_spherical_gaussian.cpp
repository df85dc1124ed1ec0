// Spherical Gaussians and the paper's lobes: formulas at their extremes, against double precision and quadrature;
// samplers against densities.
#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "guiding/reflected_lobe.h"
#include "guiding/sg_mixture.h"
#include "guiding/sg_path.h"
#include "tests/statistics.h"

using namespace nephroid;

namespace {

constexpr double pi_double = 3.14159265358979323846;
constexpr double sharpnesses[] = {1e-3, 0.1, 1.0, 10.0, 1e3, 1e5, 1e7, 1e8, 1e9};

Triple<double> spherical(double theta, double phi) {
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

Triple<float> to_float(const Triple<double>& v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

Triple<double> random_direction(std::mt19937& generator) {
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    return spherical(std::acos(1.0 - 2.0 * uniform(generator)), 2.0 * pi_double * uniform(generator));
}

double angle_between(const Triple<double>& a, const Triple<double>& b) {
    const Triple<double> c = cross(a, b);
    return std::atan2(std::sqrt(dot(c, c)), dot(a, b));
}

/// Integral over the sphere of a function of the angles to `axis`: theta grows geometrically from far inside of the
/// lobe, so that every width is resolved.
double integrate(const Triple<double>& axis, double smallest, const std::function<double(const Triple<double>&)>& f) {
    const Frame<double> frame = make_frame(axis);
    constexpr int rings = 3000, sectors = 64;
    const double step = std::log(pi_double / smallest) / rings;
    double sum = 0.0;
    for (int i = -1; i < rings; ++i) {
        const double low = i < 0 ? 0.0 : smallest * std::exp(i * step), high = smallest * std::exp((i + 1) * step);
        const double theta = 0.5 * (low + high);
        const double solid_angle = 2.0 * pi_double * 2.0 * std::sin(0.5 * (low + high)) * std::sin(0.5 * (high - low));
        for (int k = 0; k < sectors; ++k) {
            sum += f(frame.to_world(spherical(theta, 2.0 * pi_double * (k + 0.5) / sectors))) * solid_angle / sectors;
        }
    }
    return sum;
}

}  // namespace

TEST_CASE("a lobe in float is right to a thousandth where the formula of the paper loses everything") {
    std::mt19937 generator(1);
    for (const double sharpness : sharpnesses) {
        double worst = 0.0;
        for (int i = 0; i < 1000; ++i) {
            const Triple<double> axis = random_direction(generator);
            const Triple<float> float_axis = to_float(axis);
            // Up to three widths away.
            const double angle = std::min(3.0 * i / 1000.0 / std::sqrt(sharpness), 3.0);
            const Frame<double> frame = make_frame(axis);
            const Triple<float> v = to_float(frame.to_world(spherical(angle, 0.7)));
            // The float directions themselves are the truth: their rounding is not the formula's.
            const Triple<double> d{double{v.x} - double{float_axis.x}, double{v.y} - double{float_axis.y},
                                   double{v.z} - double{float_axis.z}};
            const double expected = std::exp(-0.5 * sharpness * dot(d, d));
            const SphericalGaussian<float> lobe{float_axis, static_cast<float>(sharpness), 1.0F};
            worst = std::max(worst, std::abs(double{evaluate(lobe, v)} / expected - 1.0));
        }
        INFO("sharpness ", sharpness, " worst ", worst);
        CHECK(worst < 1e-3);
    }
}

TEST_CASE("integrals agree with quadrature, in double and in float") {
    for (const double sharpness : sharpnesses) {
        const Triple<double> axis{0.6, 0.0, 0.8};
        const SphericalGaussian<double> lobe{axis, sharpness, 2.0};
        const double expected = integrate(axis, 1e-3 / std::sqrt(std::max(sharpness, 1.0)),
                                          [&](const auto& v) { return evaluate(lobe, v); });
        INFO("sharpness ", sharpness);
        CHECK(integral(lobe) == doctest::Approx(expected).epsilon(1e-3));
        CHECK(double{unit_integral(static_cast<float>(sharpness))} ==
              doctest::Approx(unit_integral(sharpness)).epsilon(1e-6));
    }
    CHECK(unit_integral(0.0) == doctest::Approx(4.0 * pi_double));
}

TEST_CASE("the product of two lobes is their product, point by point") {
    std::mt19937 generator(2);
    for (const double a_sharpness : {1e-3, 1.0, 1e4, 1e9}) {
        for (const double b_sharpness : {1e-3, 3.0, 1e6}) {
            for (int i = 0; i < 50; ++i) {
                const Triple<double> a_axis = random_direction(generator);
                // Close enough that the product is not zero everywhere.
                const Triple<double> b_axis =
                    make_frame(a_axis).to_world(spherical(2.0 / std::sqrt(std::max(a_sharpness, b_sharpness)), 0.4));
                const SphericalGaussian<double> a{a_axis, a_sharpness, 1.5}, b{b_axis, b_sharpness, 0.5};
                const SphericalGaussian<double> c = product(a, b);
                const Triple<double> v =
                    make_frame(c.axis).to_world(spherical(1.0 / std::sqrt(std::max(c.sharpness, 1.0)), 1.0));
                CHECK(evaluate(c, v) == doctest::Approx(evaluate(a, v) * evaluate(b, v)).epsilon(1e-6));
            }
        }
    }
    const Triple<double> up{0.0, 0.0, 1.0};
    const SphericalGaussian<double> flat = product<double>({up, 2.0, 1.0}, {-up, 2.0, 1.0});
    CHECK(flat.sharpness == 0.0);
    CHECK(evaluate(flat, up) == doctest::Approx(std::exp(-4.0)));
}

TEST_CASE("samples of a lobe match its density (chi-square)") {
    for (const double sharpness : sharpnesses) {
        const Triple<float> axis{0.0F, 0.6F, -0.8F};
        const auto s = static_cast<float>(sharpness);
        const auto result = testing::chi_square_directions(
            [&](Vec2 u, float) -> testing::DirectionDraw {
                return {to_vec3(sample_spherical_gaussian(axis, s, u.x, u.y)), true};
            },
            [&](const Vec3& d) {
                return double{evaluate(SphericalGaussian<float>{axis, s, 1.0F / unit_integral(s)}, to_triple(d))};
            },
            to_vec3(axis), 0.03 / std::sqrt(std::max(sharpness, 1.0)));
        INFO("sharpness ", sharpness, " ", result.worst_bin);
        CHECK(result.p_value > 1e-4);
    }
}

TEST_CASE("Eq. 5: the reflected lobe is the integral of light and BRDF slice") {
    // Both as spherical Gaussians: what Eq. 5 approximates is their product's integral along the mirror direction.
    const Triple<double> n{0.0, 0.0, 1.0};
    for (const double alpha : {1e-3, 0.01, 0.1}) {
        for (const double theta : {0.0, 0.5, 1.2}) {
            for (const double light_angle : {0.0, 0.3 * alpha, 3.0 * alpha}) {
                const Triple<double> wi = spherical(theta, 0.3);
                const Triple<double> wo = reflected(wi, n);
                BsdfParameters<float> bsdf{{0.8F, 0.8F, 0.8F}, {0.0F, 0.0F, 0.0F}, 0.0F, 1.0F, 0.0F};
                bsdf.alpha = static_cast<float>(alpha);
                const SphericalGaussian<double> light = light_lobe(wi, light_angle, 2.0);
                const SphericalGaussian<double> lobe = reflected_lobe(light, bsdf, n, wo);
                CHECK(angle_between(lobe.axis, wo) < 1e-9);
                const SphericalGaussian<double> slice{wi, slice_sharpness(double{bsdf.alpha}, wo.z), 1.0};
                const double width = 1.0 / std::sqrt(std::max(light.sharpness, slice.sharpness));
                const double overlap =
                    integrate(wi, 1e-3 * width, [&](const auto& v) { return evaluate(light, v) * evaluate(slice, v); });
                const BsdfEvaluation<float> peak = evaluate_bsdf(bsdf, to_float(wo), to_float(wi));
                INFO("alpha ", alpha, " theta ", theta, " light ", light_angle);
                CHECK(lobe.amplitude == doctest::Approx(overlap * double{peak.value.x}).epsilon(5e-3));
                CHECK(lobe.sharpness <= slice.sharpness);
            }
        }
    }
}

TEST_CASE("a lobe's weight is the light that a flat mirror brings") {
    // A glossy flat mirror of alpha -> 0 shows the light's image: irradiance intensity / distance^2 along the path,
    // whatever the lobe's width.
    for (const double alpha : {1e-4, 1e-3, 0.01}) {
        GlossyVertex vertex;
        vertex.position = Vec3d(0.0);
        vertex.surface = flat_at(Vec3d(0.0, 0.0, 1.0));
        vertex.bsdf = {{1.0F, 1.0F, 1.0F}, {0.0F, 0.0F, 0.0F}, 0.0F, 1.0F, static_cast<float>(alpha)};
        const Vec3d x(1.0, 0.0, 1.0);
        PathEmitter light{{Vec3d(-2.0, 0.0, 2.0), false}, 0.0, 10.0 / 8.0};
        const SgLobe lobe = make_sg_lobe(x, {&vertex, 1}, light);
        // Radiance times solid angle: the light's irradiance at the mirror, spread over the lobe (Eq. 5 keeps the
        // light's energy per unit of reflector, not the wave front's divergence).
        CHECK(double{lobe.weight} == doctest::Approx(10.0 / 8.0).epsilon(0.02));
        // The image is the light mirrored, seen from anywhere.
        for (const Vec3 p : {Vec3(1.0F, 0.0F, 1.0F), Vec3(0.3F, 0.8F, 2.0F), Vec3(-1.0F, 0.5F, 0.1F)}) {
            const Vec3 to_image = glm::normalize(Vec3(-2.0F, 0.0F, -2.0F) - p);
            CHECK(glm::length(mirror_axis(lobe, p) - to_image) < 1e-5F);
        }
    }
}

TEST_CASE("images in spherical mirrors: on the axis 1/d_v = 1/f - 1/d_r, at infinity and in the focus too") {
    const Vec3d y(1.0, 2.0, 3.0), normal(0.0, 0.0, 1.0), tangent(1.0, 0.0, 0.0);
    for (const double radius : {-2.0, -0.5, 0.5, 2.0, 1e9}) {
        for (const double distance : {0.1, 1.0, 100.0}) {
            const PrincipalImage image =
                principal_image({y + distance * normal, 1.0}, y, normal, tangent, 1.0 / radius);
            CHECK(image.inverse_distance == doctest::Approx(2.0 / radius - 1.0 / distance));
            CHECK(image.slope == doctest::Approx(0.0));
        }
        // Parallel light meets in the focus.
        CHECK(principal_image({normal, 0.0}, y, normal, tangent, 1.0 / radius).inverse_distance ==
              doctest::Approx(2.0 / radius));
    }
    // A light in the focus of a concave mirror of radius 2: parallel light, and its image as an emitter at infinity.
    PrincipalCurvatures surface = flat_at(normal);
    surface.curvature = {0.5, 0.5};
    const Emitter image = spherical_image({y + normal, 1.0}, y, surface);
    CHECK(std::abs(image.weight) < 1e-12);
    CHECK(glm::length(glm::normalize(image.point) - normal) < 1e-12);
}

TEST_CASE("warping a lobe is finite everywhere, on the caustic and behind the mirror too") {
    std::mt19937 generator(5);
    std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
    for (int i = 0; i < 20000; ++i) {
        const float scale = std::pow(10.0F, 5.0F * uniform(generator));
        SgLobe lobe;
        lobe.reflector = scale * Vec3(uniform(generator), uniform(generator), uniform(generator));
        lobe.image_inverse_distance = Vec2(uniform(generator), uniform(generator)) / scale;
        lobe.image_slope = Vec2(uniform(generator), uniform(generator));
        Vec3 x = scale * Vec3(uniform(generator), uniform(generator), uniform(generator));
        if (i % 4 == 0) {  // On the caustic in the first principal direction.
            x = lobe.reflector + lobe.normal / lobe.image_inverse_distance.x;
        }
        if (i % 7 == 0) lobe.image_slope.x = INFINITY;
        if (i % 11 == 0) lobe.image_inverse_distance.y = NAN;
        const Vec3 axis = mirror_axis(lobe, x);
        CHECK(glm::length(axis) == doctest::Approx(1.0F).epsilon(1e-5));
    }
}

TEST_CASE("a mixture's samples match its density (chi-square)") {
    std::mt19937 generator(3);
    std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
    for (const size_t count : {size_t{1}, size_t{3}, size_t{40}}) {
        for (const float sharpness : {20.0F, 300.0F, 1e7F}) {
            if (count > 1 && sharpness > 1e5F) continue;  // The bins resolve narrow lobes about one axis only.
            std::vector<SgLobe> lobes(count);
            for (SgLobe& lobe : lobes) {
                const auto d = to_float(random_direction(generator));
                lobe.reflector = Vec3(d.x, d.y, std::abs(d.z)) * 2.0F;
                lobe.sharpness = sharpness * (0.5F + uniform(generator));
                lobe.weight = 1.0F / static_cast<float>(count);
                lobe.image_inverse_distance = Vec2(-0.3F, 0.2F);
            }
            const Vec3 normal(0.0F, 0.0F, 1.0F), x(0.01F, -0.02F, 0.0F);
            SgCache cache;
            cache.points.push_back({});
            cache.points[0].lobe_count = static_cast<uint32_t>(count);
            cache.points[0].fraction = 0.5F;
            cache.lobes = lobes;
            SgMixtures mixture(cache, SgMixtureOptions());
            const FoundPoint found{};
            mixture.add({&found, 1}, diffuse_guide_vertex(x, normal));
            CHECK(mixture.fraction(0) == 0.5F);
            const auto result = testing::chi_square_directions(
                [&](Vec2 u, float choice) -> testing::DirectionDraw {
                    return {mixture.sample(0, choice, u.x, u.y), true};
                },
                [&](const Vec3& d) { return double{mixture.pdf(0, d)}; }, mirror_axis(lobes[0], x),
                0.03 / std::sqrt(double{sharpness}));
            INFO("lobes ", count, " sharpness ", sharpness, " ", result.worst_bin);
            CHECK(result.p_value > 1e-4);
        }
    }
}

// Warps of the unit square, frames, and the sine and cosine they use.
#include <doctest/doctest.h>

#include <cmath>

#include "core/frame.h"
#include "core/warp.h"
#include "tests/statistics.h"

using namespace nephroid;

TEST_CASE("sincos_turn is accurate to 2e-7") {
    for (int i = 0; i < 100000; ++i) {
        const float u = static_cast<float>(i) / 100000.0F;
        float s, c;
        sincos_turn(u, s, c);
        CHECK(std::abs(s - std::sin(2.0 * M_PI * u)) < 2e-7);
        CHECK(std::abs(c - std::cos(2.0 * M_PI * u)) < 2e-7);
    }
}

TEST_CASE("warps match their densities (chi-square)") {
    const Vec3 z(0.0F, 0.0F, 1.0F);
    const auto cosine = testing::chi_square_directions(
        [](Vec2 u, float) -> testing::DirectionDraw {
            return {to_vec3(square_to_cosine_hemisphere(u.x, u.y)), true};
        },
        [](const Vec3& d) { return static_cast<double>(cosine_hemisphere_pdf(d.z)); }, z, 0.01);
    INFO(cosine.worst_bin);
    CHECK(cosine.p_value > 1e-4);
    const auto sphere = testing::chi_square_directions(
        [](Vec2 u, float) -> testing::DirectionDraw {
            return {to_vec3(square_to_uniform_sphere(u.x, u.y)), true};
        },
        [](const Vec3&) { return 0.25 / M_PI; }, z, 0.01);
    CHECK(sphere.p_value > 1e-4);
}

TEST_CASE("cones from a pin hole to the hemisphere are sampled uniformly") {
    for (const float one_minus_cos : {1e-9F, 1e-6F, 1e-3F, 0.5F, 1.0F}) {
        // In a uniform cone (1 - cos) / (1 - cos_max) is uniform: check its first two moments.
        double sum = 0.0, squares = 0.0;
        constexpr int n = 100000;
        for (uint32_t i = 0; i < n; ++i) {
            const Triple<float> d = square_to_uniform_cone((static_cast<float>(i) + 0.5F) / n, 0.3F, one_minus_cos);
            const double sin2 = double{d.x} * d.x + double{d.y} * d.y;
            const double x = sin2 / (1.0 + d.z) / one_minus_cos;
            sum += x / n;
            squares += x * x / n;
            CHECK(std::isfinite(d.x + d.y + d.z));
        }
        CHECK(sum == doctest::Approx(0.5).epsilon(1e-4));
        CHECK(squares == doctest::Approx(1.0 / 3.0).epsilon(1e-4));
    }
}

TEST_CASE("triangle points are uniform") {
    double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
    constexpr int n = 512;
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            const Vec2 b = square_to_triangle({(static_cast<float>(i) + 0.5F) / n, (static_cast<float>(j) + 0.5F) / n});
            CHECK((b.x >= 0.0F && b.y >= 0.0F && b.x + b.y <= 1.0F));
            x += b.x;
            y += b.y;
            xx += b.x * b.x;
            xy += b.x * b.y;
        }
    }
    const double m = double{n} * n;
    CHECK(x / m == doctest::Approx(1.0 / 3.0).epsilon(1e-3));
    CHECK(y / m == doctest::Approx(1.0 / 3.0).epsilon(1e-3));
    CHECK(xx / m == doctest::Approx(1.0 / 6.0).epsilon(1e-3));
    CHECK(xy / m == doctest::Approx(1.0 / 12.0).epsilon(1e-3));
}

TEST_CASE("frames are orthonormal, also at the poles") {
    for (const Vec3& n : {Vec3(0, 0, 1), Vec3(0, 0, -1), Vec3(1, 0, 0), Vec3(0.6F, 0.0F, -0.8F), Vec3(1e-20F, 0, -1)}) {
        const Frame<float> f = make_frame(to_triple(n));
        CHECK(dot(f.s, f.s) == doctest::Approx(1.0));
        CHECK(dot(f.t, f.t) == doctest::Approx(1.0));
        CHECK(std::abs(dot(f.s, f.t)) < 1e-6F);
        CHECK(std::abs(dot(f.s, f.n)) < 1e-6F);
        CHECK(std::abs(dot(f.t, f.n)) < 1e-6F);
    }
}

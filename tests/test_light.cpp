// Lights: sampling against density, selection, fall-off, emission seen from both strategies.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/delta_light.h"
#include "core/sampler.h"
#include "tests/statistics.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

EnvironmentMap make_environment(int width, int height) {
    EnvironmentMap map;
    map.image.width = width;
    map.image.height = height;
    map.image.channels = 3;
    map.image.storage = Image::Storage::float32;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const bool sun = x == width / 4 && y == height / 3;
            const float value = sun ? 500.0F : 0.2F + 0.1F * static_cast<float>((x * 7 + y * 3) % 5);
            for (int c = 0; c < 3; ++c) map.image.floats.push_back(value);
        }
    }
    return map;
}

}  // namespace

TEST_CASE("environment sampling matches its density (chi-square over the texels)") {
    constexpr int width = 32, height = 16, subdivisions = 8;
    const Environment environment(make_environment(width, height));
    std::vector<double> expected(width * height, 0.0), observed(width * height, 0.0);
    double integral = 0.0;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            for (int i = 0; i < subdivisions * subdivisions; ++i) {
                const double theta = M_PI * (y + (i / subdivisions + 0.5) / subdivisions) / height;
                const double phi = 2.0 * M_PI * ((x + (i % subdivisions + 0.5) / subdivisions) / width - 0.5);
                const Vec3 d(std::sin(theta) * std::sin(phi), std::cos(theta), -std::sin(theta) * std::cos(phi));
                const double solid_angle =
                    std::sin(theta) * 2.0 * M_PI * M_PI / (width * height * subdivisions * subdivisions);
                expected[static_cast<size_t>(y * width + x)] += static_cast<double>(environment.pdf(d)) * solid_angle;
            }
            integral += expected[static_cast<size_t>(y * width + x)];
        }
    }
    CHECK(integral == doctest::Approx(1.0).epsilon(1e-4));
    constexpr uint32_t n = 300000;
    for (uint32_t i = 0; i < n; ++i) {
        const auto [u, v] = sample_2d(SamplerKind::independent, 3U, i, 0);
        Environment::Evaluation sampled;
        const Vec3 d = environment.sample({u, v}, sampled);
        CHECK(sampled.pdf == doctest::Approx(environment.pdf(d)).epsilon(1e-3));
        CHECK(sampled.radiance.g == doctest::Approx(environment.radiance(d).g).epsilon(1e-2));
        const double x = (0.5 + std::atan2(d.x, -d.z) / (2.0 * M_PI)) * width;
        const double y = std::acos(std::clamp(d.y, -1.0F, 1.0F)) / M_PI * height;
        observed[static_cast<size_t>(std::min(static_cast<int>(y), height - 1) * width +
                                     std::min(static_cast<int>(x), width - 1))] += 1.0;
    }
    double chi2 = 0.0;
    for (size_t i = 0; i < expected.size(); ++i)
        chi2 += std::pow(observed[i] - n * expected[i], 2.0) / (n * expected[i]);
    CHECK(testing::chi_square_tail(chi2, width * height - 1) > 1e-4);
}

TEST_CASE("environment directions map to the documented texels") {
    EnvironmentMap map = make_environment(8, 4);
    map.image.floats.assign(8 * 4 * 3, 0.0F);
    const auto light_up = [&](int x, int y) {
        EnvironmentMap copy = map;
        for (size_t c = 0; c < 3; ++c) copy.image.floats[static_cast<size_t>(y * 8 + x) * 3 + c] = 1.0F;
        return Environment(copy);
    };
    // Column centres 3 and 4 straddle -Z; +X lies a quarter turn to the right of it.
    CHECK(light_up(3, 2).radiance(glm::normalize(Vec3(-0.2F, -0.5F, -1.0F))).r > 0.3F);
    CHECK(light_up(5, 2).radiance(glm::normalize(Vec3(1.0F, -0.5F, -0.6F))).r > 0.3F);
    CHECK(light_up(0, 0).radiance(Vec3(0, 1, 0)).r + light_up(7, 0).radiance(Vec3(0, 1, 0)).r > 0.0F);
    CHECK(light_up(3, 3).radiance(Vec3(0, 1, 0)).r == 0.0F);
}

TEST_CASE("sphere lights: density, shadow target and inverse square law at every size") {
    for (const float radius : {1e-4F, 0.01F, 0.5F, 1.9F}) {
        Scene scene;
        PunctualLight light = testing::point_light({0, 2, 0}, Rgb(3.0F));
        light.kind = LightKind::sphere;
        light.radius = radius;
        scene.lights.push_back(light);
        const LightSet lights(scene);
        double irradiance = 0.0;
        constexpr uint32_t n = 4096;
        for (uint32_t i = 0; i < n; ++i) {
            const auto [x, y] = sample_2d(SamplerKind::sobol, 1U, i, 0);
            const LightSample s = lights.sample(0.5F, {x, y}, Vec3(0.0F));
            REQUIRE(s.pdf > 0.0F);
            CHECK(s.pdf == doctest::Approx(lights.pdf_sphere(0, Vec3(0.0F))));
            CHECK(glm::length(s.target - light.position) >= radius);
            CHECK(glm::length(s.target - light.position) < radius + 0.1F * radius + 1e-4F);
            irradiance += static_cast<double>(s.radiance.r * s.wi.y / s.pdf) / n;
        }
        // A sphere of uniform radiance irradiates a facing plane like a point light of the same intensity.
        CHECK(irradiance == doctest::Approx(3.0 / 4.0).epsilon(2e-3));
        CHECK(lights.sample(0.5F, {0.5F, 0.5F}, Vec3(0, 2, 0)).pdf == 0.0F);
    }
}

TEST_CASE("emissive triangles: sampled and hit densities agree") {
    Scene scene;
    scene.materials = {testing::emitter(Rgb(2.0F))};
    testing::add_mesh(scene, testing::quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, 0));  // Faces down.
    const LightSet lights(scene);
    REQUIRE(lights.size() == 2);
    double irradiance = 0.0;
    constexpr uint32_t n = 1U << 16;
    for (uint32_t i = 0; i < n; ++i) {
        const auto [x, y] = sample_2d(SamplerKind::sobol, 1U, i, 0);
        const LightSample s = lights.sample(sample_1d(SamplerKind::sobol, 1U, i, 1), {x, y}, Vec3(0.0F));
        if (s.pdf == 0.0F) continue;
        irradiance += static_cast<double>(s.radiance.r * s.wi.y / s.pdf) / n;
        const Vec3 hit = s.wi * (2.0F / s.wi.y);
        CHECK(s.pdf ==
              doctest::Approx(lights.pdf_triangle(0, s.light, 2.0F, Vec3(0.0F), hit, {0, -1, 0})).epsilon(1e-3));
    }
    // Form factor of a centred square of half side a at height h (Howell): 4 corner terms.
    const double a = 1.0, h = 2.0;
    const double t = a / std::sqrt(a * a + h * h);
    const double form_factor = 4.0 / (2.0 * M_PI) * (t * std::atan(a / std::sqrt(a * a + h * h)) * 2.0);
    CHECK(irradiance == doctest::Approx(2.0 * M_PI * form_factor).epsilon(1e-3));
    CHECK(lights.sample(0.1F, {0.3F, 0.3F}, Vec3(0, 5, 0)).pdf == 0.0F);  // The back is dark.
}

TEST_CASE("selection follows power") {
    Scene scene;
    scene.lights.push_back(testing::point_light({0, 1, 0}, Rgb(1.0F)));
    scene.lights.push_back(testing::point_light({0, 2, 0}, Rgb(3.0F)));
    scene.lights.push_back(testing::point_light({0, 3, 0}, Rgb(0.0F)));
    const LightSet lights(scene);
    int counts[3] = {0, 0, 0};
    constexpr uint32_t n = 100000;
    for (uint32_t i = 0; i < n; ++i) {
        const LightSample s = lights.sample(sample_1d(SamplerKind::independent, 1U, i, 1), Vec2(0.5F), Vec3(0.0F));
        ++counts[s.light];
        CHECK(s.pdf == doctest::Approx(s.light == 0 ? 0.25 : 0.75));
    }
    CHECK(counts[2] == 0);
    CHECK(std::abs(counts[0] - 0.25 * n) < 5.0 * std::sqrt(0.25 * 0.75 * n));
}

TEST_CASE("spot lights fade between their cones") {
    PunctualLight spot = testing::point_light(Vec3(0.0F), Rgb(1.0F));
    spot.kind = LightKind::spot;
    spot.direction = {0, -1, 0};
    spot.cos_inner = std::cos(0.2F);
    spot.cos_outer = std::cos(0.5F);
    const auto at = [&](float angle) {
        return spot_falloff(spot, Triple<float>{std::sin(angle), -std::cos(angle), 0.0F});
    };
    CHECK(at(0.1F) == 1.0F);
    CHECK(at(0.6F) == 0.0F);
    const float ramp = (std::cos(0.35F) - spot.cos_outer) / (spot.cos_inner - spot.cos_outer);
    CHECK(at(0.35F) == doctest::Approx(ramp * ramp));
}

// The path tracer: furnaces, analytic direct light, agreement with its slow twin, bit-for-bit determinism.
#include <doctest/doctest.h>

#include <cmath>

#include "integrators/path/path_integrator.h"
#include "tests/reference_path_tracer.h"
#include "tests/statistics.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

/// Closed box whose walls reflect `albedo` and emit 1: the radiance inside is 1 / (1 - albedo), depth by depth
/// 1 + albedo + albedo^2 + ...
Scene furnace_box(float albedo) {
    Scene scene;
    scene.materials = {testing::emitter(Rgb(1.0F), Rgb(albedo))};
    using testing::quad;
    for (const Mesh& wall : {quad({-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, 0), quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 0),
                             quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, 0), quad({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, 0),
                             quad({-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, 0), quad({1, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0)}) {
        testing::add_mesh(scene, wall);
    }
    return scene;
}

EnvironmentMap white_environment() {
    EnvironmentMap map;
    map.image.width = 8;
    map.image.height = 4;
    map.image.channels = 3;
    map.image.storage = Image::Storage::float32;
    map.image.floats.assign(8 * 4 * 3, 1.0F);
    return map;
}

/// Block-wise z-scores of a picture against the twin, with the Sidak correction.
void check_against_twin(const Scene& scene, const Camera& camera, uint32_t max_depth, const char* name) {
    constexpr int size = 16;
    constexpr int block = 4;
    testing::PreparedScene prepared(scene, camera, size, size);
    prepared.context.max_depth = max_depth;
    prepared.context.sampler = SamplerKind::independent;
    const PathIntegrator integrator(prepared.context);
    const testing::Picture picture = testing::render(integrator, prepared.context, size, size, 1024);
    constexpr uint32_t twin_samples = 1024;
    constexpr int blocks = size / block;
    const double limit = testing::critical_z(testing::sidak(0.002, blocks * blocks * 3));
    for (int by = 0; by < blocks; ++by) {
        for (int bx = 0; bx < blocks; ++bx) {
            glm::dvec3 ours(0.0), our_variance(0.0), twin(0.0), twin_variance(0.0);
            for (int y = by * block; y < (by + 1) * block; ++y) {
                for (int x = bx * block; x < (bx + 1) * block; ++x) {
                    glm::dvec3 sum(0.0), squares(0.0);
                    for (uint32_t i = 0; i < twin_samples; ++i) {
                        const glm::dvec3 value(testing::reference_sample(prepared.context, x, y, i));
                        sum += value;
                        squares += value * value;
                    }
                    sum /= twin_samples;
                    twin += sum;
                    twin_variance += (squares / double{twin_samples} - sum * sum) / double{twin_samples};
                    for (int c = 0; c < 3; ++c) {
                        const size_t i = static_cast<size_t>(y * size + x) * 3 + static_cast<size_t>(c);
                        ours[c] += picture.rgb[i];
                        our_variance[c] += picture.variance[i];
                    }
                }
            }
            for (int c = 0; c < 3; ++c) {
                const double deviation =
                    std::sqrt(our_variance[c] + twin_variance[c]) + 1e-6 * std::abs(twin[c]) + 1e-12;
                const double z = (ours[c] - twin[c]) / deviation;
                INFO(name, ": block ", bx, ",", by, " channel ", c, ": path ", ours[c], " twin ", twin[c], " z ", z);
                CHECK(std::abs(z) < limit);
            }
        }
    }
}

}  // namespace

TEST_CASE("furnace box: the geometric series, depth by depth") {
    const float albedo = 0.7F;
    const Scene scene = furnace_box(albedo);
    testing::PreparedScene prepared(scene, testing::look_at({0, 0, 0}, {0.3F, 0.2F, -1}), 16, 16);
    double series = 1.0;
    double term = 1.0;
    for (uint32_t depth = 1; depth <= 8; ++depth) {
        prepared.context.max_depth = depth;
        term *= static_cast<double>(albedo);
        series += term;
        const testing::Picture picture =
            testing::render(PathIntegrator(prepared.context), prepared.context, 16, 16, 256);
        INFO("depth ", depth);
        CHECK(picture.mean().r == doctest::Approx(series).epsilon(3e-3));
    }
}

TEST_CASE("white spheres vanish in a white environment") {
    for (const Material& material :
         {testing::lambert(Rgb(1.0F)), testing::metal(Rgb(1.0F), 1e-5F), testing::metal(Rgb(1.0F), 0.01F)}) {
        Scene scene;
        scene.materials = {material};
        testing::add_mesh(scene, testing::sphere(Vec3(0.0F), 1.0F, 64, 0));
        scene.environment = white_environment();
        testing::PreparedScene prepared(scene, testing::look_at({0, 0, 3}, Vec3(0.0F)), 32, 32);
        prepared.context.max_depth = 50;
        const testing::Picture picture =
            testing::render(PathIntegrator(prepared.context), prepared.context, 32, 32, 64);
        INFO("roughness ", material.roughness, " metallic ", material.metallic);
        CHECK(picture.mean().g == doctest::Approx(1.0).epsilon(2e-3));
    }
}

TEST_CASE("point light over a Lambert floor: rho / pi I cos / d^2") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.6F, 0.3F, 0.1F))};
    testing::add_mesh(scene, testing::quad({-50, 0, -50}, {0, 0, 100}, {100, 0, 0}, 0));
    scene.lights.push_back(testing::point_light({0, 2, 0}, Rgb(10.0F)));
    testing::PreparedScene prepared(scene, testing::look_at({0.001F, 5, 0}, Vec3(0.0F), 0.02F), 4, 4);
    const testing::Picture picture = testing::render(PathIntegrator(prepared.context), prepared.context, 4, 4, 16);
    CHECK(picture.mean().r == doctest::Approx(0.6 / M_PI * 10.0 / 4.0).epsilon(2e-3));
    CHECK(picture.mean().b == doctest::Approx(0.1 / M_PI * 10.0 / 4.0).epsilon(2e-3));
}

TEST_CASE("flat mirror: the virtual image lights the floor by a glossy bounce") {
    // A nearly perfect mirror overhead sends the light of a sphere back to the floor as from the sphere's image.
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F)), testing::metal(Rgb(1.0F), 1e-5F)};
    testing::add_mesh(scene, testing::quad({-50, 0, -50}, {0, 0, 100}, {100, 0, 0}, 0));
    testing::add_mesh(scene, testing::quad({-50, 3, -50}, {100, 0, 0}, {0, 0, 100}, 1));
    PunctualLight light = testing::point_light({0, 1, 0}, Rgb(10.0F));
    light.kind = LightKind::sphere;
    light.radius = 0.3F;
    scene.lights.push_back(light);
    testing::PreparedScene prepared(scene, testing::look_at({1.5F, 0.5F, 0}, {1.5F, 0, 0.001F}, 0.02F), 8, 8);
    prepared.context.max_depth = 2;
    const testing::Picture picture = testing::render(PathIntegrator(prepared.context), prepared.context, 8, 8, 4096);
    // At (1.5, 0, 0): direct from height 1, mirrored from height 5; the lamp itself hides part of its own image: none
    // here.
    const auto irradiance = [](double h) { return 10.0 * h / std::pow(h * h + 2.25, 1.5); };
    CHECK(picture.mean().r == doctest::Approx(0.5 / M_PI * (irradiance(1.0) + irradiance(5.0))).epsilon(0.02));
}

TEST_CASE("wave and twin agree block by block") {
    const Camera camera = testing::look_at({0.5F, 0.8F, 2.5F}, {0, -0.2F, 0}, 0.9F);
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.7F, 0.6F, 0.5F)), testing::metal(Rgb(0.9F, 0.6F, 0.3F), 0.15F),
                       testing::emitter(Rgb(4.0F)), Material()};
    scene.materials[3].base_color = Vec4(0.2F, 0.5F, 0.8F, 1.0F);
    scene.materials[3].metallic = 0.3F;
    scene.materials[3].roughness = 0.6F;
    testing::add_mesh(scene, testing::quad({-2, -1, -2}, {0, 0, 4}, {4, 0, 0}, 0));
    testing::add_mesh(scene, testing::sphere({-0.5F, -0.4F, 0}, 0.6F, 24, 1));
    testing::add_mesh(scene, testing::sphere({0.8F, -0.5F, 0.3F}, 0.5F, 24, 3));
    testing::add_mesh(scene, testing::quad({-0.7F, 1.5F, -0.7F}, {1.4F, 0, 0}, {0, 0, 1.4F}, 2));
    SUBCASE("area light") {
        check_against_twin(scene, camera, 5, "area light");
    }
    SUBCASE("area, point, spot and directional lights") {
        scene.lights.push_back(testing::point_light({1, 1, 1}, Rgb(0.5F)));
        PunctualLight spot = testing::point_light({-1, 1, 1}, Rgb(2.0F));
        spot.kind = LightKind::spot;
        spot.direction = glm::normalize(Vec3(0.5F, -1, -1));
        spot.cos_inner = 0.9F;
        spot.cos_outer = 0.8F;
        scene.lights.push_back(spot);
        PunctualLight sun = testing::point_light(Vec3(0.0F), Rgb(0.4F));
        sun.kind = LightKind::directional;
        sun.direction = glm::normalize(Vec3(-0.3F, -1, -0.2F));
        scene.lights.push_back(sun);
        check_against_twin(scene, camera, 3, "all delta lights");
    }
    SUBCASE("environment and sphere light") {
        scene.materials[2].emission = Rgb(0.0F);
        scene.environment = white_environment();
        scene.environment->image.floats[3 * 10] = 20.0F;
        PunctualLight sphere = testing::point_light({0.7F, 0.6F, 1.0F}, Rgb(0.5F));
        sphere.kind = LightKind::sphere;
        sphere.radius = 0.2F;
        scene.lights.push_back(sphere);
        check_against_twin(scene, camera, 4, "environment");
    }
    SUBCASE("Russian roulette on long paths") {
        check_against_twin(furnace_box(0.5F), testing::look_at({0, 0, 0}, {0.3F, 0.2F, -1}), 10, "roulette");
    }
}

TEST_CASE("the picture does not depend on the number of threads") {
    Scene scene = furnace_box(0.5F);
    testing::PreparedScene prepared(scene, testing::look_at({0, 0, 0}, {0.3F, 0.2F, -1}), 50, 37);
    const PathIntegrator integrator(prepared.context);
    const testing::Picture one = testing::render(integrator, prepared.context, 50, 37, 13, 1);
    const testing::Picture two = testing::render(integrator, prepared.context, 50, 37, 13, 2);
    CHECK(one.rgb == two.rgb);
}

TEST_CASE("light does not leak through a closed box with smooth normals") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.8F))};
    testing::add_mesh(scene, testing::sphere(Vec3(0.0F), 1.0F, 8, 0, true));
    scene.lights.push_back(testing::point_light({0, 1.5F, 0}, Rgb(100.0F)));
    scene.environment = white_environment();
    testing::PreparedScene prepared(scene, testing::look_at({0, 0, 0}, {0, 0, -1}, 2.0F), 64, 64);
    const testing::Picture picture = testing::render(PathIntegrator(prepared.context), prepared.context, 64, 64, 64);
    CHECK(picture.mean() == Rgb(0.0F));
}

// Bidirectional path tracing, its parts: weights against their slow twin, emission against its density, cameras as
// projections, splats that come in any order.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <span>
#include <thread>
#include <utility>

#include "core/casters.h"
#include "core/exact_sums.h"
#include "integrators/bdpt/bdpt_integrator.h"
#include "tests/bdpt_twin.h"
#include "tests/statistics.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

EnvironmentMap uneven_environment() {
    EnvironmentMap map;
    map.image.width = 16;
    map.image.height = 8;
    map.image.channels = 3;
    map.image.storage = Image::Storage::float32;
    for (int i = 0; i < 16 * 8 * 3; ++i) map.image.floats.push_back(i / 3 == 37 ? 40.0F : 0.3F);
    return map;
}

/// Surfaces of every kind, between two walls so that paths are long.
Scene mixed_scene() {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.7F)), testing::metal(Rgb(0.9F), 0.05F), testing::metal(Rgb(0.9F), 1e-5F),
                       Material(), testing::emitter(Rgb(3.0F), Rgb(0.5F))};
    scene.materials[3].metallic = 0.2F;
    scene.materials[3].roughness = 0.003F;  // A delta coat over a diffuse base.
    testing::add_mesh(scene, testing::quad({-2, -1, -2}, {0, 0, 4}, {4, 0, 0}, 0));
    testing::add_mesh(scene, testing::quad({-2, -1, -1.5F}, {4, 0, 0}, {0, 3, 0}, 2));
    testing::add_mesh(scene, testing::quad({-2, -1, -2}, {0, 3, 0}, {0, 0, 4}, 3));
    testing::add_mesh(scene, testing::sphere({-0.5F, -0.4F, 0}, 0.6F, 12, 1));
    testing::add_mesh(scene, testing::quad({-0.7F, 1.5F, -0.7F}, {1.4F, 0, 0}, {0, 0, 1.4F}, 4));
    return scene;
}

/// With a caster: the ball.
Scene ball_on_floor() {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.6F)), testing::metal(Rgb(0.9F), 0.05F)};
    testing::add_mesh(scene, testing::quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0));
    testing::add_mesh(scene, testing::sphere({0.0F, 0.6F, 0.0F}, 0.5F, 24, 1));
    return scene;
}

PunctualLight light_of(LightKind kind) {
    PunctualLight light = testing::point_light({0.9F, 1.1F, 0.8F}, Rgb(2.0F));
    light.kind = kind;
    light.direction = glm::normalize(Vec3(-0.6F, -1.0F, -0.3F));
    light.radius = kind == LightKind::sphere ? 0.2F : 0.0F;
    light.cos_inner = 0.9F;
    light.cos_outer = 0.5F;
    return light;
}

/// Rays of light 0, some of them past the casters. Their worth grows steadily from one side to the other, so that the
/// learned density has no steps that the tests' integration would miss.
std::vector<AimedRay> many_rays(const PunctualLight& light) {
    std::vector<AimedRay> rays;
    for (uint32_t i = 0; i < 400000; ++i) {
        const auto [x, y] = sample_2d(SamplerKind::sobol, 5U, i, 0);
        const auto [z, w] = sample_2d(SamplerKind::sobol, 5U, i, 1);
        const Vec3 point(4.0F * x - 2.0F, 2.0F * y, 4.0F * z - 2.0F);
        const bool directional = light.kind == LightKind::directional;
        rays.push_back({0, directional ? point : glm::normalize(point - light.position), x * x});
    }
    rays.push_back({0, Vec3(0.0F, 1.0F, 0.0F), std::numeric_limits<float>::quiet_NaN()});
    rays.push_back({7, Vec3(0.0F, 1.0F, 0.0F), 1.0F});
    return rays;
}

}  // namespace

TEST_CASE("bidirectional weights: recursive and explicit agree, and sum to one") {
    Scene scene = mixed_scene();
    for (const LightKind kind : {LightKind::point, LightKind::spot, LightKind::directional, LightKind::sphere}) {
        scene.lights.push_back(light_of(kind));
    }
    scene.environment = uneven_environment();
    const Camera camera = testing::look_at({0.5F, 0.8F, 2.5F}, {0, -0.2F, 0}, 0.9F);
    const testing::PreparedScene prepared(scene, camera, 8, 8);
    const CasterReport casters = find_casters(scene);
    for (const EmissionAim aim : {EmissionAim::everywhere, EmissionAim::mostly_casters}) {
        const LightEmission emission(scene, prepared.lights, casters, aim);
        const testing::BdptTwin twin(prepared.context, emission, 64.0F);
        int paths = 0, strategies = 0, deltas = 0;
        double worst = 0.0, worst_sum = 0.0;
        for (uint32_t i = 0; i < 20000; ++i) {
            const auto path = twin.random_path(i, 6);
            if (!path) continue;
            ++paths;
            for (const testing::TwinVertex& vertex : path->vertices) deltas += vertex.delta ? 1 : 0;
            const std::vector<double> expected = twin.explicit_weights(*path);
            const std::vector<double> found = twin.recursive_weights(*path);
            double sum = 0.0;
            for (size_t s = 0; s < found.size(); ++s) {
                sum += found[s];
                strategies += found[s] > 1e-3 ? 1 : 0;
                worst = std::max(worst, std::abs(found[s] - expected[s]));
            }
            worst_sum = std::max(worst_sum, std::abs(sum - 1.0));
        }
        INFO("aim ", static_cast<int>(aim), " paths ", paths, " strategies ", strategies, " deltas ", deltas, " worst ",
             worst);
        CHECK(paths > 3000);
        CHECK(strategies > 2 * paths);
        CHECK(deltas > 1000);
        CHECK(worst_sum < 1e-5);
        CHECK(worst < 1e-4);
    }
}

TEST_CASE("cameras project what they see, with the density of their rays") {
    for (const CameraKind kind : {CameraKind::perspective, CameraKind::orthographic}) {
        Camera camera = testing::look_at({1, 2, 3}, {0.2F, 0, 0}, 1.2F);
        camera.kind = kind;
        camera.ymag = 1.7F;
        const CameraRays rays = make_camera_rays(camera, 40, 30);
        const CameraProjection projection(rays);
        for (const Vec2 film : {Vec2(0.5F, 0.5F), Vec2(20.0F, 15.0F), Vec2(39.0F, 7.25F)}) {
            const auto origin = to_vec3(rays.origin(film.x, film.y));
            const auto direction = to_vec3(rays.direction(film.x, film.y));
            const Vec3 p = origin + 2.5F * direction;
            const CameraView<float> view = projection.view(to_triple(p));
            CHECK(view.x == doctest::Approx(film.x).epsilon(1e-5));
            CHECK(view.y == doctest::Approx(film.y).epsilon(1e-5));
            CHECK(view.depth > 0.0F);
            CHECK(glm::length(to_vec3(view.wi) + direction) < 1e-5F);
            CHECK(glm::length(to_vec3(view.target) - origin) < 1e-4F);
            CHECK(projection.view(to_triple(origin - direction)).depth < 0.0F);
            // Area, across the ray, that a hundredth of a pixel covers at p.
            const auto at = [&](float x, float y) {
                return to_vec3(rays.origin(x, y)) + 2.5F * to_vec3(rays.direction(x, y));
            };
            const Vec3 across = glm::cross(at(film.x + 0.1F, film.y) - p, at(film.x, film.y + 0.1F) - p);
            const double area = std::abs(static_cast<double>(glm::dot(across, direction))) * 100.0;
            CHECK(static_cast<double>(view.pixel_density) == doctest::Approx(1.0 / area).epsilon(2e-2));
        }
    }
}

TEST_CASE("exact sums: the same bits in any order and from any thread") {
    constexpr int n = 20000;
    std::vector<double> values;
    for (int i = 0; i < n; ++i) {
        const auto u = static_cast<double>(sample_1d(SamplerKind::independent, 5U, static_cast<uint32_t>(i), 0));
        values.push_back(std::exp(60.0 * (u - 0.6)));
    }
    ExactSums forwards, threads;
    forwards.resize(1);
    threads.resize(1);
    double expected = 0.0;
    for (const double value : values) {
        forwards.add(0, value);
        expected += value;
    }
    const auto add_range = [&](int begin, int step) {
        for (int i = begin; i < n; i += step) threads.add(0, values[static_cast<size_t>(n - 1 - i)]);
    };
    std::thread other(add_range, 1, 2);
    add_range(0, 2);
    other.join();
    CHECK(forwards.sum(0) == threads.sum(0));
    CHECK(forwards.sum(0) == doctest::Approx(expected).epsilon(1e-12));
}

TEST_CASE("emission: directions match their density (chi-square), aimed or not, learned or not") {
    Scene scene = ball_on_floor();
    Object copy = scene.objects[1];
    copy.to_world = Mat4(1.0F);
    copy.to_world[3] = Vec4(1.0F, 0.3F, 0.4F, 1.0F);
    scene.objects.push_back(copy);
    for (const LightKind kind : {LightKind::point, LightKind::spot, LightKind::sphere}) {
        scene.lights = {light_of(kind)};
        scene.lights[0].radius = 0.001F;
        scene.lights[0].position = {1.2F, 2.5F, 0.5F};
        const LightSet lights(scene);
        for (const auto& [aim, learned] :
             {std::pair{EmissionAim::everywhere, false}, std::pair{EmissionAim::mostly_casters, false},
              std::pair{EmissionAim::casters_only, false}, std::pair{EmissionAim::mostly_casters, true},
              std::pair{EmissionAim::casters_only, true}}) {
            LightEmission emission(scene, lights, find_casters(scene), aim);
            if (learned) emission.learn(many_rays(scene.lights[0]));
            const auto sample = [&](Vec2 u, float u_choice) {
                const EmissionSample ray = emission.sample(u_choice, {0.3F, 0.6F}, u);
                return testing::DirectionDraw{ray.direction, glm::length(ray.direction) > 0.5F};
            };
            const auto pdf = [&](const Vec3& d) { return static_cast<double>(emission.direction_pdf(0, d)); };
            const Vec3 focus = scene.lights[0].direction;
            // A density with edges, integrated by midpoints, is known to a per mille only: few draws.
            const testing::ChiSquareResult result = testing::chi_square_directions(
                sample, pdf, focus, 0.05, aim == EmissionAim::everywhere ? 200000 : (learned ? 10000 : 30000));
            INFO("light kind ", static_cast<int>(kind), " aim ", static_cast<int>(aim), " learned ", learned, " ",
                 result.worst_bin, " integral ", result.integral);
            CHECK(result.p_value > 1e-4);
            CHECK(result.integral == doctest::Approx(1.0).epsilon(0.01));
            if (aim != EmissionAim::everywhere) CHECK(emission.aimed().aims(0));
        }
    }
}

TEST_CASE("emission: rays go where they were worth most, and a quarter of them everywhere as before") {
    Scene scene = ball_on_floor();
    scene.lights = {light_of(LightKind::point)};
    const LightSet lights(scene);
    LightEmission emission(scene, lights, find_casters(scene), EmissionAim::casters_only);
    const auto towards = [&](const Vec3& p) { return glm::normalize(p - scene.lights[0].position); };
    const Vec3 bright = towards({0.2F, 0.7F, 0.1F}), dark = towards({-0.2F, 0.8F, 0.2F});
    const float before = emission.direction_pdf(0, bright);
    REQUIRE(before > 0.0F);
    CHECK(emission.direction_pdf(0, dark) == before);
    emission.learn({});
    CHECK(emission.direction_pdf(0, bright) == before);
    const AimedRay ray{0, bright, 2.0F};
    emission.learn(std::span(&ray, 1));
    CHECK(emission.direction_pdf(0, bright) == doctest::Approx(before * (0.25F + 0.75F * 1024.0F)));
    CHECK(emission.direction_pdf(0, dark) == doctest::Approx(0.25F * before));
}

TEST_CASE("emission of directional lights: rays per area match their density, aimed or not, learned or not") {
    Scene scene = ball_on_floor();
    scene.lights = {light_of(LightKind::directional)};
    const Vec3 direction = scene.lights[0].direction;
    const Frame<float> frame = make_frame(to_triple(direction));
    const LightSet lights(scene);
    for (const auto& [aim, learned] :
         {std::pair{EmissionAim::everywhere, false}, std::pair{EmissionAim::mostly_casters, false},
          std::pair{EmissionAim::casters_only, false}, std::pair{EmissionAim::casters_only, true}}) {
        LightEmission emission(scene, lights, find_casters(scene), aim);
        if (learned) emission.learn(many_rays(scene.lights[0]));
        // Rays through the cells of a square across the light.
        constexpr int cells = 24, subdivisions = 16, draws = 100000;
        constexpr float side = 6.0F;
        std::vector<double> observed(cells * cells, 0.0);
        for (uint32_t i = 0; i < draws; ++i) {
            const auto [x, y] = sample_2d(SamplerKind::independent, 8U, i, 0);
            const EmissionSample ray = emission.sample(sample_1d(SamplerKind::independent, 8U, i, 2), {x, y}, {x, y});
            const Triple<float> local = frame.to_local(to_triple(ray.origin));
            const int column = static_cast<int>(std::floor((local.x / side + 0.5F) * cells));
            const int row = static_cast<int>(std::floor((local.y / side + 0.5F) * cells));
            if (std::min(column, row) < 0 || std::max(column, row) >= cells) continue;
            observed[static_cast<size_t>(row * cells + column)] += 1.0;
        }
        const auto density = [&](float x, float y) {
            const Vec3 p = to_vec3(frame.to_world({side * (x / cells - 0.5F), side * (y / cells - 0.5F), 0.0F}));
            return static_cast<double>(emission.ray_density(0, 1.0F, p, direction, 1.0F));
        };
        double chi2 = 0.0;
        for (int cell = 0; cell < cells * cells; ++cell) {
            double expected = 0.0;
            for (int i = 0; i < subdivisions * subdivisions; ++i) {
                const float x = (static_cast<float>(i % subdivisions) + 0.5F) / subdivisions;
                const float y = (static_cast<float>(i / subdivisions) + 0.5F) / subdivisions;
                expected += density(static_cast<float>(cell % cells) + x, static_cast<float>(cell / cells) + y);
            }
            const double cell_area = std::pow(double{side} / cells, 2.0);
            expected *= draws * cell_area / (subdivisions * subdivisions);
            const double deviation = observed[static_cast<size_t>(cell)] - expected;
            if (expected == 0.0) CHECK(deviation == 0.0);
            if (expected > 0.0) chi2 += deviation * deviation / expected;
        }
        INFO("aim ", static_cast<int>(aim), " learned ", learned, " chi2 ", chi2);
        CHECK(testing::chi_square_tail(chi2, cells * cells) > 1e-4);
    }
}

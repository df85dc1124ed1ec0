// Bidirectional path tracing, whole pictures: agreement with path tracing, furnaces, crops, threads, the caustic layer.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <numeric>

#include "core/casters.h"
#include "integrators/bdpt/bdpt_integrator.h"
#include "integrators/driver.h"
#include "integrators/path/path_integrator.h"
#include "tests/statistics.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

constexpr int size = 32;
constexpr PixelRegion whole{0, 0, size, size};

Film render_film(const Integrator& integrator, const RenderContext& context, const PixelRegion& crop, uint32_t spp,
                 int threads = 2) {
    AovSelection aovs = context.aovs;
    aovs.variance = true;
    Film film(size, size, crop, aovs, true);
    DriverSettings settings;
    settings.spp = spp;
    settings.threads = threads;
    settings.process_start = std::chrono::steady_clock::now();
    Progress progress(Verbosity::quiet);
    run_render(integrator, film, settings, progress);
    return film;
}

struct Comparison {
    uint32_t max_depth = 5;
    uint32_t path_spp = 512;
    uint32_t bdpt_spp = 256;
    bool aim = false;
    PixelRegion crop = whole;
};

/// z-scores of 8 x 8 blocks of bdpt's picture against path's, with the Sidak correction.
void check_against_path(const Scene& scene, const Camera& camera, const Comparison& c, const std::string& name) {
    testing::PreparedScene prepared(scene, camera, size, size);
    prepared.context.max_depth = c.max_depth;
    prepared.context.sampler = SamplerKind::independent;
    const BdptIntegrator bdpt(prepared.context, find_casters(scene), {size, size, c.crop}, {c.aim});
    const Film ours = render_film(bdpt, prepared.context, c.crop, c.bdpt_spp);
    prepared.context.seed = 1;
    const Film theirs = render_film(PathIntegrator(prepared.context), prepared.context, c.crop, c.path_spp);
    CHECK(ours.nonfinite_samples() == 0);
    const std::vector<float> a = ours.beauty(), b = theirs.beauty();
    const std::vector<float> va = ours.variance(), vb = theirs.variance();
    const auto sum_of = [](const std::vector<float>& values) {
        return std::accumulate(values.begin(), values.end(), 0.0);
    };
    INFO(name, ": mean of bdpt ", sum_of(a) / static_cast<double>(a.size()), ", of path ",
         sum_of(b) / static_cast<double>(b.size()));
    const int columns = c.crop.width(), rows = c.crop.height();
    const int blocks = (columns / 8) * (rows / 8);
    const double limit = testing::critical_z(testing::sidak(0.001, blocks * 3));
    for (int block = 0; block < blocks; ++block) {
        for (size_t channel = 0; channel < 3; ++channel) {
            double difference = 0.0, variance = 0.0, scale = 0.0;
            for (int i = 0; i < 64; ++i) {
                const int x = block % (columns / 8) * 8 + i % 8, y = block / (columns / 8) * 8 + i / 8;
                const size_t at = static_cast<size_t>(y * columns + x) * 3 + channel;
                difference += static_cast<double>(a[at]) - static_cast<double>(b[at]);
                variance += static_cast<double>(va[at]) + static_cast<double>(vb[at]);
                scale += static_cast<double>(b[at]);
            }
            const double z = difference / (std::sqrt(variance) + 1e-6 * scale + 1e-9);
            INFO("block ", block, " channel ", channel, " difference ", difference / 64.0, " of ", scale / 64.0, " z ",
                 z);
            CHECK(std::abs(z) < limit);
        }
    }
}

PunctualLight light_of(LightKind kind, float radius = 0.0F) {
    PunctualLight light = testing::point_light({0.7F, 0.9F, 0.9F}, Rgb(2.0F, 1.5F, 1.0F));
    light.kind = kind;
    light.direction = glm::normalize(Vec3(-0.6F, -1.0F, -0.5F));
    light.radius = radius;
    light.cos_inner = 0.95F;
    light.cos_outer = 0.6F;
    if (kind == LightKind::directional) light.intensity *= 0.5F;
    return light;
}

EnvironmentMap environment() {
    EnvironmentMap map;
    map.image.width = 8;
    map.image.height = 4;
    map.image.channels = 3;
    map.image.storage = Image::Storage::float32;
    map.image.floats.assign(8 * 4 * 3, 0.4F);
    map.image.floats[3 * 10] = 15.0F;
    return map;
}

/// A floor, a wall, a smooth ball and a glossy one of the given alpha.
Scene room(float alpha) {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.7F, 0.6F, 0.5F)), testing::metal(Rgb(0.9F, 0.6F, 0.3F), alpha),
                       testing::emitter(Rgb(4.0F, 3.0F, 2.0F), Rgb(0.3F)), Material()};
    scene.materials[3].base_color = Vec4(0.2F, 0.5F, 0.8F, 1.0F);
    scene.materials[3].metallic = 0.3F;
    scene.materials[3].roughness = 0.6F;
    testing::add_mesh(scene, testing::quad({-2, -1, -2}, {0, 0, 4}, {4, 0, 0}, 0));
    testing::add_mesh(scene, testing::quad({-2, -1, -1.2F}, {4, 0, 0}, {0, 3, 0}, 0));
    testing::add_mesh(scene, testing::sphere({-0.5F, -0.4F, 0}, 0.6F, 24, 1));
    testing::add_mesh(scene, testing::sphere({0.8F, -0.5F, 0.3F}, 0.5F, 24, 3));
    return scene;
}

/// Everything larger by a factor, with the same picture.
void enlarge(Scene& scene, Camera& camera, float factor) {
    for (Mesh& mesh : scene.meshes) {
        for (Vec3& p : mesh.positions) p *= factor;
    }
    for (PunctualLight& light : scene.lights) {
        light.position *= factor;
        light.radius *= factor;
        if (light.kind != LightKind::directional) light.intensity *= factor * factor;
    }
    camera.to_world[3] = Vec4(Vec3(camera.to_world[3]) * factor, 1.0F);
}

const Camera room_camera = testing::look_at({0.5F, 0.8F, 2.5F}, {0, -0.2F, 0}, 0.9F);

/// White walls that emit one.
Scene furnace(float albedo) {
    Scene scene;
    scene.materials = {testing::emitter(Rgb(1.0F), Rgb(albedo))};
    testing::add_mesh(scene, testing::sphere(Vec3(0.0F), 1.0F, 4, 0, true));
    scene.meshes[0].normals.clear();
    return scene;
}

}  // namespace

TEST_CASE("bdpt agrees with path: every kind of light") {
    Scene scene = room(0.15F);
    SUBCASE("area light") {
        testing::add_mesh(scene, testing::quad({-0.7F, 1.5F, -0.7F}, {1.4F, 0, 0}, {0, 0, 1.4F}, 2));
        check_against_path(scene, room_camera, {}, "area light");
    }
    SUBCASE("double-sided area light between floor and camera") {
        scene.materials[2].double_sided = true;
        testing::add_mesh(scene, testing::quad({-0.3F, 0.6F, 0.2F}, {0.8F, 0.1F, 0}, {0, 0.3F, 0.4F}, 2));
        check_against_path(scene, room_camera, {}, "double-sided light");
    }
    SUBCASE("point light") {
        scene.lights = {light_of(LightKind::point)};
        check_against_path(scene, room_camera, {}, "point light");
    }
    SUBCASE("point light, aimed at casters") {
        scene.materials[1] = testing::metal(Rgb(0.9F, 0.6F, 0.3F), 0.1F);
        scene.lights = {light_of(LightKind::point)};
        check_against_path(scene, room_camera, {.path_spp = 1024, .aim = true}, "aimed point light");
    }
    SUBCASE("spot and directional lights") {
        scene.lights = {light_of(LightKind::spot), light_of(LightKind::directional)};
        check_against_path(scene, room_camera, {}, "spot and directional lights");
    }
    SUBCASE("spot and directional lights, aimed at casters") {
        scene.materials[1] = testing::metal(Rgb(0.9F, 0.6F, 0.3F), 0.1F);
        scene.lights = {light_of(LightKind::spot), light_of(LightKind::directional)};
        check_against_path(scene, room_camera, {.path_spp = 1024, .aim = true}, "aimed spot and directional lights");
    }
    SUBCASE("sphere light, and all others") {
        scene.lights = {light_of(LightKind::sphere, 0.2F), light_of(LightKind::point)};
        scene.lights[1].position = {-1, 1, 1};
        testing::add_mesh(scene, testing::quad({-0.7F, 1.5F, -0.7F}, {1.4F, 0, 0}, {0, 0, 1.4F}, 2));
        check_against_path(scene, room_camera, {.max_depth = 3}, "sphere light");
    }
    SUBCASE("environment") {
        scene.environment = environment();
        check_against_path(scene, room_camera, {}, "environment");
    }
}

TEST_CASE("bdpt agrees with path: surfaces, depths, cameras and crops") {
    SUBCASE("perfect mirror and sphere light") {
        Scene scene = room(1e-5F);
        scene.lights = {light_of(LightKind::sphere, 0.3F)};
        check_against_path(scene, room_camera, {.path_spp = 2048}, "perfect mirror");
    }
    SUBCASE("small sphere light, aimed") {
        Scene scene = room(0.1F);
        scene.lights = {light_of(LightKind::sphere, 0.003F)};
        check_against_path(scene, room_camera, {.path_spp = 1024, .aim = true}, "small sphere light");
    }
    SUBCASE("shading normals far from geometric ones") {
        Scene scene = room(0.3F);
        scene.meshes[2] = testing::sphere({-0.5F, -0.4F, 0}, 0.6F, 4, 0);
        scene.meshes[3] = testing::sphere({0.8F, -0.5F, 0.3F}, 0.5F, 5, 1);
        scene.lights = {light_of(LightKind::point)};
        check_against_path(scene, room_camera, {}, "shading normals");
    }
    SUBCASE("depth one and two") {
        Scene scene = room(0.2F);
        scene.lights = {light_of(LightKind::point), light_of(LightKind::sphere, 0.1F)};
        check_against_path(scene, room_camera, {.max_depth = 1}, "depth one");
        check_against_path(scene, room_camera, {.max_depth = 2}, "depth two");
    }
    SUBCASE("rooms of millimetres and of kilometres") {
        for (const float factor : {1e-3F, 1e4F}) {
            Scene scene = room(0.15F);
            scene.lights = {light_of(LightKind::sphere, 0.1F), light_of(LightKind::directional)};
            testing::add_mesh(scene, testing::quad({-0.7F, 1.5F, -0.7F}, {1.4F, 0, 0}, {0, 0, 1.4F}, 2));
            Camera camera = room_camera;
            enlarge(scene, camera, factor);
            check_against_path(scene, camera, {}, "factor " + std::to_string(factor));
        }
    }
    SUBCASE("orthographic camera") {
        Scene scene = room(0.15F);
        scene.lights = {light_of(LightKind::point)};
        testing::add_mesh(scene, testing::quad({-0.7F, 1.5F, -0.7F}, {1.4F, 0, 0}, {0, 0, 1.4F}, 2));
        Camera camera = room_camera;
        camera.kind = CameraKind::orthographic;
        camera.ymag = 1.2F;
        check_against_path(scene, camera, {}, "orthographic camera");
    }
    SUBCASE("one mesh thrice, mirrored and sheared") {
        Scene scene = room(0.3F);
        scene.lights = {light_of(LightKind::point)};
        const auto mesh = static_cast<int>(scene.meshes.size());
        scene.meshes.push_back(testing::sphere(Vec3(0.0F), 0.3F, 12, 3));
        Mat4 sheared = glm::translate(Mat4(1.0F), Vec3(0.1F, -0.6F, 0.9F));
        sheared[1][0] = 0.4F;
        const Mat4 mirrored = glm::scale(glm::translate(Mat4(1.0F), Vec3(1.2F, 0.6F, -0.5F)), Vec3(-1.0F, 1.3F, 0.8F));
        const Mat4 placed = glm::translate(Mat4(1.0F), Vec3(-1.3F, 0.5F, -0.4F));
        for (const Mat4& to_world : {sheared, mirrored, placed})
            scene.objects.push_back({"ball", mesh, to_world, false});
        check_against_path(scene, room_camera, {}, "instances");
    }
    SUBCASE("crop") {
        Scene scene = room(0.15F);
        scene.lights = {light_of(LightKind::point)};
        check_against_path(scene, room_camera, {.crop = {5, 9, 29, 25}}, "crop");
    }
}

TEST_CASE("bdpt: furnace, depth by depth, with roulette") {
    const Scene scene = furnace(0.6F);
    testing::PreparedScene prepared(scene, testing::look_at({0, 0, 0}, {0.3F, 0.2F, -1}), size, size);
    double series = 1.0, term = 1.0;
    for (uint32_t depth = 1; depth <= 8; ++depth) {
        prepared.context.max_depth = depth;
        term *= 0.6;
        series += term;
        const BdptIntegrator integrator(prepared.context, find_casters(scene), {size, size, whole}, {});
        const testing::Picture picture = testing::render(integrator, prepared.context, size, size, 32);
        INFO("depth ", depth);
        CHECK(picture.mean().r == doctest::Approx(series).epsilon(4e-3));
    }
}

TEST_CASE("bdpt: a point light in a perfect mirror lights the floor as its image does") {
    // Path tracing has no strategy for it: light sub-paths find the floor, and the camera sees it.
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F)), testing::metal(Rgb(1.0F), 1e-5F)};
    testing::add_mesh(scene, testing::quad({-20, 0, -20}, {0, 0, 40}, {40, 0, 0}, 0));
    testing::add_mesh(scene, testing::quad({-20, 3, -20}, {40, 0, 0}, {0, 0, 40}, 1));
    scene.lights.push_back(testing::point_light({0, 1, 0}, Rgb(10.0F)));
    testing::PreparedScene prepared(scene, testing::look_at({1.5F, 0.5F, 0}, {1.5F, 0, 0.001F}, 0.2F), size, size);
    prepared.context.max_depth = 2;
    const auto irradiance = [](double h) { return 10.0 * h / std::pow(h * h + 2.25, 1.5); };
    for (const bool aim : {false, true}) {
        const BdptIntegrator integrator(prepared.context, find_casters(scene), {size, size, whole}, {aim});
        const testing::Picture picture = testing::render(integrator, prepared.context, size, size, 2048);
        double variance = 0.0;
        for (const float v : picture.variance) variance += static_cast<double>(v);
        const double deviation = std::sqrt(variance) / static_cast<double>(picture.variance.size());
        const double expected = 0.5 / M_PI * (irradiance(1.0) + irradiance(5.0));
        INFO("aimed ", aim, ": found ", picture.mean().r, " expected ", expected, " deviation ", deviation);
        CHECK(std::abs(static_cast<double>(picture.mean().r) - expected) < 5.0 * deviation + 2e-3 * expected);
        CHECK(deviation < 0.05 * expected);
    }
}

TEST_CASE("bdpt: the same bits for any number of threads, inside a crop") {
    Scene scene = room(0.05F);
    scene.lights = {light_of(LightKind::point)};
    testing::PreparedScene prepared(scene, room_camera, size, size);
    prepared.context.aovs.caustic = true;
    const PixelRegion crop{3, 2, 27, 31};
    const BdptIntegrator integrator(prepared.context, find_casters(scene), {size, size, crop}, {true});
    const Film one = render_film(integrator, prepared.context, crop, 13, 1);
    const Film two = render_film(integrator, prepared.context, crop, 13, 2);
    CHECK(one.beauty() == two.beauty());
    CHECK(one.caustic() == two.caustic());
    CHECK(one.variance() == two.variance());
}

TEST_CASE("bdpt: the caustic layer is the path tracer's") {
    Scene scene = room(0.1F);
    scene.lights = {light_of(LightKind::point)};
    testing::PreparedScene prepared(scene, room_camera, size, size);
    prepared.context.aovs.caustic = true;
    prepared.context.max_depth = 5;
    const auto total = [](const std::vector<float>& values) {
        return std::accumulate(values.begin(), values.end(), 0.0);
    };
    const CasterReport casters = find_casters(scene);
    const Film path = render_film(PathIntegrator(prepared.context), prepared.context, whole, 4096);
    const double expected = total(path.caustic());
    CHECK(expected > 0.0);
    for (const bool aim : {false, true}) {
        const BdptIntegrator integrator(prepared.context, casters, {size, size, whole}, {aim});
        const Film bdpt = render_film(integrator, prepared.context, whole, 512);
        INFO("aimed ", aim, ": bdpt ", total(bdpt.caustic()), " path ", expected);
        CHECK(total(bdpt.caustic()) == doctest::Approx(expected).epsilon(0.02));
    }
}

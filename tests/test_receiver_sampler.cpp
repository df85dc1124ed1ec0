// Receivers: on surfaces and facing the viewer, found through mirrors, as many as wanted, the same for any threads.
#include <doctest/doctest.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>
#include <cstring>
#include <set>

#include "core/casters.h"
#include "pathcut/receiver_sampler.h"
#include "tests/test_scenes.h"

using namespace nephroid;
using testing::quad;

namespace {

constexpr int width = 160;
constexpr int height = 120;

/// A scene and a camera of 160 x 120 pixels, with casters found.
struct View {
    explicit View(const Scene& shown, const Camera& camera)
        : scene(shown), accelerator(shown, 1), surfaces(shown), rays(make_camera_rays(camera, width, height)) {
        surfaces.set_casters(find_casters(shown).is_caster);
    }
    std::vector<Receiver> sample(uint32_t count, int max_bounces = 4) const {
        return sample(ReceiverSampling{width, height, {0, 0, width, height}, count, 7, max_bounces});
    }
    std::vector<Receiver> sample(const ReceiverSampling& sampling) const {
        return sample_receivers(scene, accelerator, surfaces, rays, sampling);
    }

    const Scene& scene;
    Accelerator accelerator;
    Surfaces surfaces;
    CameraRays rays;
};

std::set<uint32_t> objects_of(const std::vector<Receiver>& receivers) {
    std::set<uint32_t> objects;
    for (const Receiver& receiver : receivers) objects.insert(receiver.object);
    return objects;
}

double in_double(float x) {
    return static_cast<double>(x);
}

/// How much farther than its error a point lies from the nearest triangle's plane, of those that it is over, metres.
double excess_distance(const Mesh& mesh, const Receiver& receiver) {
    const Vec3d p(receiver.position);
    double nearest = INFINITY;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
        const Vec3d normal = glm::cross(b - a, c - a);
        const double length = glm::length(normal);
        const double v = glm::dot(glm::cross(p - a, c - a), normal) / (length * length);
        const double w = glm::dot(glm::cross(b - a, p - a), normal) / (length * length);
        if (v < -1e-4 || w < -1e-4 || v + w > 1.0 + 1e-4) continue;
        const double slab = glm::dot(glm::abs(normal), Vec3d(receiver.error));
        nearest = std::min(nearest, (std::abs(glm::dot(normal, p - a)) - slab) / length);
    }
    return nearest;
}

void check_is_sound(const Receiver& receiver) {
    CHECK(std::isfinite(receiver.position.x + receiver.position.y + receiver.position.z));
    CHECK(std::isfinite(receiver.error.x + receiver.error.y + receiver.error.z));
    CHECK(glm::length(receiver.geometric_normal) == doctest::Approx(1.0).epsilon(1e-5));
    CHECK(glm::length(receiver.shading_normal) == doctest::Approx(1.0).epsilon(1e-5));
    CHECK(glm::dot(receiver.geometric_normal, receiver.shading_normal) >= 0.0F);
    CHECK(std::isfinite(receiver.footprint));
    CHECK(receiver.footprint > 0.0F);
    CHECK(receiver.alpha >= 0.0F);
    CHECK(receiver.alpha <= 1.0F);
}

/// A floor and a glossy ball of `alpha` under a point light.
Scene ball_on_floor(float alpha, float scale = 1.0F) {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F)), testing::metal(Rgb(0.9F), alpha)};
    testing::add_mesh(scene, quad(scale * Vec3(-3, 0, -3), scale * Vec3(0, 0, 6), scale * Vec3(6, 0, 0), 0));
    testing::add_mesh(scene, testing::sphere(scale * Vec3(0, 1, 0), scale, 24, 1));
    scene.lights.push_back(testing::point_light(scale * Vec3(1, 4, 2), Rgb(10.0F)));
    return scene;
}

/// A box with reflecting walls that face inwards, from -1 to 1.
Scene closed_box(const Material& material) {
    Scene scene;
    scene.materials = {material};
    for (const Mesh& wall : {quad({-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, 0), quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 0),
                             quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, 0), quad({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, 0),
                             quad({-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, 0), quad({1, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0)}) {
        testing::add_mesh(scene, wall);
    }
    scene.lights.push_back(testing::point_light({0.2F, 0.9F, 0.1F}, Rgb(1.0F)));
    return scene;
}

Mesh triangle(const Vec3& a, const Vec3& b, const Vec3& c, int material) {
    Mesh mesh;
    mesh.material = material;
    mesh.positions.reserve(4);
    mesh.positions = {a, b, c};
    mesh.positions.reserve(4);
    mesh.triangles = {{0, 1, 2}};
    return mesh;
}

/// Film position of a point that a perspective camera sees.
Vec2 film_position(const CameraRays& rays, const Vec3& p) {
    const glm::dmat3 axes(rays.direction_base, rays.direction_dx, rays.direction_dy);
    const Vec3d solution = glm::inverse(axes) * Vec3d(p - rays.origin_base);
    return Vec2(solution.y / solution.x, solution.z / solution.x);
}

bool are_equal(const std::vector<Receiver>& a, const std::vector<Receiver>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Receiver)) == 0);
}

void check_merged(const std::vector<Receiver>& receivers) {
    size_t pairs = 0;
    for (size_t i = 0; i < receivers.size(); ++i) {
        for (size_t k = i + 1; k < receivers.size(); ++k) {
            const Receiver &a = receivers[i], &b = receivers[k];
            const float reach = merge_distance * std::min(a.footprint, b.footprint);
            if (glm::dot(a.geometric_normal, b.geometric_normal) <= merge_normal_cosine) continue;
            if (glm::length(a.position - b.position) < reach) ++pairs;
        }
    }
    CHECK(pairs == 0);
}

}  // namespace

TEST_CASE("receivers lie on surfaces and face the viewer, at scales 1e-4 to 1e5") {
    for (const float scale : {1e-4F, 1.0F, 1e5F}) {
        const Scene scene = ball_on_floor(0.3F, scale);
        const Vec3 eye = scale * Vec3(0.5F, 3, 6);
        const View view(scene, testing::look_at(eye, scale * Vec3(0, 0.5F, 0)));
        const std::vector<Receiver> receivers = view.sample(1000);
        INFO("scale ", scale);
        CHECK(receivers.size() >= 900);
        CHECK(receivers.size() <= 1250);
        CHECK(objects_of(receivers) == std::set<uint32_t>{0, 1});
        for (const Receiver& receiver : receivers) {
            check_is_sound(receiver);
            CHECK(excess_distance(scene.meshes[receiver.object], receiver) <= 0.0);
            CHECK(glm::dot(receiver.geometric_normal, eye - receiver.position) > 0.0F);
            const double alpha = receiver.object == 0 ? 1.0 : 0.3;
            CHECK(in_double(receiver.alpha) == doctest::Approx(alpha));
        }
        check_merged(receivers);
    }
}

TEST_CASE("footprints add up to the surface that is seen") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F))};
    testing::add_mesh(scene, quad({-30, 0, -30}, {0, 0, 60}, {60, 0, 0}, 0));
    for (const bool orthographic : {false, true}) {
        Camera camera = testing::look_at({0, 5, 4}, Vec3(0.0F));
        if (orthographic) camera.kind = CameraKind::orthographic;
        const View view(scene, camera);
        std::array<Vec3, 4> corners;
        for (size_t k = 0; k < 4; ++k) {
            const float x = k == 1 || k == 2 ? float{width} : 0.0F, y = k >= 2 ? float{height} : 0.0F;
            const Vec3 origin = to_vec3(view.rays.origin(x, y)), direction = to_vec3(view.rays.direction(x, y));
            corners[k] = origin - direction * (origin.y / direction.y);
        }
        const double area =
            in_double(0.5F * (glm::length(glm::cross(corners[1] - corners[0], corners[2] - corners[0])) +
                              glm::length(glm::cross(corners[2] - corners[0], corners[3] - corners[0]))));
        double sum = 0.0;
        for (const Receiver& receiver : view.sample(2000)) sum += std::pow(in_double(receiver.footprint), 2.0);
        CHECK(sum == doctest::Approx(area).epsilon(0.03));
    }
}

TEST_CASE("what is seen only in mirrors is found: one mirror, then two") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F)), testing::metal(Rgb(1.0F), 0.0F)};
    // The mirror before the camera shows the wall behind it.
    testing::add_mesh(scene, quad({-2, -2, 6}, {0, 4, 0}, {4, 0, 0}, 0));
    testing::add_mesh(scene, quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, 1));
    const View view(scene, testing::look_at({0, 0, 2}, {0.05F, 0.02F, -1}, 0.3F));
    const std::vector<Receiver> receivers = view.sample(500);
    CHECK(receivers.size() >= 450);
    CHECK(receivers.size() <= 625);
    for (const Receiver& receiver : receivers) {
        check_is_sound(receiver);
        CHECK(receiver.object == 0);
        CHECK(receiver.geometric_normal.z < -0.99F);
        // As seen by a camera behind the mirror: a path of 3 + 7 metres, straight but for 0.3 radians.
        const double spacing = 10.0 * 2.0 * std::tan(0.15) / std::sqrt(500.0 * 3.0 / 4.0);
        CHECK(in_double(receiver.footprint) > 0.97 * spacing);
        CHECK(in_double(receiver.footprint) < 1.03 * spacing);
    }
    CHECK(view.sample(500, 0).empty());

    // A periscope, with a wall at its other end.
    Scene periscope;
    periscope.materials = scene.materials;
    testing::add_mesh(periscope, quad({-1, 3, 9}, {0, 4, 0}, {2, 0, 0}, 0));
    testing::add_mesh(periscope, quad({-1, -1, -1}, {2, 0, 0}, {0, 2, -2}, 1));
    testing::add_mesh(periscope, quad({-1, 4, -3}, {2, 0, 0}, {0, 2, 2}, 1));
    const View through(periscope, testing::look_at({0, 0, 2}, {0, 0, -1}, 0.1F));
    CHECK(through.sample(100, 1).empty());
    CHECK(objects_of(through.sample(100, 2)) == std::set<uint32_t>{0});
}

TEST_CASE("a glossy caster is a receiver, and shows others; a glossy surface without a small light does not") {
    for (const bool lit : {false, true}) {
        Scene scene;
        scene.materials = {testing::lambert(Rgb(0.5F)), testing::metal(Rgb(1.0F), 0.01F)};
        testing::add_mesh(scene, quad({-2, -2, 6}, {0, 4, 0}, {4, 0, 0}, 0));
        testing::add_mesh(scene, quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, 1));
        if (lit) scene.lights.push_back(testing::point_light({0, 1, 3}, Rgb(1.0F)));
        const View view(scene, testing::look_at({0, 0, 2}, {0, 0, -1}, 0.3F));
        const std::vector<Receiver> receivers = view.sample(500);
        CHECK(objects_of(receivers) == (lit ? std::set<uint32_t>{0, 1} : std::set<uint32_t>{1}));
        CHECK(receivers.size() >= 450);
        CHECK(receivers.size() <= 625);
    }
}

TEST_CASE("what a curved mirror shows is served by the points found there") {
    // As if the ball were flat, points would stand for too little: a quarter of what it shows of the wall behind the
    // camera would be out of their reach (of cached points: four footprints).
    Scene scene = ball_on_floor(0.01F);
    testing::add_mesh(scene, quad({-9, -9, 7}, {18, 0, 0}, {0, 18, 0}, 0));
    const View view(scene, testing::look_at({0, 1.5F, 6}, {0, 1, 0}));
    const std::vector<Receiver> points = view.sample(4000);
    ReceiverSampling others{width, height, {0, 0, width, height}, 3000, 8, 4};
    int seen = 0, served = 0;
    for (const Receiver& other : view.sample(others)) {
        if (other.object != 2) continue;
        ++seen;
        served += std::any_of(points.begin(), points.end(), [&other](const Receiver& point) {
            return point.object == other.object &&
                   glm::length(point.position - other.position) < 4.0F * point.footprint;
        });
    }
    CHECK(seen > 100);
    CHECK(served > 0.99 * seen);
}

TEST_CASE("a diffuse base under a perfectly smooth coat is a receiver; a pure mirror is none") {
    for (const float metallic : {0.0F, 1.0F}) {
        Scene scene;
        Material smooth = testing::metal(Rgb(0.7F), 0.0F);
        smooth.metallic = metallic;
        scene.materials = {smooth};
        testing::add_mesh(scene, quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0));
        const View view(scene, testing::look_at({0, 0, 3}, Vec3(0.0F), 0.3F));
        CHECK(view.sample(100).empty() == (metallic == 1.0F));
    }
}

TEST_CASE("paths do not go on through a mirror whose shading normal points them below the surface") {
    for (const bool tilted : {false, true}) {
        Scene scene;
        scene.materials = {testing::metal(Rgb(1.0F), 0.0F), testing::lambert(Rgb(0.5F))};
        Mesh mirror = quad({-1, 0.3F, -1}, {0, 0, 2}, {2, 0, 0}, 0);
        const float angle = tilted ? 1.05F : 0.2F;
        mirror.normals.assign(4, Vec3(std::sin(angle), std::cos(angle), 0));
        testing::add_mesh(scene, mirror);
        testing::add_mesh(scene, quad({-50, -1, -50}, {0, 0, 100}, {100, 0, 0}, 1));
        testing::add_mesh(scene, quad({-50, 20, -50}, {100, 0, 0}, {0, 0, 100}, 1));
        const View view(scene, testing::look_at({0, 4, 0.01F}, {0, 0.3F, 0}, 0.2F));
        CHECK(objects_of(view.sample(100)) == (tilted ? std::set<uint32_t>{} : std::set<uint32_t>{2}));
    }
}

TEST_CASE("the grid is refined until the count is near the wanted one") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F))};
    testing::add_mesh(scene, quad({-0.1F, -0.1F, 0}, {0.2F, 0, 0}, {0, 0.2F, 0}, 0));
    // About a tenth of the film.
    const View view(scene, testing::look_at({0, 0, 0.8F}, {0.05F, 0.03F, 0}));
    for (const uint32_t count : {1U, 7U, 100U, 3000U}) {
        const std::vector<Receiver> receivers = view.sample(count);
        INFO("wanted ", count, ", found ", receivers.size());
        CHECK(static_cast<double>(receivers.size()) <= 1.25 * count);
        CHECK(static_cast<double>(receivers.size()) >= (count < 100 ? 1.0 : 0.85 * count));
    }
}

TEST_CASE("the same receivers for one thread and two, others for another seed") {
    const Scene scene = ball_on_floor(0.01F);
    const View view(scene, testing::look_at({0.5F, 3, 6}, {0, 0.5F, 0}));
    std::vector<std::vector<Receiver>> found;
    for (const size_t threads : {1U, 2U, 2U}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        found.push_back(view.sample(5000));
    }
    CHECK(found[0].size() > 4000);
    CHECK(are_equal(found[0], found[1]));
    CHECK(are_equal(found[0], found[2]));
    CHECK_FALSE(are_equal(found[0], view.sample({width, height, {0, 0, width, height}, 5000, 8, 4})));
}

TEST_CASE("nothing to see, nothing found") {
    const Camera camera = testing::look_at({0, 0, 3}, Vec3(0.0F));
    const Scene empty;
    CHECK(View(empty, camera).sample(1000).empty());

    const Scene scene = ball_on_floor(0.3F);
    CHECK(View(scene, testing::look_at({0, 5, 0}, {0, 9, 0.1F})).sample(1000).empty());
    const View view(scene, camera);
    CHECK(view.sample(0).empty());
    CHECK(view.sample({width, height, {40, 30, 40, 60}, 1000, 0, 4}).empty());
    CHECK(view.sample({width, height, {width, 0, 2 * width, height}, 1000, 0, 4}).empty());
    CHECK_FALSE(view.sample({width, height, {-50, -50, 2 * width, 2 * height}, 1000, 0, 4}).empty());
}

TEST_CASE("lights and triangles without area are no receivers") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F)), testing::emitter(Rgb(1.0F), Rgb(0.5F))};
    testing::add_mesh(scene, quad({-3, 0, -3}, {0, 0, 6}, {6, 0, 0}, 0));
    testing::add_mesh(scene, quad({-1, 1, -1}, {0, 0, 2}, {2, 0, 0}, 1));
    testing::add_mesh(scene, triangle({-1, 2, -1}, {1, 2, 1}, {0, 2, 0}, 0));
    PunctualLight light = testing::point_light({1.5F, 0.5F, 1.5F}, Rgb(1.0F));
    light.kind = LightKind::sphere;
    light.radius = 0.5F;
    scene.lights.push_back(light);
    const Vec3 eye(0, 6, 0.1F);
    const View view(scene, testing::look_at(eye, Vec3(0.0F)));
    const std::vector<Receiver> receivers = view.sample(500);
    CHECK(objects_of(receivers) == std::set<uint32_t>{0});
    for (const Receiver& receiver : receivers) {
        // Neither behind the emitting quad nor behind the light.
        const Vec3 direction = glm::normalize(receiver.position - eye);
        const Vec3 at_quad = eye + direction * (5.0F / -direction.y);
        CHECK(std::max(std::abs(at_quad.x), std::abs(at_quad.z)) > 0.999F);
        CHECK(glm::length(glm::cross(light.position - eye, direction)) > 0.499F);
    }
}

TEST_CASE("the crop is respected") {
    const Scene scene = ball_on_floor(0.3F);
    const View view(scene, testing::look_at({0.5F, 3, 6}, {0, 0.5F, 0}));
    const PixelRegion crop{50, 70, 81, 90};
    const std::vector<Receiver> receivers = view.sample({width, height, crop, 400, 3, 4});
    CHECK(receivers.size() >= 360);
    CHECK(receivers.size() <= 500);
    Vec2 lowest(1e9F), highest(-1e9F);
    for (const Receiver& receiver : receivers) {
        const Vec2 film = film_position(view.rays, receiver.position);
        lowest = glm::min(lowest, film);
        highest = glm::max(highest, film);
    }
    CHECK(lowest.x > 49.99F);
    CHECK(lowest.y > 69.99F);
    CHECK(highest.x < 81.01F);
    CHECK(highest.y < 90.01F);
    CHECK(highest.x - lowest.x > 28.0F);
    CHECK(highest.y - lowest.y > 17.0F);
}

TEST_CASE("in a closed box of mirrors paths end by the limit of bounces") {
    const Camera camera = testing::look_at({0.1F, 0.05F, 0.3F}, {-0.4F, 0.2F, -1});
    const Scene mirrors = closed_box(testing::metal(Rgb(1.0F), 0.0F));
    CHECK(View(mirrors, camera).sample(200, 100).empty());

    // Of glossy metal, each of the bounces leaves a receiver.
    const Scene glossy = closed_box(testing::metal(Rgb(1.0F), 0.01F));
    const View view(glossy, camera);
    for (const int bounces : {0, 1, 4, 50}) {
        const std::vector<Receiver> receivers = view.sample(200, bounces);
        INFO(bounces, " bounces");
        CHECK(receivers.size() >= 150);
        CHECK(receivers.size() <= 250);
        if (bounces >= 4) CHECK(objects_of(receivers).size() == 6);
        check_merged(receivers);
    }
}

TEST_CASE("a path may leave more receivers than are wanted") {
    const Scene scene = closed_box(testing::metal(Rgb(1.0F), 0.01F));
    const View view(scene, testing::look_at({0.1F, 0.05F, 0.3F}, {-0.4F, 0.2F, -1}));
    for (const uint32_t count : {1U, 2U, 3U, 4U, 9U}) {
        const std::vector<Receiver> receivers = view.sample(count, 20);
        INFO("wanted ", count, ", found ", receivers.size());
        CHECK(receivers.size() >= 1);
        CHECK(receivers.size() <= count + count / 4);
        // Each of few stands for much of the box, but for no more than a quarter of its diagonal.
        for (const Receiver& receiver : receivers) CHECK(receiver.footprint <= 0.866026F);
    }
}

TEST_CASE("duplicates are merged: a concave mirror that shows the same small spot everywhere") {
    Scene scene;
    scene.materials = {testing::metal(Rgb(1.0F), 0.0F), testing::lambert(Rgb(0.5F))};
    testing::add_mesh(scene, testing::sphere(Vec3(0.0F), 1.0F, 64, 0, true));
    // From the centre, the mirror shows what is closely behind the viewer.
    testing::add_mesh(scene, quad({-0.2F, -0.2F, 0.05F}, {0, 0.4F, 0}, {0.4F, 0, 0}, 1));
    const View view(scene, testing::look_at(Vec3(0.0F), {0, 0, -1}));
    const std::vector<Receiver> receivers = view.sample(400);
    CHECK(receivers.size() >= 10);
    CHECK(receivers.size() <= 360);  // 6400 paths arrive at less than 40 mm x 40 mm.
    check_merged(receivers);
}

TEST_CASE("neighbours in the list are neighbours in space") {
    const Scene scene = ball_on_floor(0.3F);
    const View view(scene, testing::look_at({0.5F, 3, 6}, {0, 0.5F, 0}));
    const std::vector<Receiver> receivers = view.sample(2000);
    // Runs of 64 points cover compact patches, not lines.
    constexpr size_t run = 64;
    double diagonals = 0.0, footprints = 0.0;
    for (size_t first = 0; first + run <= receivers.size(); first += run) {
        Bounds bounds;
        for (size_t i = first; i < first + run; ++i) {
            bounds.extend(receivers[i].position);
            footprints += in_double(receivers[i].footprint) / double{run};
        }
        diagonals += in_double(glm::length(bounds.max - bounds.min));
    }
    CHECK(diagonals < 30.0 * footprints);
}

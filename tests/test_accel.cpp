// Ray queries: offsets without self-intersection at every scale, closed meshes without leaks, packets, instances,
// holes.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "core/frame.h"
#include "core/rounding.h"
#include "core/sampler.h"
#include "core/warp.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

Vec3 random_direction(uint32_t i, uint32_t dimension) {
    const auto [u, v] = sample_2d(SamplerKind::independent, 99U, i, dimension);
    return to_vec3(square_to_uniform_sphere(u, v));
}

}  // namespace

TEST_CASE("rays that leave a plane never hit it again, at scales 1e-4 to 1e5 and far from the origin") {
    for (const float scale : {1e-4F, 1e-2F, 1.0F, 1e2F, 1e5F}) {
        for (const float offset : {0.0F, 10.0F, 1e3F}) {
            Scene scene;
            scene.materials = {testing::lambert(Rgb(0.5F))};
            const Vec3 centre = Vec3(1.0F, 0.3F, -0.7F) * offset * scale;
            const Vec3 a = glm::normalize(Vec3(1.0F, 0.2F, 0.1F)) * scale;
            const Vec3 b = glm::normalize(glm::cross(a, Vec3(0.1F, 1.0F, 0.3F))) * scale;
            testing::add_mesh(scene, testing::quad(centre - 0.5F * (a + b), a, b, 0));
            const Accelerator accelerator(scene, 1);
            const Surfaces surfaces(scene);
            int self_hits = 0;
            int hits = 0;
            for (uint32_t i = 0; i < 20000; ++i) {
                const auto [u, v] = sample_2d(SamplerKind::independent, 7U, i, 0);
                const Vec3 target = centre + (u - 0.5F) * 0.98F * a + (v - 0.5F) * 0.98F * b;
                Vec3 d = random_direction(i, 1);
                const Ray ray{target - d * (2.0F * scale), d};
                const Hit hit = accelerator.intersect(ray);
                if (hit.object == no_hit) continue;
                ++hits;
                const SurfaceInteraction s = surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -d);
                for (uint32_t k = 0; k < 4; ++k) {
                    Vec3 out = random_direction(i, 2 + k);
                    if (k == 3)
                        out = glm::normalize(out - 0.9999F * glm::dot(out, s.geometric_normal) * s.geometric_normal);
                    const Vec3 origin = offset_ray_origin(s.position, s.error, s.geometric_normal, out);
                    if (accelerator.intersect({origin, out}).object != no_hit) ++self_hits;
                    if (accelerator.occluded({origin, out})) ++self_hits;
                }
            }
            INFO("scale ", scale, " offset ", offset);
            CHECK(self_hits == 0);
            CHECK(hits > 10000);
        }
    }
}

TEST_CASE("a closed sphere leaks no ray") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F))};
    testing::add_mesh(scene, testing::sphere(Vec3(0.3F, 0.1F, -0.2F), 1.0F, 64, 0));
    const Accelerator accelerator(scene, 1);
    constexpr size_t n = 1U << 20;
    RayBatch rays(1024);
    HitBatch hits(1024);
    int leaks = 0;
    for (size_t first = 0; first < n; first += 1024) {
        rays.count = 0;
        for (size_t i = 0; i < 1024; ++i)
            rays.push(Vec3(0.3F, 0.1F, -0.2F), random_direction(static_cast<uint32_t>(first + i), 0));
        accelerator.intersect(rays, false, hits);
        for (size_t i = 0; i < 1024; ++i) leaks += hits.object[i] == no_hit ? 1 : 0;
    }
    CHECK(leaks == 0);
}

TEST_CASE("packets and single rays see the same scene") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F))};
    testing::add_mesh(scene, testing::sphere(Vec3(0.0F), 1.0F, 32, 0));
    testing::add_mesh(scene, testing::quad({-2, -1, -2}, {0, 0, 4}, {4, 0, 0}, 0));
    const Accelerator accelerator(scene, 1);
    constexpr size_t n = 1000;  // Not a multiple of the packet width.
    RayBatch rays(n);
    HitBatch hits(n);
    AlignedArray<uint32_t> occluded(padded_to_packets(n));
    for (uint32_t i = 0; i < n; ++i) rays.push(3.0F * random_direction(i, 0), random_direction(i, 1), 5.0F);
    for (const bool coherent : {false, true}) {
        accelerator.intersect(rays, coherent, hits);
        accelerator.occluded(rays, coherent, occluded);
        for (size_t i = 0; i < n; ++i) {
            const Ray ray{rays.origin(i), rays.direction(i), 5.0F};
            const Hit hit = accelerator.intersect(ray);
            CHECK(hit.object == hits.object[i]);
            if (hit.object != no_hit) CHECK(hit.t == doctest::Approx(hits.t[i]).epsilon(1e-4));
            CHECK(accelerator.occluded(ray) == (occluded[i] != 0));
        }
    }
}

TEST_CASE("instances, mirrored ones too, have outward normals and the right front side") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F))};
    scene.meshes.push_back(testing::sphere(Vec3(0.0F), 1.0F, 16, 0));
    const Mat4 plain = glm::translate(Mat4(1.0F), Vec3(-3, 0, 0)) * glm::scale(Mat4(1.0F), Vec3(1.0F, 2.0F, 1.0F));
    const Mat4 mirrored = glm::translate(Mat4(1.0F), Vec3(3, 0, 0)) * glm::scale(Mat4(1.0F), Vec3(-1.0F, 1.0F, 1.5F));
    scene.objects = {{"plain", 0, plain, false}, {"mirrored", 0, mirrored, false}};
    const Accelerator accelerator(scene, 1);
    const Surfaces surfaces(scene);
    for (const float x : {-3.0F, 3.0F}) {
        for (uint32_t i = 0; i < 200; ++i) {
            const Vec3 d = random_direction(i, 0);
            const Vec3 eye = Vec3(x, 0, 0) - 2.6F * d;
            const Hit hit = accelerator.intersect({eye, d});
            REQUIRE(hit.object == (x < 0.0F ? 0U : 1U));
            const SurfaceInteraction s = surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -d);
            CHECK(s.front);
            CHECK(glm::dot(s.geometric_normal, -d) > 0.0F);
            CHECK(glm::dot(s.geometric_normal, s.shading_normal) > 0.8F);
            const float distance = glm::length(s.position - (eye + hit.t * d));
            CHECK(distance < 1e-4F);
            // From inside, the back side is seen.
            const Hit inside = accelerator.intersect({Vec3(x, 0, 0), d});
            CHECK_FALSE(surfaces.interact(inside.object, inside.primitive, inside.u, inside.v, -d).front);
        }
    }
}

TEST_CASE("incoherent packets among instances come back, with the answers of single rays") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F))};
    scene.meshes.push_back(testing::sphere(Vec3(0.0F), 1.0F, 8, 0));
    for (int i = 0; i < 5; ++i) {
        const Vec3 place(2.5F * static_cast<float>(i) - 5.0F, 0, i % 2 == 0 ? 1.0F : -1.0F);
        const Mat4 placed = glm::translate(Mat4(1.0F), place);
        scene.objects.push_back({"ball", 0, glm::scale(placed, Vec3(i == 2 ? -1.0F : 1.0F, 1.3F, 0.8F)), false});
    }
    testing::add_mesh(scene, testing::quad({-8, -1.5F, -8}, {0, 0, 16}, {16, 0, 0}, 0));
    const Accelerator accelerator(scene, 1);
    constexpr uint32_t n = 1024;
    RayBatch rays(n);
    HitBatch hits(n);
    AlignedArray<uint32_t> occluded(padded_to_packets(n));
    for (uint32_t round = 0; round < 40; ++round) {
        rays.count = 0;
        for (uint32_t i = 0; i < n; ++i) {
            const Vec3 origin = Vec3(6, 1.4F, 3) * random_direction(round * n + i, 0);
            rays.push(origin, 8.0F * random_direction(round * n + i, 1), 0.999F);
        }
        accelerator.intersect(rays, false, hits);
        accelerator.occluded(rays, false, occluded);
        for (size_t i = 0; i < n; ++i) {
            const Ray ray{rays.origin(i), rays.direction(i), 0.999F};
            CHECK(accelerator.occluded(ray) == (occluded[i] != 0));
            CHECK((accelerator.intersect(ray).object == no_hit) == (hits.object[i] == no_hit));
        }
    }
}

TEST_CASE("alpha makes holes: masks exactly, blending by its share") {
    Scene scene;
    Material cut = testing::lambert(Rgb(0.5F));
    cut.alpha_mode = AlphaMode::mask;
    cut.base_color.a = 0.3F;
    Material glass = testing::lambert(Rgb(0.5F));
    glass.alpha_mode = AlphaMode::blend;
    glass.base_color.a = 0.3F;
    scene.materials = {cut, glass};
    testing::add_mesh(scene, testing::quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 0));
    testing::add_mesh(scene, testing::quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, 1));
    const Accelerator accelerator(scene, 1);
    int hits = 0;
    constexpr int n = 20000;
    for (uint32_t i = 0; i < n; ++i) {
        const auto [u, v] = sample_2d(SamplerKind::independent, 7U, i, 0);
        const Vec3 target(1.8F * u - 0.9F, 2.0F, 1.8F * v - 0.9F);
        const Hit hit = accelerator.intersect({Vec3(0.0F), glm::normalize(target)});
        CHECK(hit.object != 0U);
        hits += hit.object == 1U ? 1 : 0;
    }
    CHECK(std::abs(hits - 0.3 * n) < 5.0 * std::sqrt(0.3 * 0.7 * n));
}

TEST_CASE("sphere lights are hit where they are") {
    Scene scene;
    for (const float radius : {1e-3F, 0.5F}) {
        PunctualLight light = testing::point_light({0, 0, radius < 0.1F ? -10.0F : 10.0F}, Rgb(1.0F));
        light.kind = LightKind::sphere;
        light.radius = radius;
        scene.lights.push_back(light);
    }
    const Accelerator accelerator(scene, 1);
    const Hit small = accelerator.intersect({Vec3(0.0F), Vec3(0, 0, -1)});
    CHECK(small.object == 0U);
    CHECK(small.t == doctest::Approx(10.0F - 1e-3F));
    CHECK(accelerator.intersect({Vec3(0.0F), Vec3(0, 0, 1)}).object == 1U);
    CHECK(accelerator.intersect({Vec3(0.0F), Vec3(0, 1, 0)}).object == no_hit);
}

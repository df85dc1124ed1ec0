// Pictures of directions: the map, the density against what the path tracer draws, the light against quadrature.
#include <doctest/doctest.h>

#include <cmath>

#include "integrators/guided/guided_integrator.h"
#include "integrators/guided/inspection.h"
#include "tests/caustic_scenes.h"
#include "tests/test_scenes.h"

using namespace nephroid;
using testing::CausticScene;

namespace {

constexpr int picture_size = 128;

/// A floor point of the ring's caustic, seen by the middle of a picture of one pixel.
struct CausticView {
    explicit CausticView(float alpha, uint32_t max_depth = 2)
        : caustic(testing::ring_caustic(alpha)),
          point(caustic.floor_points[0]),
          camera(testing::look_at(point + Vec3(0.05F, 1.5F, 0.1F), point, 1e-3F)),
          prepared(caustic.scene, camera, 1, 1) {
        prepared.context.max_depth = max_depth;
    }
    InspectedVertex vertex() const {
        const std::optional<InspectedVertex> found = find_inspected_vertex(prepared.context, Vec2(0.5F));
        REQUIRE(found.has_value());
        return *found;
    }
    GuidedIntegrator integrator() const {
        GuidedSettings settings;
        settings.cached_points = 16;
        settings.bounces = 1;
        settings.guide_fraction = 0.5F;
        return {prepared.context, find_casters(caustic.scene), {1, 1, {0, 0, 1, 1}}, settings};
    }

    CausticScene caustic;
    Vec3 point;
    Camera camera;
    testing::PreparedScene prepared;
};

DirectionMap hemisphere_of(const InspectedVertex& vertex) {
    return DirectionMap::hemisphere(vertex.surface.shading_normal, -vertex.wo, picture_size);
}

InspectionSettings few_rays(uint32_t rays) {
    return {rays, 2};
}

}  // namespace

TEST_CASE("direction maps: positions come back, cells hold their solid angle") {
    const Vec3 axis = glm::normalize(Vec3(0.3F, 0.9F, -0.2F)), up(0.0F, 0.0F, 1.0F);
    for (const DirectionMap& map : {DirectionMap::hemisphere(axis, up, 64), DirectionMap::window(axis, up, 0.8F, 64),
                                    DirectionMap::window(axis, up, 1e-3F, 64)}) {
        double sum = 0.0;
        for (size_t cell = 0; cell < map.cell_count(); ++cell) {
            const Vec2 position(static_cast<float>(cell % 64) + 0.3F, static_cast<float>(cell / 64) + 0.6F);
            const DirectionMap::Point point = map.at(position);
            if (point.jacobian <= 0.0F) continue;
            sum += double{point.jacobian};
            CHECK(glm::length(point.direction) == doctest::Approx(1.0F).epsilon(1e-6));
            const std::optional<Vec2> back = map.find(point.direction);
            REQUIRE(back.has_value());
            CHECK(glm::distance(*back, position) < 2e-2F);
            // The jacobian against a small parallelogram of directions.
            const float step = 0.25F;
            const Vec3 a = map.at(position + Vec2(step, 0)).direction - map.at(position - Vec2(step, 0)).direction;
            const Vec3 b = map.at(position + Vec2(0, step)).direction - map.at(position - Vec2(0, step)).direction;
            if (!map.is_whole(cell)) continue;
            CHECK(glm::length(glm::cross(a, b)) / (4.0F * step * step) ==
                  doctest::Approx(point.jacobian).epsilon(0.05));
        }
        if (map.at(Vec2(0.5F)).jacobian <= 0.0F) CHECK(sum == doctest::Approx(2.0 * 3.14159265).epsilon(5e-3));
    }
}

TEST_CASE("direction maps: the top is where `up` points, seen from outside or along the axis") {
    const Vec3 axis(0.0F, 1.0F, 0.0F), up(0.0F, 0.0F, -1.0F);
    const DirectionMap hemisphere = DirectionMap::hemisphere(axis, up, 100);
    CHECK(hemisphere.at({50.0F, 10.0F}).direction.z < -0.5F);
    CHECK(hemisphere.at({90.0F, 50.0F}).direction.x > 0.5F);
    const DirectionMap window = DirectionMap::window({0.0F, 0.0F, -1.0F}, axis, 0.5F, 100);
    CHECK(window.at({50.0F, 10.0F}).direction.y > 0.1F);
    CHECK(window.at({90.0F, 50.0F}).direction.x > 0.1F);
    // An axis along `up` still gives a map.
    CHECK(glm::length(DirectionMap::hemisphere(axis, axis, 100).at({50.0F, 50.0F}).direction - axis) < 1e-5F);
}

TEST_CASE("the density integrates to what lies above the horizon") {
    for (const float alpha : {0.1F, 0.005F}) {
        const CausticView view(alpha, 3);
        const InspectedVertex vertex = view.vertex();
        const GuidedIntegrator integrator = view.integrator();
        REQUIRE(integrator.guide() != nullptr);
        const float fraction = guide_fraction_at(view.prepared.context, vertex, integrator.guide());
        CHECK(fraction > 0.0F);
        for (const DirectionalGuide* guide : {static_cast<const DirectionalGuide*>(nullptr), integrator.guide()}) {
            const DirectionPictures pictures =
                make_direction_pictures(view.prepared.context, vertex, guide, hemisphere_of(vertex), few_rays(1));
            const double integral = pictures.integral(pictures.density);
            INFO("alpha ", alpha, guide != nullptr ? ", guided" : ", BSDF");
            // The floor is Lambertian: all that the BSDF samples is above.
            CHECK(integral >= (guide != nullptr ? 1.0 - double{fraction} : 1.0) - 2e-3);
            CHECK(integral <= 1.0 + 2e-3);
        }
    }
}

TEST_CASE("lobes narrower than a cell are not missed") {
    const CausticView view(0.001F, 3);
    const InspectedVertex vertex = view.vertex();
    const GuidedIntegrator integrator = view.integrator();
    const auto integral = [&](int size) {
        const DirectionMap map = DirectionMap::hemisphere(vertex.surface.shading_normal, -vertex.wo, size);
        const DirectionPictures pictures =
            make_direction_pictures(view.prepared.context, vertex, integrator.guide(), map, few_rays(1));
        return pictures.integral(pictures.density);
    };
    CHECK(integral(16) == doctest::Approx(integral(256)).epsilon(5e-3));
}

TEST_CASE("the light is the caustic's irradiance, and its normalised target integrates to one") {
    for (const float alpha : {0.1F, 0.02F}) {
        const CausticView view(alpha);
        const InspectedVertex vertex = view.vertex();
        CHECK(vertex.object == 0);
        CHECK(vertex.mirrors == 0);
        CHECK(glm::distance(vertex.surface.position, view.point) < 1e-3F);
        DirectionPictures pictures =
            make_direction_pictures(view.prepared.context, vertex, nullptr, hemisphere_of(vertex), few_rays(64));
        CHECK(pictures.nonfinite_samples == 0);
        const double irradiance = pictures.integral(pictures.target);
        // Quadrature has the lamp's own light too, which no ray can hit.
        const Vec3 to_lamp = view.caustic.scene.lights[0].position - view.point;
        const double lamp = 10.0 * double{to_lamp.y} / std::pow(double{glm::length(to_lamp)}, 3.0);
        const double all = testing::floor_radiance(view.caustic, view.point) * 3.14159265 / 0.6;
        const bool lit = !view.prepared.accelerator.occluded({view.point + Vec3(0, 1e-4F, 0), to_lamp, 0.999F});
        CHECK(irradiance == doctest::Approx(all - (lit ? lamp : 0.0)).epsilon(0.02));

        pictures.normalise(irradiance);
        CHECK(pictures.integral(pictures.target) == doctest::Approx(1.0).epsilon(1e-5));
    }
}

TEST_CASE("guiding fits the light better than the BSDF does") {
    const CausticView view(0.02F, 2);
    const InspectedVertex vertex = view.vertex();
    // The guide serves paths of two scatterings after its vertex; light is that of one more than it needs.
    const CausticView deeper(0.02F, 3);
    const GuidedIntegrator integrator = deeper.integrator();
    const auto fit = [&](const DirectionalGuide* guide) {
        DirectionPictures pictures =
            make_direction_pictures(deeper.prepared.context, vertex, guide, hemisphere_of(vertex), few_rays(16));
        pictures.normalise(pictures.integral(pictures.target));
        return measure_fit(pictures);
    };
    const DensityFit guided = fit(integrator.guide()), bsdf = fit(nullptr);
    INFO("guided ", guided.relative_deviation, " against ", bsdf.relative_deviation, "; covered ", guided.covered,
         " against ", bsdf.covered);
    CHECK(guided.covered > bsdf.covered);
    CHECK(guided.relative_deviation < bsdf.relative_deviation);
}

TEST_CASE("pictures do not depend on the number of threads") {
    const CausticView view(0.02F);
    const InspectedVertex vertex = view.vertex();
    const auto pictures = [&](int threads) {
        return make_direction_pictures(view.prepared.context, vertex, nullptr, hemisphere_of(vertex), {4, threads});
    };
    const DirectionPictures one = pictures(1), three = pictures(3);
    CHECK(one.density == three.density);
    CHECK(one.radiance == three.radiance);
}

TEST_CASE("camera rays follow perfect mirrors, and end where no direction is sampled") {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.5F)), testing::metal(Rgb(0.9F), 0.0F), testing::emitter(Rgb(3.0F))};
    testing::add_mesh(scene, testing::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 0));  // Floor, y = 0.
    testing::add_mesh(scene, testing::quad({-1, 0, -1}, {2, 0, 0}, {0, 2, 0}, 1));  // Mirror, z = -1.
    testing::add_mesh(scene, testing::quad({3, 0, -1}, {1, 0, 0}, {0, 1, 0}, 2));   // Lamp.
    const auto seen = [&scene](const Vec3& eye, const Vec3& target, uint32_t max_depth) {
        testing::PreparedScene prepared(scene, testing::look_at(eye, target, 1e-3F), 1, 1);
        prepared.context.max_depth = max_depth;
        return find_inspected_vertex(prepared.context, Vec2(0.5F));
    };
    const Vec3 eye(0.0F, 1.0F, 1.0F), mirror_point(0.0F, 0.5F, -1.0F);
    const std::optional<InspectedVertex> vertex = seen({0.0F, 1.0F, 0.0F}, mirror_point, 4);
    REQUIRE(vertex.has_value());
    CHECK(vertex->object == 0);
    CHECK(vertex->mirrors == 1);
    CHECK(glm::distance(vertex->surface.position, Vec3(0.0F)) < 1e-3F);
    CHECK(glm::distance(vertex->wo, glm::normalize(mirror_point)) < 1e-3F);
    CHECK(!seen({0.0F, 1.0F, 0.0F}, mirror_point, 1).has_value());         // Its depth is spent at the mirror.
    CHECK(!seen(eye, {0.0F, 5.0F, 0.0F}, 4).has_value());                  // Nothing.
    CHECK(!seen({3.5F, 0.5F, 1.0F}, {3.5F, 0.5F, -1.0F}, 4).has_value());  // A lamp.
}

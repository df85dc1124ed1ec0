// Lamps seen by two and more reflections: paths are mirror paths, and pictures keep their mean.
#include <doctest/doctest.h>

#include "core/casters.h"
#include "integrators/guided/highlights.h"
#include "integrators/guided/mirrored_lamps.h"
#include "pathcut/specular_chain.h"
#include "pathcut/tuple_solver.h"
#include "tests/guided_renders.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

/// Two metal spheres that mirror each other and the lamp.
testing::CausticScene two_spheres(float alpha) {
    testing::CausticScene caustic = testing::sphere_caustic(alpha);
    testing::add_mesh(caustic.scene, testing::sphere({-0.9F, 0.5F, 0.8F}, 0.35F, 24, 1));
    caustic.camera = testing::look_at({0.6F, 1.4F, 2.6F}, {-0.4F, 0.5F, 0.4F}, 0.5F);
    return caustic;
}

struct Found {
    Found(const testing::CausticScene& caustic, int longest) : scene(caustic.scene, caustic.camera, 64, 48) {
        prepared = prepare_paths(scene.context, find_casters(caustic.scene), GuidedSettings());
        paths = find_mirrored_lamps(scene.context, prepared, {0, 0, 64, 48}, longest, SolverOptions());
    }
    testing::PreparedScene scene;
    GuidedPaths prepared;
    std::vector<FoundPath> paths;
};

}  // namespace

TEST_CASE("mirrored lamps: every path is a path of light") {
    const Found found(two_spheres(0.02F), max_chain_length);
    size_t exact = 0;
    for (const FoundPath& path : found.paths) {
        CHECK(path.path.length >= 2);
        if (!path.path.exact) continue;
        ++exact;
        PerVertex<uint32_t> triangles{};
        ChainPosition position{};
        for (size_t i = 0; i < path.path.length; ++i) {
            triangles[i] = path.vertices[i].triangle;
            position[i] = Vec2d(path.vertices[i].b1, path.vertices[i].b2);
        }
        TuplePatches tuple;
        make_tuple_chain(found.prepared.reflectors, std::span(triangles).first(path.path.length),
                         found.scene.context.camera_rays.origin_base, found.prepared.lights[path.path.light], tuple);
        const ChainEvaluation evaluation = evaluate(tuple.chain, position);
        REQUIRE(evaluation.valid);
        for (size_t i = 0; i < path.path.length; ++i) CHECK(glm::length(evaluation.constraints[i].slope) < 1e-4);
    }
    // The lamp by the one sphere in the other, and the other way round.
    CHECK(exact >= 2);
    CHECK(Found(two_spheres(0.02F), 1).paths.empty());
}

TEST_CASE("mirrored lamps: what hides the lamp hides its mirror images") {
    testing::CausticScene caustic = two_spheres(0.02F);
    testing::add_mesh(caustic.scene, testing::quad({-1.9F, 0.2F, -2.0F}, {0.0F, 3.0F, 0.0F}, {0.0F, 0.0F, 4.0F}, 0));
    CHECK(Found(caustic, max_chain_length).paths.empty());
}

TEST_CASE("mirrored lamps: points on the first mirrors") {
    const testing::CausticScene caustic = two_spheres(0.02F);
    Found found(caustic, 1);
    const Highlights highlights =
        find_highlights(found.scene.context, found.prepared, {64, 48, {0, 0, 64, 48}}, GuidedSettings());
    CHECK(!highlights.film.empty());
    CHECK(!highlights.mirrors.empty());
    for (const Receiver& mirror : highlights.mirrors) {
        CHECK(mirror.object > 0);
        CHECK(mirror.alpha == doctest::Approx(0.02F));
        CHECK(mirror.footprint > 0.0F);
        CHECK(glm::dot(mirror.geometric_normal, mirror.position - found.scene.context.camera_rays.origin_base) < 0.0F);
    }
    GuidedSettings single;
    single.bounces = 1;
    CHECK(find_highlights(found.scene.context, found.prepared, {64, 48, {0, 0, 64, 48}}, single).mirrors.empty());
}

TEST_CASE("mirrored lamps: the brightness that path tracing finds") {
    const testing::CausticScene caustic = two_spheres(0.08F);
    testing::RenderSize size;
    size.width = 32;
    size.height = 32;
    size.max_depth = 4;
    GuidedSettings settings;
    settings.cached_points = 300;
    size.spp = 1024;
    const testing::CheckedPicture guided = testing::render_guided(caustic, size, settings);
    size.spp = 8192;
    const testing::CheckedPicture path = testing::render_path(caustic, size);
    testing::check_clean(guided);
    CHECK(guided.guided);
    testing::check_same_mean(guided, path, "mirrored lamps");
}

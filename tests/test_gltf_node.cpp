// Loading of glTF files: the node graph, transforms, instances.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "core/gltf.h"
#include "core/scene.h"
#include "tests/gltf_builder.h"

using namespace nephroid;
using namespace nephroid::test;

TEST_CASE("node transforms") {
    GltfBuilder builder = triangle_builder();
    Json& node = builder.json["nodes"][0];
    SUBCASE("translation, rotation, scale in this order") {
        node["translation"] = {1, 2, 3};
        node["rotation"] = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};  // 90 degrees about Z.
        node["scale"] = {2, 3, 4};
    }
    SUBCASE("matrix, column by column") {
        node["matrix"] = {0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 1, 2, 3, 1};
    }
    SUBCASE("inherited") {
        node["scale"] = {2, 3, 4};
        builder.add_node({{"children", {0}}, {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}});
        builder.add_node({{"children", {1}}, {"translation", {1, 2, 3}}});
    }
    const Scene scene = load(builder);
    const Mat4& to_world = scene.objects.at(0).to_world;
    check_vec(Vec3(to_world * Vec4(1, 0, 0, 1)), {1, 4, 3});
    check_vec(Vec3(to_world * Vec4(0, 1, 0, 1)), {-2, 2, 3});
    check_vec(Vec3(to_world * Vec4(0, 0, 1, 1)), {1, 2, 7});
}

TEST_CASE("flattening keeps front sides, normals and tangents of mirrored nodes") {
    GltfBuilder builder = textured_triangle({{"normalTexture", {{"index", 0}}}});
    builder.json["nodes"][0]["scale"] = {-2, 1, 1};
    Scene scene = load(builder);
    const Vec4 tangent = scene.meshes.at(0).tangents.at(0);
    flatten_single_use_meshes(scene);
    CHECK(scene.objects.at(0).to_world == Mat4(1.0F));
    check_vec(world_face_normal(scene, scene.objects[0], 0), {0, 0, 1});
    check_vec(scene.meshes[0].normals.at(0), {0, 0, 1});
    check_vec(Vec3(scene.meshes[0].tangents.at(0)), Vec3(-tangent.x, tangent.y, tangent.z));
    CHECK(scene.meshes[0].tangents.at(0).w == -tangent.w);
    const Bounds bounds = world_bounds(scene);
    check_vec(bounds.min, {-2, 0, 0});
    check_vec(bounds.max, {0, 1, 0});
}

TEST_CASE("instances share meshes; emitting ones get their own when flattened") {
    GltfBuilder builder = triangle_builder();
    builder.add_node({{"mesh", 0}, {"translation", {5, 0, 0}}});
    builder.add("materials", {{"name", "paint"}});
    first_primitive(builder)["material"] = 0;
    Json second = first_primitive(builder);
    builder.json["meshes"][0]["primitives"].push_back(second);
    SUBCASE("not emitting") {
        Scene scene = load(builder);
        CHECK(scene.meshes.size() == 2);
        CHECK(scene.objects.size() == 4);
        CHECK(scene.triangle_count() == 4);
        flatten_single_use_meshes(scene);
        CHECK(scene.meshes.size() == 2);
        check_vec(Vec3(scene.objects.at(2).to_world[3]), {5, 0, 0});
        check_vec(world_bounds(scene).max, {6, 1, 0});
    }
    SUBCASE("emitting") {
        builder.json["materials"][0]["emissiveFactor"] = {1, 1, 1};
        Scene scene = load(builder);
        flatten_single_use_meshes(scene);
        CHECK(scene.meshes.size() == 4);
        for (const Object& object : scene.objects) CHECK(object.to_world == Mat4(1.0F));
        for (const Mesh& mesh : scene.meshes) CHECK(mesh.positions.capacity() > mesh.positions.size());
        check_vec(world_bounds(scene).max, {6, 1, 0});
    }
}

TEST_CASE("scenes: the default one, the first one, or all roots") {
    GltfBuilder builder = triangle_builder();
    builder.add_node({{"mesh", 0}, {"name", "second"}});
    CHECK(load(builder).objects.size() == 2);
    builder.json["scenes"] = Json::array({{{"nodes", {0}}}, {{"nodes", {1}}}});
    CHECK(load(builder).objects.at(0).name == "triangle");
    builder.json["scene"] = 1;
    const Scene scene = load(builder);
    REQUIRE(scene.objects.size() == 1);
    CHECK(scene.objects[0].name == "second");
    builder.json["scene"] = 2;
    check_contains(load_error(builder), "scene");
}

TEST_CASE("node graphs that are no trees are refused") {
    GltfBuilder builder = triangle_builder();
    SUBCASE("cycle") {
        builder.add_node({{"children", {2}}});
        builder.add_node({{"children", {1}}});
        check_contains(load_error(builder), "cycle");
    }
    SUBCASE("own child") {
        builder.json["nodes"][0]["children"] = {0};
        check_contains(load_error(builder), "cycle");
    }
    SUBCASE("two parents") {
        builder.add_node({{"children", {0}}});
        builder.add_node({{"children", {0}}});
        check_contains(load_error(builder), "node 0: it has more than one parent");
    }
    SUBCASE("child as a root of the scene") {
        builder.add_node({{"children", {0}}});
        builder.json["scenes"] = Json::array({{{"nodes", {0, 1}}}});
        check_contains(load_error(builder), "scene 0");
    }
}

TEST_CASE("a chain of many nodes does not exhaust the stack") {
    GltfBuilder builder = triangle_builder();
    constexpr int length = 100000;
    Json nodes = Json::array({builder.json["nodes"][0]});
    for (int i = 1; i < length; ++i) nodes.push_back({{"children", {i - 1}}});
    builder.json["nodes"] = nodes;
    CHECK(load(builder).objects.size() == 1);
}

TEST_CASE("transforms that cannot be used") {
    GltfBuilder builder = triangle_builder();
    Json& node = builder.json["nodes"][0];
    SUBCASE("scaled to nothing: left out") {
        node["scale"] = {0, 0, 0};
        const Scene scene = load(builder);
        CHECK(scene.objects.empty());
        CHECK(has_warning(scene, "node 0"));
    }
    SUBCASE("too large") {
        node["translation"] = {1e30, 0, 0};
        check_contains(load_error(builder), "node 0");
    }
    SUBCASE("perspective matrix") {
        node["matrix"] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
        check_contains(load_error(builder), "node 0");
    }
    SUBCASE("no rotation") {
        node["rotation"] = {0, 0, 0, 0};
        check_contains(load_error(builder), "node 0");
    }
    SUBCASE("wrong number of values") {
        node["scale"] = {1, 1};
        check_contains(load_error(builder), "node 0 scale");
    }
}

TEST_CASE("extras.caustics = none is inherited") {
    GltfBuilder builder = triangle_builder();
    builder.add_node({{"children", {0}}, {"extras", {{"caustics", "none"}}}});
    builder.add_node({{"mesh", 0}});
    const Scene scene = load(builder);
    REQUIRE(scene.objects.size() == 2);
    CHECK(scene.objects[0].no_caustics);
    CHECK_FALSE(scene.objects[1].no_caustics);
}

TEST_CASE("extreme but invertible scales give unit normals and tangents when flattened") {
    GltfBuilder builder = textured_triangle({{"normalTexture", {{"index", 0}}}});
    builder.json["nodes"][0]["scale"] = {1e-25, 1e-12, 1e6};
    Scene scene = load(builder);
    REQUIRE(scene.objects.size() == 1);
    flatten_single_use_meshes(scene);
    for (const Vec3& normal : scene.meshes.at(0).normals) CHECK(glm::length(normal) == doctest::Approx(1.0F));
    for (const Vec4& tangent : scene.meshes.at(0).tangents) CHECK(glm::length(Vec3(tangent)) == doctest::Approx(1.0F));
}

TEST_CASE("coordinates and transforms that leave the range of floats are refused") {
    GltfBuilder builder = triangle_builder();
    SUBCASE("positions") {
        first_primitive(builder)["attributes"]["POSITION"] =
            builder.add_accessor<float>({0, 0, 0, 1e20F, 0, 0, 0, 1, 0}, "VEC3", component_float);
        builder.json["nodes"][0]["scale"] = {1e-12, 1e-12, 1e-12};
        check_contains(load_error(builder), "mesh 0 primitive 0");
    }
    SUBCASE("a product of transforms") {
        builder.json["nodes"][0]["scale"] = {1e8, 1e8, 1e8};
        builder.add_node({{"children", {0}}, {"scale", {1e8, 1e8, 1e8}}});
        check_contains(load_error(builder), "node 0");
    }
    SUBCASE("the position of a light") {
        builder.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({{{"type", "point"}}});
        builder.json["nodes"][0] = {{"translation", {0, 1e20, 0}},
                                    {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}};
        check_contains(load_error(builder), "node 0");
    }
}

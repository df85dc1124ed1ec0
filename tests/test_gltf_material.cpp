// Loading of glTF files: materials, textures, tangents, lights and cameras.
#include <doctest/doctest.h>

#include <cmath>

#include "core/gltf.h"
#include "core/mesh_attributes.h"
#include "core/scene.h"
#include "tests/gltf_builder.h"

using namespace nephroid;
using namespace nephroid::test;

namespace {

Material load_material(const Json& material) {
    return load(textured_triangle(material)).materials.at(0);
}

}  // namespace

TEST_CASE("material factors") {
    const Material material = load_material(
        {{"name", "paint"},
         {"pbrMetallicRoughness",
          {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}}, {"metallicFactor", 0.5}, {"roughnessFactor", 0.25}}},
         {"emissiveFactor", {1, 0.5, 0}},
         {"alphaMode", "MASK"},
         {"alphaCutoff", 0.75},
         {"doubleSided", true},
         {"extensions",
          {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}},
           {"KHR_materials_ior", {{"ior", 1.33}}},
           {"KHR_materials_specular", {{"specularFactor", 0.5}, {"specularColorFactor", {1, 2, 0.5}}}}}}});
    CHECK(material.name == "paint");
    CHECK(material.base_color.a == doctest::Approx(0.4F));
    CHECK(material.metallic == 0.5F);
    CHECK(material.roughness == 0.25F);
    check_vec(material.emission, {8, 4, 0});
    CHECK(material.alpha_mode == AlphaMode::mask);
    CHECK(material.alpha_cutoff == 0.75F);
    CHECK(material.double_sided);
    CHECK(material.ior == doctest::Approx(1.33F));
    CHECK(material.specular == 0.5F);
    check_vec(material.specular_color, {1, 2, 0.5F});
}

TEST_CASE("material defaults and special values") {
    const Material plain = load_material(Json::object());
    CHECK(plain.base_color == Vec4(1.0F));
    CHECK(plain.metallic == 1.0F);
    CHECK(plain.roughness == 1.0F);
    CHECK(plain.ior == 1.5F);
    CHECK_FALSE(plain.emits());
    CHECK(load(triangle_builder()).materials.at(0).metallic == 1.0F);

    CHECK(load_material({{"extensions", {{"KHR_materials_ior", {{"ior", 0}}}}}}).ior == 0.0F);
    const Scene clamped = load(textured_triangle({{"pbrMetallicRoughness", {{"metallicFactor", 7}}}}));
    CHECK(clamped.materials.at(0).metallic == 1.0F);
    CHECK(has_warning(clamped, "material 0"));
}

TEST_CASE("materials that are replaced by something simpler") {
    const Scene unlit = load(textured_triangle({{"extensions", {{"KHR_materials_unlit", Json::object()}}}}));
    CHECK(unlit.materials.at(0).specular == 0.0F);
    CHECK(unlit.materials.at(0).metallic == 0.0F);
    CHECK(has_warning(unlit, "unlit"));
    const Scene glass = load(textured_triangle(
        {{"extensions",
          {{"KHR_materials_transmission", {{"transmissionFactor", 1}}}, {"KHR_materials_volume", Json::object()}}}}));
    CHECK(has_warning(glass, "transmission"));
    CHECK(has_warning(glass, "volume"));
}

TEST_CASE("textures") {
    GltfBuilder builder = textured_triangle(
        {{"pbrMetallicRoughness",
          {{"baseColorTexture",
            {{"index", 0},
             {"texCoord", 1},
             {"extensions",
              {{"KHR_texture_transform",
                {{"offset", {0.25, 0.5}}, {"rotation", std::acos(-1.0) / 2}, {"scale", {2, 3}}, {"texCoord", 0}}}}}}},
           {"metallicRoughnessTexture", {{"index", 0}}}}}});
    builder.add("samplers", {{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}});
    builder.json["textures"][0]["sampler"] = 0;
    const Scene scene = load(builder);
    REQUIRE(scene.images.size() == 1);
    CHECK(scene.images[0].bytes == std::vector<uint8_t>{255, 128, 0});
    CHECK(scene.meshes.at(0).uvs[0].size() == 3);
    CHECK(scene.meshes.at(0).uvs[1].empty());
    const TextureReference& base = scene.materials.at(0).base_color_texture;
    CHECK(base.image == 0);
    CHECK(base.srgb);
    CHECK(base.uv_set == 0);
    CHECK(base.wrap_u == WrapMode::clamp_to_edge);
    CHECK(base.wrap_v == WrapMode::mirrored_repeat);
    CHECK(base.nearest);
    const Vec2 uv = base.uv_matrix * Vec2(0.1F, 0.2F) + base.uv_offset;
    CHECK(uv.x == doctest::Approx(0.25 + 0.6));
    CHECK(uv.y == doctest::Approx(0.5 - 0.2));
    CHECK_FALSE(scene.materials.at(0).metallic_roughness_texture.srgb);
    CHECK(scene.materials.at(0).emissive_texture.image == -1);
}

TEST_CASE("grey pictures become RGB, 16-bit sRGB pictures linear") {
    GltfBuilder builder = textured_triangle({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}, {0.5F});
    Scene scene = load(builder);
    CHECK(scene.images.at(0).bytes == std::vector<uint8_t>{128, 128, 128});
    builder.json["images"][0]["bufferView"] =
        builder.add_view_bytes(encode_picture("png", 1, 1, 3, {0.5F, 1.0F, 0.0F}, true));
    builder.json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", 0}};
    scene = load(builder);
    REQUIRE(scene.images.size() == 2);
    const int base = scene.materials.at(0).base_color_texture.image;
    const int data = scene.materials.at(0).metallic_roughness_texture.image;
    CHECK(scene.images[static_cast<size_t>(base)].floats[0] == doctest::Approx(0.2140F).epsilon(1e-3));
    CHECK(scene.images[static_cast<size_t>(data)].floats[0] == doctest::Approx(0.5F).epsilon(1e-3));
}

TEST_CASE("pictures that no material uses are not decoded") {
    GltfBuilder builder = textured_triangle(Json::object());
    builder.json["images"][0] = {{"uri", "missing.png"}};
    CHECK(load(builder).images.empty());
    builder.json["materials"][0]["normalTexture"] = {{"index", 0}};
    check_contains(load_error(builder), "image 0");
}

TEST_CASE("tangents follow the texture") {
    GltfBuilder builder = textured_triangle({{"normalTexture", {{"index", 0}, {"scale", 0.5}}}});
    SUBCASE("u along x, v up: the picture is upside down, its up is -y") {
        const Scene scene = load(builder);
        CHECK(scene.materials.at(0).normal_scale == 0.5F);
        const Vec4 tangent = scene.meshes.at(0).tangents.at(0);
        check_vec(Vec3(tangent), {1, 0, 0});
        CHECK(tangent.w == -1.0F);
    }
    SUBCASE("u along x, v down: the picture is upright") {
        first_primitive(builder)["attributes"]["TEXCOORD_0"] =
            builder.add_accessor<float>({0, 1, 1, 1, 0, 0}, "VEC2", component_float);
        const Vec4 tangent = load(builder).meshes.at(0).tangents.at(0);
        check_vec(Vec3(tangent), {1, 0, 0});
        CHECK(tangent.w == 1.0F);
    }
    SUBCASE("given in the file") {
        first_primitive(builder)["attributes"]["TANGENT"] =
            builder.add_accessor<float>({0, 2, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1}, "VEC4", component_float);
        check_vec(Vec3(load(builder).meshes.at(0).tangents.at(0)), {0, 1, 0});
    }
    SUBCASE("without normals and with degenerate uv they are still orthogonal to the triangle") {
        first_primitive(builder)["attributes"].erase("NORMAL");
        first_primitive(builder)["attributes"].erase("TEXCOORD_0");
        const Scene scene = load(builder);
        CHECK(scene.meshes.at(0).normals.empty());
        const Vec4 tangent = scene.meshes.at(0).tangents.at(0);
        CHECK(glm::length(Vec3(tangent)) == doctest::Approx(1.0F));
        CHECK(tangent.z == doctest::Approx(0.0F));
        CHECK(has_warning(scene, "TEXCOORD_0"));
    }
}

TEST_CASE("vertices on the seam of a mirrored texture are split") {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}};
    mesh.normals.assign(4, Vec3(0, 0, 1));
    mesh.uvs[0] = {{0, 1}, {1, 1}, {0, 0}, {1, 1}};  // Both sides have u growing away from the seam.
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    compute_tangents(mesh, 0, glm::mat2(1.0F));
    CHECK(mesh.positions.size() == 6);
    CHECK(mesh.positions.capacity() > mesh.positions.size());
    for (const uint32_t vertex : mesh.triangles[0]) CHECK(mesh.tangents[vertex] == Vec4(1, 0, 0, 1));
    for (const uint32_t vertex : mesh.triangles[1]) CHECK(mesh.tangents[vertex] == Vec4(-1, 0, 0, -1));
}

TEST_CASE("punctual lights") {
    GltfBuilder builder = triangle_builder();
    builder.json["extensions"]["KHR_lights_punctual"]["lights"] =
        Json::array({{{"type", "point"}, {"name", "bulb"}, {"intensity", 10}, {"color", {1, 0.5, 0}}},
                     {{"type", "spot"}, {"intensity", 2}, {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.2}}}},
                     {{"type", "directional"}},
                     {{"type", "point"}, {"extras", {{"radius", 0.25}}}, {"range", 10}}});
    const auto light_node = [](int light) {
        return Json{{"translation", {1, 2, 3}},
                    {"rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)}},  // -Z turns to -Y.
                    {"scale", {3, 3, 3}},
                    {"extensions", {{"KHR_lights_punctual", {{"light", light}}}}}};
    };
    for (int light = 0; light < 4; ++light) builder.add_node(light_node(light));
    Json node = light_node(3);
    node["extras"]["radius"] = 0.5;
    builder.add_node(node);
    const Scene scene = load(builder);
    REQUIRE(scene.lights.size() == 5);
    CHECK(scene.lights[0].kind == LightKind::point);
    CHECK(scene.lights[0].name == "bulb");
    check_vec(scene.lights[0].intensity, {10, 5, 0});
    check_vec(scene.lights[0].position, {1, 2, 3});
    CHECK(scene.lights[1].kind == LightKind::spot);
    check_vec(scene.lights[1].direction, {0, -1, 0});
    CHECK(scene.lights[1].cos_inner == doctest::Approx(std::cos(0.1)));
    CHECK(scene.lights[1].cos_outer == doctest::Approx(std::cos(0.2)));
    CHECK(scene.lights[2].kind == LightKind::directional);
    check_vec(scene.lights[2].direction, {0, -1, 0});
    check_vec(scene.lights[2].intensity, {1, 1, 1});
    CHECK(scene.lights[3].kind == LightKind::sphere);
    CHECK(scene.lights[3].radius == 0.25F);
    CHECK(scene.lights[4].radius == 0.5F);
    CHECK(has_warning(scene, "range"));
}

TEST_CASE("wrong lights") {
    GltfBuilder builder = triangle_builder();
    Json light = {{"type", "point"}};
    SUBCASE("unknown type") {
        light["type"] = "area";
    }
    SUBCASE("negative") {
        light["intensity"] = -1;
    }
    SUBCASE("radius is text") {
        light["extras"]["radius"] = "big";
    }
    SUBCASE("negative radius") {
        light["extras"]["radius"] = -1;
    }
    builder.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({light});
    builder.add_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    check_contains(load_error(builder), "light 0");
}

TEST_CASE("cameras") {
    GltfBuilder builder = triangle_builder();
    builder.add("cameras",
                {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}, {"aspectRatio", 1.5}}}});
    builder.add("cameras", {{"type", "orthographic"},
                            {"name", "top"},
                            {"orthographic", {{"xmag", 2}, {"ymag", 1}, {"znear", 0}, {"zfar", 10}}}});
    builder.add_node({{"camera", 1}, {"name", "first"}});
    builder.add_node({{"camera", 0}, {"name", "second"}, {"translation", {0, 0, 5}}, {"scale", {2, 2, 2}}});
    const Scene scene = load(builder);
    REQUIRE(scene.cameras.size() == 2);
    CHECK(scene.cameras[0].name == "top");
    CHECK(scene.cameras[0].kind == CameraKind::orthographic);
    CHECK(scene.cameras[0].xmag == 2.0F);
    CHECK(scene.cameras[1].name == "second");
    CHECK(scene.cameras[1].yfov == doctest::Approx(0.7));
    CHECK(scene.cameras[1].aspect == doctest::Approx(1.5));
    check_vec(Vec3(scene.cameras[1].to_world[3]), {0, 0, 5});
    check_vec(Vec3(scene.cameras[1].to_world[1]), {0, 1, 0});
    builder.json["cameras"][0]["perspective"]["yfov"] = 4;
    check_contains(load_error(builder), "camera 0");
}

// Loading of glTF files: geometry and what is refused.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "core/gltf.h"
#include "core/scene.h"
#include "tests/gltf_builder.h"

using namespace nephroid;
using namespace nephroid::test;

TEST_CASE("a triangle loads from GLB, data URI and external buffer alike") {
    const TemporaryFolder folder;
    GltfBuilder builder = triangle_builder();
    write_file(folder.file("a.glb"), builder.glb());
    write_file(folder.file("b.gltf"), builder.gltf());
    builder.json["buffers"] = Json::array({{{"byteLength", builder.binary.size()}, {"uri", "my%20data.bin"}}});
    write_file(folder.file("my data.bin"), builder.binary);
    write_file(folder.file("c.gltf"), builder.gltf());
    for (const char* name : {"a.glb", "b.gltf", "c.gltf"}) {
        const Scene scene = load_gltf(folder.file(name));
        CHECK(scene.warnings.empty());
        REQUIRE(scene.meshes.size() == 1);
        REQUIRE(scene.objects.size() == 1);
        CHECK(scene.objects[0].name == "triangle");
        const Mesh& mesh = scene.meshes[0];
        CHECK(mesh.triangles == std::vector<Triangle>{{0, 1, 2}});
        check_vec(mesh.positions.at(1), {1, 0, 0});
        CHECK(mesh.positions.capacity() > mesh.positions.size());
        check_vec(mesh.normals.at(2), {0, 0, 1});
        CHECK(mesh.uvs[0].empty());  // The material has no texture.
        CHECK(mesh.tangents.empty());
        CHECK(mesh.colors.empty());
        CHECK(scene.triangle_count() == 1);
    }
}

TEST_CASE("index types, and no indices") {
    const auto triangle_of = [](GltfBuilder builder, int accessor) {
        first_primitive(builder)["indices"] = accessor;
        return load(builder).meshes.at(0).triangles.at(0);
    };
    GltfBuilder builder = triangle_builder();
    const int u8 = builder.add_accessor<uint8_t>({2, 1, 0}, "SCALAR", component_u8);
    const int u32 = builder.add_accessor<uint32_t>({2, 0, 1}, "SCALAR", component_u32);
    CHECK(triangle_of(builder, u8) == Triangle{2, 1, 0});
    CHECK(triangle_of(builder, u32) == Triangle{2, 0, 1});
    first_primitive(builder).erase("indices");
    CHECK(load(builder).meshes.at(0).triangles.at(0) == Triangle{0, 1, 2});
}

TEST_CASE("wrong indices are refused") {
    GltfBuilder builder = triangle_builder();
    SUBCASE("out of range") {
        first_primitive(builder)["indices"] = builder.add_accessor<uint16_t>({0, 1, 3}, "SCALAR", component_u16);
        check_contains(load_error(builder), "mesh 0 primitive 0: index 3");
    }
    SUBCASE("primitive restart") {
        first_primitive(builder)["indices"] = builder.add_accessor<uint16_t>({0, 1, 65535}, "SCALAR", component_u16);
        check_contains(load_error(builder), "restart");
    }
    SUBCASE("not a multiple of three") {
        first_primitive(builder)["indices"] = builder.add_accessor<uint16_t>({0, 1, 2, 0}, "SCALAR", component_u16);
        check_contains(load_error(builder), "multiple of 3");
    }
    SUBCASE("of a signed type") {
        first_primitive(builder)["indices"] = builder.add_accessor<int16_t>({0, 1, 2}, "SCALAR", component_i16);
        check_contains(load_error(builder), "unsigned");
    }
}

TEST_CASE("strips and fans keep the facing of their first triangle") {
    GltfBuilder builder;
    const int positions = builder.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, "VEC3", component_float);
    const int strip = builder.add_accessor<uint16_t>({0, 1, 2, 3}, "SCALAR", component_u16);
    const int fan = builder.add_accessor<uint16_t>({0, 1, 3, 2}, "SCALAR", component_u16);
    builder.add_node({{"mesh", builder.add_mesh({{"POSITION", positions}}, strip)}});
    builder.add_node({{"mesh", builder.add_mesh({{"POSITION", positions}}, fan)}});
    builder.json["meshes"][0]["primitives"][0]["mode"] = 5;
    builder.json["meshes"][1]["primitives"][0]["mode"] = 6;
    const Scene scene = load(builder);
    REQUIRE(scene.objects.size() == 2);
    for (const Object& object : scene.objects) {
        for (size_t triangle = 0; triangle < 2; ++triangle) {
            check_vec(world_face_normal(scene, object, triangle), {0, 0, 1});
        }
    }
    CHECK(scene.meshes[0].normals.empty());
}

TEST_CASE("points, lines and primitives without positions are left out with a warning") {
    GltfBuilder builder = triangle_builder();
    SUBCASE("lines") {
        first_primitive(builder)["mode"] = 1;
    }
    SUBCASE("points") {
        first_primitive(builder)["mode"] = 0;
    }
    SUBCASE("no positions") {
        first_primitive(builder)["attributes"].erase("POSITION");
    }
    const Scene scene = load(builder);
    CHECK(scene.objects.empty());
    CHECK(has_warning(scene, "mesh 0 primitive 0"));
}

TEST_CASE("byte stride and offsets") {
    GltfBuilder builder = triangle_builder();
    // Interleaved: position, padding.
    const int view = builder.add_view<float>({9, 0, 0, 0, 7, 2, 0, 0, 7, 0, 2, 0});
    builder.json["bufferViews"][static_cast<size_t>(view)]["byteStride"] = 16;
    const int positions = builder.add_accessor_of_view(view, 3, "VEC3", component_float);
    builder.json["accessors"][static_cast<size_t>(positions)]["byteOffset"] = 4;
    first_primitive(builder)["attributes"]["POSITION"] = positions;
    const Scene scene = load(builder);
    check_vec(scene.meshes.at(0).positions.at(0), {0, 0, 0});
    check_vec(scene.meshes.at(0).positions.at(1), {2, 0, 0});
    check_vec(scene.meshes.at(0).positions.at(2), {0, 2, 0});
    builder.json["accessors"][static_cast<size_t>(positions)]["count"] = 4;
    check_contains(load_error(builder), "accessor 4");
}

TEST_CASE("sparse accessors") {
    GltfBuilder builder = triangle_builder();
    const int positions = 0;
    const int indices = builder.add_view<uint8_t>({2});
    const int values = builder.add_view<float>({0, 5, 0});
    Json& accessor = builder.json["accessors"][positions];
    accessor["sparse"] = {{"count", 1},
                          {"indices", {{"bufferView", indices}, {"componentType", component_u8}}},
                          {"values", {{"bufferView", values}}}};
    SUBCASE("over a buffer view") {
        const Scene scene = load(builder);
        check_vec(scene.meshes.at(0).positions.at(1), {1, 0, 0});
        check_vec(scene.meshes.at(0).positions.at(2), {0, 5, 0});
    }
    SUBCASE("over zeros") {
        accessor.erase("bufferView");
        const Scene scene = load(builder);
        check_vec(scene.meshes.at(0).positions.at(1), {0, 0, 0});
        check_vec(scene.meshes.at(0).positions.at(2), {0, 5, 0});
    }
    SUBCASE("of indices") {
        const int replaced = builder.add_view<uint16_t>({0, 0});
        builder.json["accessors"][3]["sparse"] = {
            {"count", 1},
            {"indices", {{"bufferView", indices}, {"componentType", component_u8}}},
            {"values", {{"bufferView", replaced}}}};
        CHECK(load(builder).meshes.at(0).triangles.at(0) == Triangle{0, 1, 0});
    }
    SUBCASE("index out of range") {
        accessor["sparse"]["indices"]["bufferView"] = builder.add_view<uint8_t>({3});
        check_contains(load_error(builder), "accessor 0 sparse");
    }
    SUBCASE("values out of range") {
        accessor["sparse"]["values"]["byteOffset"] = 4;
        check_contains(load_error(builder), "accessor 0 sparse values");
    }
    SUBCASE("more elements than the accessor") {
        accessor["sparse"]["count"] = 4;
        check_contains(load_error(builder), "accessor 0 sparse");
    }
}

TEST_CASE("quantized attributes") {
    GltfBuilder builder = triangle_builder();
    builder.json["extensionsRequired"] = {"KHR_mesh_quantization"};
    Json& attributes = first_primitive(builder)["attributes"];
    SUBCASE("positions: unsigned short, not normalized") {
        attributes["POSITION"] =
            builder.add_accessor<uint16_t>({0, 0, 0, 300, 0, 0, 0, 65535, 0}, "VEC3", component_u16);
        check_vec(load(builder).meshes.at(0).positions.at(2), {0, 65535, 0});
    }
    SUBCASE("positions: signed bytes, normalized, padded") {
        const int view = builder.add_view<int8_t>({-128, 0, 0, 0, 127, 0, 0, 0, 0, 127, 0, 0});
        builder.json["bufferViews"][static_cast<size_t>(view)]["byteStride"] = 4;
        attributes["POSITION"] = builder.add_accessor_of_view(view, 3, "VEC3", component_i8, true);
        const Scene scene = load(builder);
        check_vec(scene.meshes.at(0).positions.at(0), {-1, 0, 0});
        check_vec(scene.meshes.at(0).positions.at(1), {1, 0, 0});
    }
    SUBCASE("normals: signed shorts, normalized") {
        attributes["NORMAL"] =
            builder.add_accessor<int16_t>({0, 0, 32767, 0, 32767, 0, 32767, 0, 0}, "VEC3", component_i16, true);
        check_vec(load(builder).meshes.at(0).normals.at(1), {0, 1, 0});
    }
    SUBCASE("normals must be normalized") {
        attributes["NORMAL"] = builder.add_accessor<int16_t>({0, 0, 1, 0, 1, 0, 1, 0, 0}, "VEC3", component_i16);
        check_contains(load_error(builder), "NORMAL");
    }
}

TEST_CASE("vertex colours") {
    GltfBuilder builder = triangle_builder();
    Json& attributes = first_primitive(builder)["attributes"];
    SUBCASE("three floats") {
        attributes["COLOR_0"] =
            builder.add_accessor<float>({1, 0, 0, 0.5F, 0.25F, 0, 0, 0, 1}, "VEC3", component_float);
        CHECK(load(builder).meshes.at(0).colors.at(1) == Vec4(0.5F, 0.25F, 0.0F, 1.0F));
    }
    SUBCASE("four normalized bytes") {
        attributes["COLOR_0"] =
            builder.add_accessor<uint8_t>({255, 0, 0, 255, 0, 255, 0, 51, 0, 0, 255, 0}, "VEC4", component_u8, true);
        CHECK(load(builder).meshes.at(0).colors.at(1).a == doctest::Approx(0.2F));
    }
    SUBCASE("wrong type") {
        attributes["COLOR_0"] = builder.add_accessor<uint32_t>({1, 2, 3, 1, 2, 3, 1, 2, 3}, "VEC3", component_u32);
        check_contains(load_error(builder), "COLOR_0");
    }
}

TEST_CASE("normals of length zero come from the triangles, others become unit") {
    GltfBuilder builder = triangle_builder();
    first_primitive(builder)["attributes"]["NORMAL"] =
        builder.add_accessor<float>({0, 0, 0, 0, 3, 0, 0, 0, 1}, "VEC3", component_float);
    const Scene scene = load(builder);
    check_vec(scene.meshes.at(0).normals.at(0), {0, 0, 1});
    check_vec(scene.meshes.at(0).normals.at(1), {0, 1, 0});
    CHECK(has_warning(scene, "length 0"));
}

TEST_CASE("only the vertices that a primitive uses are kept of a shared buffer") {
    GltfBuilder builder;
    std::vector<float> values(3 * 100);
    for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i * i % 97);
    const int positions = builder.add_accessor(values, "VEC3", component_float);
    const int indices = builder.add_accessor<uint16_t>({90, 7, 50, 7, 90, 3}, "SCALAR", component_u16);
    builder.add_node({{"mesh", builder.add_mesh({{"POSITION", positions}}, indices)}});
    const Scene scene = load(builder);
    const Mesh& mesh = scene.meshes.at(0);
    CHECK(mesh.positions.size() == 4);
    CHECK(mesh.triangles == std::vector<Triangle>{{3, 1, 2}, {1, 3, 0}});
    check_vec(mesh.positions[3], {values[270], values[271], values[272]});
}

TEST_CASE("extensions: required unknown ones are refused by name, used ones warned about") {
    GltfBuilder builder = triangle_builder();
    builder.json["extensionsUsed"] = {"EXT_mesh_gpu_instancing", "KHR_materials_ior"};
    const Scene scene = load(builder);
    CHECK(scene.warnings.size() == 1);
    CHECK(has_warning(scene, "EXT_mesh_gpu_instancing"));
    builder.json["extensionsRequired"] = {"EXT_meshopt_compression"};
    check_contains(load_error(builder), "EXT_meshopt_compression");
}

TEST_CASE("animation, skins and morph targets are ignored with a warning") {
    GltfBuilder builder = triangle_builder();
    builder.json["animations"] = Json::array({Json::object()});
    builder.json["skins"] = Json::array({Json::object()});
    first_primitive(builder)["targets"] = Json::array({{{"POSITION", 0}}});
    const Scene scene = load(builder);
    CHECK(scene.objects.size() == 1);
    CHECK(has_warning(scene, "animation"));
    CHECK(has_warning(scene, "skin"));
    CHECK(has_warning(scene, "morph"));
}

TEST_CASE("values that are not finite are refused") {
    GltfBuilder builder = triangle_builder();
    const float bad = std::numeric_limits<float>::quiet_NaN();
    const int accessor = builder.add_accessor<float>({0, 0, 0, 1, bad, 0, 0, 1, 0}, "VEC3", component_float);
    for (const char* attribute : {"POSITION", "NORMAL"}) {
        GltfBuilder changed = builder;
        first_primitive(changed)["attributes"][attribute] = accessor;
        check_contains(load_error(changed), "accessor 4: element 1 is not finite");
    }
}

TEST_CASE("sizes beyond the file are refused without allocating them") {
    GltfBuilder builder = triangle_builder();
    SUBCASE("accessor longer than its view") {
        builder.json["accessors"][0]["count"] = 100;
        check_contains(load_error(builder), "accessor 0");
    }
    SUBCASE("accessor of zeros with a huge count") {
        for (int accessor : {0, 1, 2, 3}) {
            builder.json["accessors"][static_cast<size_t>(accessor)]["count"] = 2000000000;
            builder.json["accessors"][static_cast<size_t>(accessor)].erase("bufferView");
        }
        check_contains(load_error(builder), "too much memory");
    }
    SUBCASE("count beyond 2^31") {
        builder.json["accessors"][0]["count"] = uint64_t{1} << 40U;
        check_contains(load_error(builder), "accessor 0 count");
    }
    SUBCASE("buffer view beyond the buffer") {
        builder.json["bufferViews"][0]["byteOffset"] = 1000000;
        check_contains(load_error(builder), "buffer view 0");
    }
    SUBCASE("buffer longer than its data") {
        builder.json["buffers"] = Json::array({{{"byteLength", builder.binary.size() + 100}}});
        check_contains(load_error(builder), "buffer 0");
    }
}

TEST_CASE("indices of elements are checked everywhere") {
    const struct {
        const char* pointer;
        const char* element;
    } cases[] = {
        {"/nodes/0/mesh", "node 0 mesh"},
        {"/nodes/0/camera", "node 0 camera"},
        {"/nodes/0/children/0", "node 0 child 0"},
        {"/meshes/0/primitives/0/indices", "mesh 0 primitive 0 indices"},
        {"/meshes/0/primitives/0/material", "mesh 0 primitive 0 material"},
        {"/meshes/0/primitives/0/attributes/NORMAL", "mesh 0 primitive 0 attributes.NORMAL"},
        {"/accessors/0/bufferView", "accessor 0 bufferView"},
        {"/bufferViews/0/buffer", "buffer view 0 buffer"},
        {"/materials/0/normalTexture/index", "material 0 normalTexture.index"},
        {"/textures/0/source", "texture 0 source"},
        {"/textures/0/sampler", "texture 0 sampler"},
        {"/images/0/bufferView", "image 0 bufferView"},
    };
    for (const auto& entry : cases) {
        for (const Json& wrong : {Json(99), Json(-1), Json(4294967296), Json(0.5), Json("0"), Json(nullptr)}) {
            GltfBuilder builder = textured_triangle({{"normalTexture", {{"index", 0}}}});
            if (std::string(entry.pointer).find("children") != std::string::npos) {
                builder.json["nodes"][0]["children"] = {0};
            }
            builder.json["buffers"] = Json::array({{{"byteLength", builder.binary.size()}}});
            builder.json[Json::json_pointer(entry.pointer)] = wrong;
            check_contains(load_error(builder), std::string(entry.element) + ": ");
        }
    }
}

TEST_CASE("files outside of the scene's folder are refused") {
    const TemporaryFolder outside;
    const TemporaryFolder folder;
    GltfBuilder builder = triangle_builder();
    write_file(outside.file("secret.bin"), builder.binary);
    write_file(folder.file("inside.bin"), builder.binary);
    std::filesystem::create_directory(folder.file("sub"));
    std::filesystem::create_symlink(outside.file("secret.bin"), folder.file("link.bin"));
    std::filesystem::create_directory_symlink(outside.path(), folder.file("linked"));
    const auto error_for = [&](const std::string& uri) {
        builder.json["buffers"] = Json::array({{{"byteLength", builder.binary.size()}, {"uri", uri}}});
        write_file(folder.file("scene.gltf"), builder.gltf());
        return load_error(folder.file("scene.gltf"));
    };
    const std::string other = outside.path().filename().string();
    for (const std::string& uri :
         {outside.file("secret.bin"), "../" + other + "/secret.bin", "%2e%2e/" + other + "/secret.bin",
          "..%2F" + other + "%2Fsecret.bin", "sub/../../" + other + "/secret.bin", std::string("link.bin"),
          std::string("linked/secret.bin"), "file://" + outside.file("secret.bin"), std::string("http://host/a.bin"),
          std::string("..\\secret.bin"), std::string("inside.bin%00.png"), std::string(""), std::string("."),
          std::string("sub"), std::string("missing.bin")}) {
        INFO(uri);
        check_contains(error_for(uri), "buffer 0: ");
    }
    CHECK(error_for("inside.bin").empty());
    CHECK(error_for("sub/../inside.bin").empty());
    CHECK(error_for("./inside.bin").empty());
}

TEST_CASE("files that are no glTF") {
    const TemporaryFolder folder;
    const auto error_of = [&](const std::string& text) {
        write_file(folder.file("scene.gltf"), Bytes(text.begin(), text.end()));
        return load_error(folder.file("scene.gltf"));
    };
    check_contains(error_of(""), "JSON");
    check_contains(error_of("[]"), "not an object");
    check_contains(error_of("{}"), "asset");
    check_contains(error_of("{\"asset\": {\"version\": \"1.0\"}}"), "version 1.0");
    check_contains(error_of("{\"asset\": {\"version\": \"2.0\"}, \"x\": 1e999}"), "JSON");
    check_contains(error_of(std::string(100000, '[')), "nested");
    check_contains(error_of("glTF"), "truncated");
    CHECK(error_of("{\"asset\": {\"version\": \"2.0\"}}").empty());
    check_contains(load_error(folder.file("missing.glb")), "no file");
    check_contains(load_error(folder.path().string()), "not a file");
}

TEST_CASE("Draco: a compressed grid comes back") {
    GltfBuilder builder = draco_builder(8);
    builder.binary.push_back(0);
    Scene scene = load(builder);
    CHECK(scene.warnings.empty());
    const Mesh& mesh = scene.meshes.at(0);
    CHECK(mesh.triangles.size() == 128);
    CHECK(mesh.positions.size() == 81);
    CHECK(mesh.positions.capacity() > mesh.positions.size());
    float area = 0.0F;
    for (const Triangle& t : mesh.triangles) {
        const Vec3 edges =
            glm::cross(mesh.positions[t[1]] - mesh.positions[t[0]], mesh.positions[t[2]] - mesh.positions[t[0]]);
        CHECK(edges.z > 0.0F);
        area += 0.5F * edges.z;
    }
    CHECK(area == doctest::Approx(1.0F).epsilon(1e-3));
    for (const Vec3& p : mesh.positions) CHECK(std::abs(p.z - p.x * p.y) < 1e-3F);
    for (const Vec3& n : mesh.normals) check_vec(n, {0, 0, 1}, 0.01F);
}

TEST_CASE("Draco: attributes go by their unique id") {
    GltfBuilder builder = draco_builder(2);
    Json& attributes = first_primitive(builder)["extensions"]["KHR_draco_mesh_compression"]["attributes"];
    SUBCASE("unknown id") {
        attributes["POSITION"] = 77;
    }
    SUBCASE("another number of components") {
        attributes["POSITION"] = attributes["TEXCOORD_0"];
    }
    SUBCASE("buffer view that is not Draco") {
        const int view = builder.add_view<float>({1, 2, 3, 4, 5, 6, 7, 8});
        first_primitive(builder)["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = view;
    }
    check_contains(load_error(builder), "mesh 0 primitive 0: its Draco data are malformed");
}

TEST_CASE("large integers in extensions keep their value") {
    CHECK(load(textured_triangle(
                   {{"emissiveFactor", {1, 1, 1}},
                    {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 5000000000}}}}}}))
              .materials.at(0)
              .emission.r == 5e9F);
}

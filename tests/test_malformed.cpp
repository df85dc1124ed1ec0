// Mutated input: whatever a file holds, it loads or is refused with an error line. Nothing else may happen.
#include <doctest/doctest.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <random>

#include "core/gltf.h"
#include "core/image_io.h"
#include "tests/gltf_builder.h"

using namespace nephroid;
using namespace nephroid::test;

namespace {

using Random = std::mt19937;

size_t below(Random& random, size_t bound) {
    return std::uniform_int_distribution<size_t>(0, bound - 1)(random);
}

double peak_megabytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// What all loads of a test together took at most.
struct Cost {
    double seconds = 0.0;
    double peak_before = peak_megabytes();
    int loaded = 0;
    int refused = 0;
};

/// Runs the action, which may only succeed or throw Error(invalid_input) with a single line.
void run(const std::function<void()>& action, Cost& cost) {
    const auto start = std::chrono::steady_clock::now();
    try {
        action();
        ++cost.loaded;
    } catch (const Error& error) {
        CHECK(error.code() == ExitCode::invalid_input);
        CHECK(std::string(error.what()).find('\n') == std::string::npos);
        ++cost.refused;
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    cost.seconds = std::max(cost.seconds, elapsed.count());
}

/// What later parts of the renderer rely on without checking.
void check_valid(const Scene& scene) {
    const auto finite = [](const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
    bool valid = true;
    for (const Mesh& mesh : scene.meshes) {
        const size_t vertices = mesh.positions.size();
        valid &= static_cast<size_t>(mesh.material) < scene.materials.size();
        valid &= mesh.positions.capacity() > vertices;
        for (const Triangle& triangle : mesh.triangles) {
            for (const uint32_t vertex : triangle) valid &= vertex < vertices;
        }
        for (const size_t size :
             {mesh.normals.size(), mesh.uvs[0].size(), mesh.uvs[1].size(), mesh.tangents.size(), mesh.colors.size()}) {
            valid &= size == 0 || size == vertices;
        }
        valid &= std::all_of(mesh.positions.begin(), mesh.positions.end(), finite);
        valid &= std::all_of(mesh.normals.begin(), mesh.normals.end(),
                             [](const Vec3& n) { return std::abs(glm::length(n) - 1.0F) < 1e-3F; });
        valid &= std::all_of(mesh.tangents.begin(), mesh.tangents.end(),
                             [](const Vec4& t) { return std::abs(glm::length(Vec3(t)) - 1.0F) < 1e-3F; });
    }
    for (const Object& object : scene.objects) {
        valid &= static_cast<size_t>(object.mesh) < scene.meshes.size();
        for (int column = 0; column < 4; ++column) valid &= finite(Vec3(object.to_world[column]));
    }
    for (const Material& material : scene.materials) {
        valid &= finite(Vec3(material.base_color)) && finite(material.emission) && std::isfinite(material.ior);
        for (const TextureReference* reference : {&material.base_color_texture, &material.metallic_roughness_texture,
                                                  &material.normal_texture, &material.emissive_texture}) {
            valid &= reference->image < static_cast<int>(scene.images.size());
            valid &= reference->uv_set == 0 || reference->uv_set == 1;
        }
    }
    CHECK(valid);
}

void load_bytes(const TemporaryFolder& folder, const char* name, const Bytes& bytes, Cost& cost) {
    write_file(folder.file(name), bytes);
    run(
        [&] {
            Scene scene = load_gltf(folder.file(name));
            check_valid(scene);
            flatten_single_use_meshes(scene);
            check_valid(scene);
        },
        cost);
}

Bytes mutate_bytes(Bytes bytes, Random& random) {
    const size_t count = 1 + below(random, 3);
    for (size_t i = 0; i < count && !bytes.empty(); ++i) {
        const size_t position = below(random, bytes.size());
        switch (below(random, 12)) {  // Most often a single changed byte: it gets furthest.
            case 0:
                bytes.resize(position);
                break;
            case 1:
            case 2:
            case 3:
                bytes[position] = static_cast<uint8_t>(below(random, 256));
                break;
            case 4:
            case 5:
            case 6:
            case 7:
                bytes[position] ^= static_cast<uint8_t>(1U << below(random, 8));
                break;
            case 8:
            case 9:
            case 10: {  // A run of equal bytes: lengths and counts become huge, or zero.
                const size_t end = std::min(position + 4, bytes.size());
                const uint8_t value = below(random, 2) == 0 ? 0xFF : 0x00;
                std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(position),
                          bytes.begin() + static_cast<std::ptrdiff_t>(end), value);
                break;
            }
            default: {  // A part of the file once more in another place.
                const size_t from = below(random, bytes.size());
                const size_t length = std::min(below(random, 64) + 1, bytes.size() - from);
                const Bytes part(bytes.begin() + static_cast<std::ptrdiff_t>(from),
                                 bytes.begin() + static_cast<std::ptrdiff_t>(from + length));
                bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(position), part.begin(), part.end());
            }
        }
    }
    return bytes;
}

/// All values of the document, below the root.
void collect(Json& json, std::vector<Json*>& values) {
    for (auto it = json.begin(); it != json.end(); ++it) {
        values.push_back(&*it);
        if (it->is_structured()) collect(*it, values);
    }
}

Json extreme_value(Random& random) {
    const Json values[] = {-1,
                           0,
                           1,
                           2,
                           4294967296,
                           2147483647,
                           1e308,
                           -1e308,
                           1e-320,
                           nullptr,
                           true,
                           "",
                           "x",
                           "../x",
                           Json::array(),
                           Json::object(),
                           0.5,
                           65535,
                           255,
                           {0},
                           {-1},
                           5126,
                           5121,
                           1099511627776,
                           18446744073709551615U,
                           Json::array({nullptr}),
                           Json::array({1e308, 1e308, 1e308})};
    return values[below(random, std::size(values))];
}

void mutate_json(Json& json, Random& random) {
    const size_t count = 1 + below(random, 3);
    for (size_t i = 0; i < count; ++i) {
        std::vector<Json*> values;
        collect(json, values);
        if (values.empty()) return;
        Json& value = *values[below(random, values.size())];
        switch (below(random, 5)) {
            case 0:
                value = extreme_value(random);
                break;
            case 1:
                value = Json(*values[below(random, values.size())]);
                break;
            case 2:
                if (value.is_object() && !value.empty()) {
                    value.erase(
                        std::next(value.begin(), static_cast<std::ptrdiff_t>(below(random, value.size()))).key());
                } else if (value.is_array() && !value.empty()) {
                    value.erase(below(random, value.size()));
                } else {
                    value = extreme_value(random);
                }
                break;
            case 3:
                if (value.is_array() && !value.empty()) {
                    value.push_back(Json(value[0]));
                } else if (value.is_number_integer()) {
                    value = value.get<int64_t>() + (below(random, 2) == 0 ? 1 : -1);
                } else {
                    value = extreme_value(random);
                }
                break;
            default:
                if (value.is_number()) value = extreme_value(random);
        }
    }
}

/// A scene that uses most of what the loader knows.
GltfBuilder rich_builder() {
    GltfBuilder builder = textured_triangle(
        {{"name", "paint"},
         {"pbrMetallicRoughness",
          {{"baseColorFactor", {0.5, 0.5, 0.5, 1}},
           {"baseColorTexture",
            {{"index", 0},
             {"extensions",
              {{"KHR_texture_transform", {{"offset", {0, 1}}, {"rotation", 0.5}, {"scale", {2, 2}}}}}}}}}},
         {"normalTexture", {{"index", 0}, {"scale", 0.5}}},
         {"emissiveFactor", {1, 1, 0}},
         {"extensions",
          {{"KHR_materials_emissive_strength", {{"emissiveStrength", 3}}},
           {"KHR_materials_ior", {{"ior", 1.4}}},
           {"KHR_materials_specular", {{"specularFactor", 0.5}, {"specularColorFactor", {1, 1, 1}}}}}}});
    builder.add("samplers", {{"wrapS", 33071}, {"wrapT", 33648}});
    builder.json["textures"][0]["sampler"] = 0;
    first_primitive(builder)["attributes"]["COLOR_0"] =
        builder.add_accessor<uint8_t>({1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 2, 3}, "VEC4", component_u8, true);
    builder.json["accessors"][0]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", builder.add_view<uint16_t>({1})}, {"componentType", component_u16}}},
        {"values", {{"bufferView", builder.add_view<float>({2, 0, 0})}}}};
    Json strip = first_primitive(builder);
    strip["mode"] = 5;
    builder.json["meshes"][0]["primitives"].push_back(strip);
    builder.json["extensions"]["KHR_lights_punctual"]["lights"] =
        Json::array({{{"type", "point"}, {"intensity", 5}, {"color", {1, 1, 1}}, {"extras", {{"radius", 0.1}}}},
                     {{"type", "spot"}, {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.5}}}}});
    builder.add("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
    builder.add_node({{"mesh", 0}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1}}});
    builder.add_node(
        {{"children", {0, 1}}, {"rotation", {0, 0, 0, 1}}, {"scale", {1, 2, 1}}, {"extras", {{"caustics", "none"}}}});
    builder.add_node({{"camera", 0}, {"translation", {0, 0, 5}}});
    builder.add_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    builder.add_node({{"extensions", {{"KHR_lights_punctual", {{"light", 1}}}}}});
    builder.json["scenes"] = Json::array({{{"nodes", {2, 3, 4, 5}}}});
    builder.json["scene"] = 0;
    builder.json["buffers"] = Json::array({{{"byteLength", builder.binary.size()}}});
    return builder;
}

void check_cost(const Cost& cost, int total) {
    INFO(cost.loaded << " loaded, " << cost.refused << " refused, slowest " << cost.seconds << " s, peak "
                     << peak_megabytes() << " MB");
    CHECK(cost.loaded + cost.refused == total);
    CHECK(cost.refused > 0);
    CHECK(cost.seconds < 10.0);
    // Other tests of this process may have needed more before.
    const double peak = peak_megabytes();
    CHECK((peak < 2048.0 || peak == cost.peak_before));
}

void mutate_files(const Bytes& seed_file, const char* name, int count, unsigned seed) {
    const TemporaryFolder folder;
    Cost cost;
    Random random(seed);
    load_bytes(folder, name, seed_file, cost);
    REQUIRE(cost.loaded == 1);
    for (int i = 0; i < count; ++i) load_bytes(folder, name, mutate_bytes(seed_file, random), cost);
    check_cost(cost, count + 1);
}

}  // namespace

TEST_CASE("mutated bytes of a GLB with a texture") {
    mutate_files(rich_builder().glb(), "scene.glb", 300, 1);
}

TEST_CASE("mutated bytes of a glTF with a data URI") {
    GltfBuilder builder = rich_builder();
    builder.json.erase("buffers");
    mutate_files(builder.gltf(), "scene.gltf", 300, 2);
}

TEST_CASE("mutated bytes of a Draco GLB") {
    mutate_files(draco_builder(6).glb(), "scene.glb", 200, 3);
}

TEST_CASE("mutated bytes within the Draco stream") {
    const GltfBuilder builder = draco_builder(6);
    const TemporaryFolder folder;
    Cost cost;
    Random random(4);
    for (int i = 0; i < 300; ++i) {
        GltfBuilder mutated = builder;
        mutated.binary = mutate_bytes(builder.binary, random);
        if (mutated.binary.empty()) mutated.binary = {0};
        mutated.json["bufferViews"][0]["byteLength"] = mutated.binary.size();
        load_bytes(folder, "scene.glb", mutated.glb(), cost);
    }
    check_cost(cost, 300);
}

TEST_CASE("mutated structure of the document") {
    const TemporaryFolder folder;
    Cost cost;
    Random random(5);
    for (const GltfBuilder& builder : {rich_builder(), draco_builder(3)}) {
        for (int i = 0; i < 400; ++i) {
            GltfBuilder mutated = builder;
            mutate_json(mutated.json, random);
            load_bytes(folder, "scene.glb", mutated.glb(), cost);
        }
    }
    check_cost(cost, 800);
}

TEST_CASE("every truncation of a GLB") {
    const TemporaryFolder folder;
    const Bytes whole = triangle_builder().glb();
    Cost cost;
    int count = 0;
    for (size_t size = 0; size < whole.size(); size += 7) {
        load_bytes(folder, "scene.glb", Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)), cost);
        ++count;
    }
    CHECK(cost.loaded == 0);
    check_cost(cost, count);
}

TEST_CASE("GLB chunks deleted, doubled and exchanged") {
    const TemporaryFolder folder;
    const GltfBuilder builder = triangle_builder();
    const Bytes whole = builder.glb();
    const size_t json_end = 20 + (whole[12] | static_cast<size_t>(whole[13]) << 8U);
    const Bytes header(whole.begin(), whole.begin() + 12);
    const Bytes json(whole.begin() + 12, whole.begin() + static_cast<std::ptrdiff_t>(json_end));
    const Bytes binary(whole.begin() + static_cast<std::ptrdiff_t>(json_end), whole.end());
    Cost cost;
    const auto load_chunks = [&](const std::vector<Bytes>& chunks) {
        Bytes file = header;
        for (const Bytes& chunk : chunks) file.insert(file.end(), chunk.begin(), chunk.end());
        for (unsigned i = 0; i < 4; ++i) file[8 + i] = static_cast<uint8_t>(file.size() >> (8 * i) & 0xFFU);
        load_bytes(folder, "scene.glb", file, cost);
    };
    load_chunks({});
    load_chunks({json});
    load_chunks({binary});
    load_chunks({binary, json});
    CHECK(cost.loaded == 0);
    load_chunks({json, binary, binary});
    load_chunks({json, binary, json});
    CHECK(cost.loaded == 2);
    load_chunks({json, json, binary});
    CHECK(cost.loaded == 2);
}

TEST_CASE("mutated pictures") {
    std::vector<float> values;
    for (int i = 0; i < 16 * 16 * 4; ++i) values.push_back(static_cast<float>(i * 37 % 101) / 100.0F);
    const std::vector<float> rgb(values.begin(), values.begin() + 16 * 16 * 3);
    for (const std::string extension : {"png", "jpeg", "exr", "hdr"}) {
        INFO(extension);
        const bool alpha = extension == "png" || extension == "exr";
        const Bytes picture = encode_picture(extension, 16, 16, alpha ? 4 : 3, alpha ? values : rgb);
        const TemporaryFolder folder;
        Cost cost;
        Random random(6);
        for (int i = 0; i < 150; ++i) {
            const Bytes mutated = mutate_bytes(picture, random);
            const auto check_image = [](const Image& image) {
                const size_t size = static_cast<size_t>(image.width) * static_cast<size_t>(image.height) *
                                    static_cast<size_t>(image.channels);
                CHECK(image.bytes.size() + image.floats.size() == size);
            };
            run([&] { check_image(decode_image(mutated, "picture")); }, cost);
            write_file(folder.file("picture." + extension), mutated);
            run([&] { check_image(read_image(folder.file("picture." + extension))); }, cost);
        }
        check_cost(cost, 300);
    }
}

#include "tests/gltf_builder.h"

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <unistd.h>

#include <fstream>

#include "core/gltf.h"

namespace nephroid::test {

namespace fs = std::filesystem;

namespace {

void append_u32(Bytes& bytes, size_t value) {
    for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<uint8_t>(value >> shift & 0xFFU));
}

void append_chunk(Bytes& bytes, uint32_t type, Bytes content, uint8_t padding) {
    while (content.size() % 4 != 0) content.push_back(padding);
    append_u32(bytes, content.size());
    append_u32(bytes, type);
    bytes.insert(bytes.end(), content.begin(), content.end());
}

Bytes to_bytes(const std::string& text) {
    return {text.begin(), text.end()};
}

}  // namespace

int GltfBuilder::add_view_bytes(const Bytes& bytes) {
    while (binary.size() % 4 != 0) binary.push_back(0);
    const int view = add("bufferViews", {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
    binary.insert(binary.end(), bytes.begin(), bytes.end());
    return view;
}

int GltfBuilder::add_accessor_of_view(int view, size_t count, const char* type, int component_type, bool normalized) {
    Json accessor = {{"bufferView", view}, {"count", count}, {"type", type}, {"componentType", component_type}};
    if (normalized) accessor["normalized"] = true;
    return add("accessors", accessor);
}

int GltfBuilder::add(const char* array, const Json& element) {
    json[array].push_back(element);
    return static_cast<int>(json[array].size()) - 1;
}

int GltfBuilder::add_mesh(const Json& attributes, int indices, int material) {
    Json primitive = {{"attributes", attributes}};
    if (indices >= 0) primitive["indices"] = indices;
    if (material >= 0) primitive["material"] = material;
    return add("meshes", {{"primitives", Json::array({primitive})}});
}

size_t GltfBuilder::components(const char* type) {
    const std::string name = type;
    return name == "SCALAR" ? 1 : static_cast<size_t>(name.back() - '0');
}

Bytes GltfBuilder::glb() const {
    Json document = json;
    if (!binary.empty() && !document.contains("buffers")) {
        document["buffers"] = Json::array({{{"byteLength", binary.size()}}});
    }
    Bytes chunks;
    append_chunk(chunks, 0x4E4F534A, to_bytes(document.dump()), ' ');
    if (!binary.empty()) append_chunk(chunks, 0x004E4942, binary, 0);
    Bytes bytes = to_bytes("glTF");
    append_u32(bytes, 2);
    append_u32(bytes, 12 + chunks.size());
    bytes.insert(bytes.end(), chunks.begin(), chunks.end());
    return bytes;
}

Bytes GltfBuilder::gltf() const {
    Json document = json;
    if (!binary.empty() && !document.contains("buffers")) {
        document["buffers"] = Json::array(
            {{{"byteLength", binary.size()}, {"uri", "data:application/octet-stream;base64," + base64(binary)}}});
    }
    return to_bytes(document.dump());
}

GltfBuilder triangle_builder() {
    GltfBuilder builder;
    const int positions = builder.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3", component_float);
    const int normals = builder.add_accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3", component_float);
    const int uvs = builder.add_accessor<float>({0, 0, 1, 0, 0, 1}, "VEC2", component_float);
    const int indices = builder.add_accessor<uint16_t>({0, 1, 2}, "SCALAR", component_u16);
    const int mesh = builder.add_mesh({{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}}, indices);
    builder.add_node({{"name", "triangle"}, {"mesh", mesh}});
    return builder;
}

Json& first_primitive(GltfBuilder& builder) {
    return builder.json["meshes"][0]["primitives"][0];
}

GltfBuilder textured_triangle(const Json& material, const std::vector<float>& color) {
    GltfBuilder builder = triangle_builder();
    const int view = builder.add_view_bytes(encode_picture("png", 1, 1, static_cast<int>(color.size()), color));
    builder.add("images", {{"bufferView", view}, {"mimeType", "image/png"}});
    builder.add("textures", {{"source", 0}});
    builder.add("materials", material);
    first_primitive(builder)["material"] = 0;
    return builder;
}

GltfBuilder draco_builder(int size) {
    draco::TriangleSoupMeshBuilder soup;
    soup.Start(2 * size * size);
    const int position = soup.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    const int normal = soup.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
    const int uv = soup.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
    const std::array<float, 3> up = {0.0F, 0.0F, 1.0F};
    for (int face = 0; face < 2 * size * size; ++face) {
        const int column = face / 2 % size;
        const int row = face / 2 / size;
        const std::array<std::array<int, 2>, 3> corners =
            face % 2 == 0 ? std::array<std::array<int, 2>, 3>{{{0, 0}, {1, 0}, {0, 1}}}
                          : std::array<std::array<int, 2>, 3>{{{1, 0}, {1, 1}, {0, 1}}};
        std::array<std::array<float, 3>, 3> points{};
        for (size_t i = 0; i < 3; ++i) {
            const float x = static_cast<float>(column + corners[i][0]) / static_cast<float>(size);
            const float y = static_cast<float>(row + corners[i][1]) / static_cast<float>(size);
            points[i] = {x, y, x * y};
        }
        const draco::FaceIndex index(static_cast<uint32_t>(face));
        soup.SetAttributeValuesForFace(position, index, points[0].data(), points[1].data(), points[2].data());
        soup.SetAttributeValuesForFace(normal, index, up.data(), up.data(), up.data());
        soup.SetAttributeValuesForFace(uv, index, points[0].data(), points[1].data(), points[2].data());
    }
    const std::unique_ptr<draco::Mesh> mesh = soup.Finalize();
    REQUIRE(mesh != nullptr);
    draco::Encoder encoder;
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 16);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, 12);
    draco::EncoderBuffer encoded;
    REQUIRE(encoder.EncodeMeshToBuffer(*mesh, &encoded).ok());

    GltfBuilder builder;
    const int view = builder.add_view(std::vector<char>(encoded.data(), encoded.data() + encoded.size()));
    const auto add_accessor = [&](size_t count, const char* type, int component_type) {
        return builder.add("accessors", {{"count", count}, {"type", type}, {"componentType", component_type}});
    };
    const int positions = add_accessor(mesh->num_points(), "VEC3", component_float);
    const int normals = add_accessor(mesh->num_points(), "VEC3", component_float);
    const int uvs = add_accessor(mesh->num_points(), "VEC2", component_float);
    const int indices = add_accessor(size_t{mesh->num_faces()} * 3, "SCALAR", component_u32);
    builder.add_mesh({{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}}, indices);
    const auto id = [&](int attribute) { return mesh->attribute(attribute)->unique_id(); };
    first_primitive(builder)["extensions"]["KHR_draco_mesh_compression"] = {
        {"bufferView", view},
        {"attributes", {{"POSITION", id(position)}, {"NORMAL", id(normal)}, {"TEXCOORD_0", id(uv)}}}};
    builder.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
    builder.add_node({{"mesh", 0}});
    return builder;
}

TemporaryFolder::TemporaryFolder() {
    static int counter = 0;
    path_ = fs::temp_directory_path() / ("nephroid_test_" + std::to_string(getpid()) + "_" + std::to_string(counter++));
    fs::create_directories(path_);
}

TemporaryFolder::~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

void write_file(const std::string& path, const Bytes& bytes) {
    std::ofstream stream(path, std::ios::binary);
    stream.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    REQUIRE(stream.good());
}

Bytes read_file(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

std::string base64(const Bytes& bytes) {
    const char* alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t group = 0;
        for (size_t k = 0; k < 3; ++k) group = group << 8U | (i + k < bytes.size() ? bytes[i + k] : 0U);
        for (size_t k = 0; k < 4; ++k) {
            text += i + k <= bytes.size() ? alphabet[group >> (18U - 6U * k) & 63U] : '=';
        }
    }
    return text;
}

Scene load(const GltfBuilder& builder) {
    const TemporaryFolder folder;
    write_file(folder.file("scene.glb"), builder.glb());
    return load_gltf(folder.file("scene.glb"));
}

std::string load_error(const std::string& path) {
    try {
        load_gltf(path);
    } catch (const Error& error) {
        CHECK(error.code() == ExitCode::invalid_input);
        const std::string line = error.what();
        CHECK(line.rfind(path + ": ", 0) == 0);
        CHECK(line.find('\n') == std::string::npos);
        return line;
    }
    return {};
}

std::string load_error(const GltfBuilder& builder) {
    const TemporaryFolder folder;
    write_file(folder.file("scene.glb"), builder.glb());
    return load_error(folder.file("scene.glb"));
}

Bytes encode_picture(const std::string& extension, int width, int height, int channels,
                     const std::vector<float>& values, bool sixteen_bit) {
    const TemporaryFolder folder;
    const std::string path = folder.file("picture." + extension);
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(path);
    REQUIRE(output != nullptr);
    const bool is_float = extension == "exr" || extension == "hdr";
    const OIIO::TypeDesc type = is_float      ? OIIO::TypeDesc::FLOAT
                                : sixteen_bit ? OIIO::TypeDesc::UINT16
                                              : OIIO::TypeDesc::UINT8;
    OIIO::ImageSpec spec(width, height, channels, type);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    REQUIRE(output->open(path, spec));
    REQUIRE(output->write_image(OIIO::TypeDesc::FLOAT, values.data()));
    output->close();
    return read_file(path);
}

void check_vec(const Vec3& value, const Vec3& expected, float tolerance) {
    INFO("value " << value.x << " " << value.y << " " << value.z);
    INFO("expected " << expected.x << " " << expected.y << " " << expected.z);
    CHECK(glm::length(value - expected) <= tolerance);
}

void check_contains(const std::string& text, const std::string& part) {
    INFO(text << " should contain " << part);
    CHECK(text.find(part) != std::string::npos);
}

Vec3 world_face_normal(const Scene& scene, const Object& object, size_t triangle) {
    const Mesh& mesh = scene.meshes[static_cast<size_t>(object.mesh)];
    std::array<Vec3, 3> p{};
    for (size_t i = 0; i < 3; ++i) {
        p[i] = Vec3(object.to_world * Vec4(mesh.positions[mesh.triangles[triangle][i]], 1.0F));
    }
    return glm::normalize(glm::cross(p[1] - p[0], p[2] - p[0]));
}

bool has_warning(const Scene& scene, const std::string& text) {
    for (const std::string& warning : scene.warnings) {
        if (warning.find(text) != std::string::npos) return true;
    }
    return false;
}

}  // namespace nephroid::test

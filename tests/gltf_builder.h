// Builds small glTF and GLB files for tests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/scene.h"

namespace nephroid::test {

using Bytes = std::vector<uint8_t>;
using Json = nlohmann::json;

inline constexpr int component_u8 = 5121;
inline constexpr int component_u16 = 5123;
inline constexpr int component_u32 = 5125;
inline constexpr int component_i8 = 5120;
inline constexpr int component_i16 = 5122;
inline constexpr int component_float = 5126;

/// The document and its only buffer; members of `json` may be changed at will.
struct GltfBuilder {
    Json json = {{"asset", {{"version", "2.0"}}}};
    Bytes binary;

    /// Appends the bytes of the values, 4-byte aligned, as a new buffer view; returns its index.
    template <typename T>
    int add_view(const std::vector<T>& values) {
        const auto* begin = reinterpret_cast<const uint8_t*>(values.data());
        return add_view_bytes(Bytes(begin, begin + values.size() * sizeof(T)));
    }
    int add_view_bytes(const Bytes& bytes);

    /// Adds an accessor over a new view with the values; count follows from type ("SCALAR", "VEC3", ...).
    template <typename T>
    int add_accessor(const std::vector<T>& values, const char* type, int component_type, bool normalized = false) {
        return add_accessor_of_view(add_view(values), values.size() / components(type), type, component_type,
                                    normalized);
    }
    int add_accessor_of_view(int view, size_t count, const char* type, int component_type, bool normalized = false);

    /// Adds an element to a top-level array, e.g. add("nodes", {...}); returns its index.
    int add(const char* array, const Json& element);

    /// A mesh of one primitive over the accessors; returns the mesh's index.
    int add_mesh(const Json& attributes, int indices = -1, int material = -1);

    /// A node without a parent.
    int add_node(const Json& node) { return add("nodes", node); }

    static size_t components(const char* type);
    Bytes glb() const;
    Bytes gltf() const;  ///< The buffer as a data URI.
};

/// One triangle (0,0,0) (1,0,0) (0,1,0) with normals +Z and uv = xy, indexed, on one node: the start of many tests.
GltfBuilder triangle_builder();

/// The first primitive of the first mesh.
Json& first_primitive(GltfBuilder& builder);

/// triangle_builder() with the material, whose textures may use texture 0: a 1 x 1 PNG of the colour.
GltfBuilder textured_triangle(const Json& material, const std::vector<float>& color = {1.0F, 0.5F, 0.0F});

/// A grid of `size` x `size` quads in the unit square with KHR_draco_mesh_compression, heights x * y, normals +Z, uv =
/// xy.
GltfBuilder draco_builder(int size);

/// A temporary folder that is removed at the end.
class TemporaryFolder {
  public:
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    const std::filesystem::path& path() const { return path_; }
    std::string file(const std::string& name) const { return (path_ / name).string(); }

  private:
    std::filesystem::path path_;
};

void write_file(const std::string& path, const Bytes& bytes);
Bytes read_file(const std::string& path);
std::string base64(const Bytes& bytes);

/// Writes the GLB to a temporary file and loads it.
Scene load(const GltfBuilder& builder);

/// The error line that loading gives; empty where it succeeds. Fails the test for another exit code than invalid_input.
std::string load_error(const GltfBuilder& builder);
std::string load_error(const std::string& path);

/// A picture file encoded by OpenImageIO: "png", "jpeg", "exr" or "hdr".
Bytes encode_picture(const std::string& extension, int width, int height, int channels,
                     const std::vector<float>& values, bool sixteen_bit = false);

/// doctest checks with the values in the message.
void check_vec(const Vec3& value, const Vec3& expected, float tolerance = 1e-5F);
void check_contains(const std::string& text, const std::string& part);

/// Normal of a triangle in world space by its winding.
Vec3 world_face_normal(const Scene& scene, const Object& object, size_t triangle);

/// Whether a warning contains the text.
bool has_warning(const Scene& scene, const std::string& text);

}  // namespace nephroid::test

#include "core/gltf_mesh.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/gltf_accessor.h"
#include "core/gltf_draco.h"
#include "core/gltf_error.h"
#include "core/gltf_material.h"
#include "core/mesh_attributes.h"

namespace nephroid {

namespace {

/// A primitive on its way to a Mesh.
struct PrimitiveSource {
    const tinygltf::Primitive* primitive = nullptr;
    std::string element;  ///< For messages: "mesh 1 primitive 0".
    std::optional<DracoPrimitive> draco;
    size_t vertex_count = 0;
};

const tinygltf::Accessor& get_accessor(const GltfImport& import, int index) {
    return import.document.model.accessors[static_cast<size_t>(index)];
}

/// The accessor of an attribute, or -1.
int find_attribute(const tinygltf::Primitive& primitive, const std::string& name) {
    const auto found = primitive.attributes.find(name);
    return found == primitive.attributes.end() ? -1 : found->second;
}

bool is_float_or(const tinygltf::Accessor& accessor, std::initializer_list<int> types, bool must_be_normalized) {
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT) return true;
    if (must_be_normalized && !accessor.normalized) return false;
    return std::find(types.begin(), types.end(), accessor.componentType) != types.end();
}

/// Component types that glTF and KHR_mesh_quantization allow for the attribute.
bool is_allowed_type(const std::string& name, const tinygltf::Accessor& accessor) {
    constexpr int i8 = TINYGLTF_COMPONENT_TYPE_BYTE;
    constexpr int u8 = TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
    constexpr int i16 = TINYGLTF_COMPONENT_TYPE_SHORT;
    constexpr int u16 = TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
    if (name == "NORMAL" || name == "TANGENT") return is_float_or(accessor, {i8, i16}, true);
    if (name == "COLOR_0") return is_float_or(accessor, {u8, u16}, true);
    return is_float_or(accessor, {i8, u8, i16, u16}, false);
}

/// Reads an attribute from the Draco data or else from its accessor; empty where the primitive has none.
template <typename Vector>
std::vector<Vector> read_attribute(const GltfImport& import, const PrimitiveSource& source, const std::string& name,
                                   const ElementSelection& selection, size_t spare = 0) {
    const int index = find_attribute(*source.primitive, name);
    if (index < 0) return {};
    if (!source.draco || source.draco->attributes.count(name) == 0) {
        return read_vectors<Vector>(import.document, index, selection, spare);
    }
    constexpr auto components = static_cast<size_t>(Vector::length());
    const std::vector<float>& values = source.draco->attributes.at(name);
    std::vector<Vector> result;
    const size_t size = selection.size(source.vertex_count);
    result.reserve(size + spare);
    for (size_t i = 0; i < size; ++i) {
        const size_t vertex = selection.all ? i : selection.elements[i];
        Vector value;
        for (size_t c = 0; c < components; ++c) {
            value[static_cast<int>(c)] = values[vertex * components + c];
        }
        result.push_back(value);
    }
    return result;
}

void check_attributes(const GltfImport& import, const PrimitiveSource& source) {
    for (const char* name : {"POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0"}) {
        const int index = find_attribute(*source.primitive, name);
        if (index < 0) continue;
        const tinygltf::Accessor& accessor = get_accessor(import, index);
        const std::string element = source.element + " " + name;
        if (source.draco && source.draco->attributes.count(name) != 0) continue;
        if (!is_allowed_type(name, accessor)) {
            fail_gltf(import.document.file, element, "its component type is not allowed; re-export the file");
        }
        if (accessor.count != source.vertex_count) {
            fail_gltf(import.document.file, element,
                      "it has " + std::to_string(accessor.count) + " elements but there are " +
                          std::to_string(source.vertex_count) + " vertices; re-export the file");
        }
        check_accessor(import.document, index);
    }
}

std::vector<Triangle> triangles_from_list(const std::vector<uint32_t>& corners) {
    std::vector<Triangle> triangles(corners.size() / 3);
    for (size_t i = 0; i < triangles.size(); ++i) {
        triangles[i] = {corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]};
    }
    return triangles;
}

/// Every second triangle of a strip is turned round, so that all face the same way.
std::vector<Triangle> triangles_from_strip(const std::vector<uint32_t>& corners) {
    std::vector<Triangle> triangles;
    for (size_t i = 0; i + 2 < corners.size(); ++i) {
        const size_t odd = i % 2;
        triangles.push_back({corners[i], corners[i + 1 + odd], corners[i + 2 - odd]});
    }
    return triangles;
}

std::vector<Triangle> triangles_from_fan(const std::vector<uint32_t>& corners) {
    std::vector<Triangle> triangles;
    for (size_t i = 1; i + 1 < corners.size(); ++i) triangles.push_back({corners[i], corners[i + 1], corners[0]});
    return triangles;
}

std::vector<uint32_t> read_corners(GltfImport& import, PrimitiveSource& source) {
    if (source.draco) return std::move(source.draco->indices);
    const int indices = source.primitive->indices;
    const size_t count = indices < 0 ? source.vertex_count : get_accessor(import, indices).count;
    charge_mesh_memory(import, count * sizeof(uint32_t), source.element);
    if (indices >= 0) return read_indices(import.document, indices);
    std::vector<uint32_t> corners(count);
    for (size_t i = 0; i < count; ++i) corners[i] = static_cast<uint32_t>(i);
    return corners;
}

std::vector<Triangle> read_triangles(GltfImport& import, PrimitiveSource& source) {
    const std::vector<uint32_t> corners = read_corners(import, source);
    for (const uint32_t corner : corners) {
        if (corner < source.vertex_count) continue;
        fail_gltf(import.document.file, source.element,
                  "index " + std::to_string(corner) + " is not below the " + std::to_string(source.vertex_count) +
                      " vertices; re-export the file");
    }
    const int mode = source.primitive->mode;
    // Draco stores triangles, whatever the mode was before.
    const bool list = mode == TINYGLTF_MODE_TRIANGLES || source.draco;
    if (list && corners.size() % 3 != 0) {
        fail_gltf(import.document.file, source.element,
                  std::to_string(corners.size()) + " corners are not a multiple of 3; re-export the file");
    }
    const size_t triangle_count = list ? corners.size() / 3 : corners.size();
    charge_mesh_memory(import, triangle_count * sizeof(Triangle), source.element);
    if (list) return triangles_from_list(corners);
    return mode == TINYGLTF_MODE_TRIANGLE_STRIP ? triangles_from_strip(corners) : triangles_from_fan(corners);
}

/// Where the triangles use less than half of the vertices (exporters share one vertex buffer between primitives): the
/// used ones in ascending order, with the triangles renumbered to them. Empty otherwise.
std::vector<uint32_t> compact_vertices(std::vector<Triangle>& triangles, size_t vertex_count) {
    if (triangles.size() * 3 >= vertex_count) return {};
    std::vector<uint32_t> used;
    used.reserve(triangles.size() * 3);
    for (const Triangle& triangle : triangles) used.insert(used.end(), triangle.begin(), triangle.end());
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (Triangle& triangle : triangles) {
        for (uint32_t& vertex : triangle) {
            vertex = static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), vertex) - used.begin());
        }
    }
    return used;
}

bool needs_uv_set(const Material& material, int set) {
    const TextureReference* references[] = {&material.base_color_texture, &material.metallic_roughness_texture,
                                            &material.normal_texture, &material.emissive_texture};
    return std::any_of(std::begin(references), std::end(references),
                       [&](const TextureReference* r) { return r->image >= 0 && r->uv_set == set; });
}

void read_uvs(GltfImport& import, const PrimitiveSource& source, const Material& material,
              const ElementSelection& selection, Mesh& mesh) {
    for (const int set : {0, 1}) {
        if (!needs_uv_set(material, set)) continue;
        std::vector<Vec2>& uvs = mesh.uvs[static_cast<size_t>(set)];
        const std::string name = "TEXCOORD_" + std::to_string(set);
        uvs = read_attribute<Vec2>(import, source, name, selection);
        if (!uvs.empty()) continue;
        warn_gltf(import, source.element, "its material needs " + name + ", which it does not have; uv 0 is used");
        uvs.assign(mesh.positions.size(), Vec2(0.0F));
    }
}

void read_colors(const GltfImport& import, const PrimitiveSource& source, const ElementSelection& selection,
                 Mesh& mesh) {
    const int index = find_attribute(*source.primitive, "COLOR_0");
    if (index < 0) return;
    if (get_accessor(import, index).type == TINYGLTF_TYPE_VEC4) {
        mesh.colors = read_attribute<Vec4>(import, source, "COLOR_0", selection);
    } else {
        const std::vector<Vec3> colors = read_attribute<Vec3>(import, source, "COLOR_0", selection);
        mesh.colors.reserve(colors.size());
        for (const Vec3& color : colors) mesh.colors.emplace_back(color, 1.0F);
    }
    for (Vec4& color : mesh.colors) color = glm::clamp(color, Vec4(0.0F), Vec4(1.0F));
}

void read_tangents(const GltfImport& import, const PrimitiveSource& source, const Material& material,
                   const ElementSelection& selection, Mesh& mesh) {
    const TextureReference& texture = material.normal_texture;
    if (texture.image < 0) return;
    // Without normals glTF asks for tangents of the file to be ignored.
    if (!mesh.normals.empty()) mesh.tangents = read_attribute<Vec4>(import, source, "TANGENT", selection);
    const bool usable = std::all_of(mesh.tangents.begin(), mesh.tangents.end(),
                                    [](const Vec4& t) { return glm::length(Vec3(t)) > 1e-6F; });
    if (mesh.tangents.empty() || !usable) {
        compute_tangents(mesh, texture.uv_set, texture.uv_matrix);
        return;
    }
    for (Vec4& tangent : mesh.tangents) {
        tangent = Vec4(glm::normalize(Vec3(tangent)), tangent.w < 0.0F ? -1.0F : 1.0F);
    }
}

void read_vertices(GltfImport& import, const PrimitiveSource& source, const ElementSelection& selection, Mesh& mesh) {
    const Material& material = import.scene.materials[static_cast<size_t>(mesh.material)];
    const size_t count = selection.size(source.vertex_count);
    charge_mesh_memory(import, count * (2 * sizeof(Vec3) + 2 * sizeof(Vec4)), source.element);
    // Embree may read 4 bytes past the last vertex.
    mesh.positions = read_attribute<Vec3>(import, source, "POSITION", selection, 1);
    mesh.normals = read_attribute<Vec3>(import, source, "NORMAL", selection);
    const size_t replaced = normalize_normals(mesh);
    if (replaced > 0) {
        warn_gltf(import, source.element,
                  std::to_string(replaced) + " normals have length 0; taken from the adjacent triangles");
    }
    read_uvs(import, source, material, selection, mesh);
    read_colors(import, source, selection, mesh);
    read_tangents(import, source, material, selection, mesh);
}

std::map<std::string, int> wanted_components(const GltfImport& import, const tinygltf::Primitive& primitive) {
    const int color = find_attribute(primitive, "COLOR_0");
    const bool alpha = color >= 0 && get_accessor(import, color).type == TINYGLTF_TYPE_VEC4;
    return {{"POSITION", 3},   {"NORMAL", 3},     {"TANGENT", 4},
            {"TEXCOORD_0", 2}, {"TEXCOORD_1", 2}, {"COLOR_0", alpha ? 4 : 3}};
}

Bounds object_bounds(const GltfImport& import, const Mesh& mesh, const std::string& element) {
    // Beyond this, squared lengths and ray tracing leave the range of floats.
    constexpr float max_coordinate = 1e15F;
    Bounds bounds;
    for (const Vec3& position : mesh.positions) bounds.extend(position);
    if (max_component(bounds.max) > max_coordinate || max_component(-bounds.min) > max_coordinate) {
        fail_gltf(import.document.file, element, "it has coordinates beyond 1e15; repair the mesh and re-export");
    }
    return bounds;
}

/// Whether the primitive can be rendered; warns where not.
bool is_renderable(GltfImport& import, const tinygltf::Primitive& primitive, const std::string& element) {
    if (primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
        fail_gltf(import.document.file, element,
                  "unknown mode " + std::to_string(primitive.mode) + "; re-export the file");
    }
    if (primitive.mode < TINYGLTF_MODE_TRIANGLES) {
        warn_gltf(import, element, "points and lines are not rendered; ignored");
        return false;
    }
    if (find_attribute(primitive, "POSITION") < 0) {
        warn_gltf(import, element, "it has no POSITION; ignored");
        return false;
    }
    if (!primitive.targets.empty()) {
        warn_gltf(import, element, "morph targets are not supported; the base shape is rendered");
    }
    return true;
}

Mesh convert_primitive(GltfImport& import, PrimitiveSource source) {
    Mesh mesh;
    mesh.material = import_material(import, source.primitive->material);
    if (has_draco(*source.primitive)) {
        source.draco =
            decode_draco(import, *source.primitive, wanted_components(import, *source.primitive), source.element);
        source.vertex_count = source.draco->vertex_count;
        charge_mesh_memory(import, source.draco->indices.size() * sizeof(uint32_t), source.element);
    } else {
        source.vertex_count = get_accessor(import, find_attribute(*source.primitive, "POSITION")).count;
    }
    check_attributes(import, source);
    mesh.triangles = read_triangles(import, source);
    const std::vector<uint32_t> used = compact_vertices(mesh.triangles, source.vertex_count);
    read_vertices(import, source, {used.empty(), used}, mesh);
    return mesh;
}

}  // namespace

const std::vector<int>& import_mesh(GltfImport& import, int index) {
    const auto [entry, is_new] = import.meshes.try_emplace(index);
    if (!is_new) return entry->second;
    const tinygltf::Mesh& source = import.document.model.meshes[static_cast<size_t>(index)];
    for (size_t i = 0; i < source.primitives.size(); ++i) {
        const std::string element =
            element_name("mesh", static_cast<size_t>(index)) + " " + element_name("primitive", i);
        if (!is_renderable(import, source.primitives[i], element)) continue;
        Mesh mesh = convert_primitive(import, {&source.primitives[i], element, {}, 0});
        if (mesh.triangles.empty()) {
            warn_gltf(import, element, "it has no triangles; ignored");
            continue;
        }
        mesh.name = printable(source.name);
        import.mesh_bounds.push_back(object_bounds(import, mesh, element));
        entry->second.push_back(static_cast<int>(import.scene.meshes.size()));
        import.scene.meshes.push_back(std::move(mesh));
    }
    return entry->second;
}

}  // namespace nephroid

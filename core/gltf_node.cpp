#include "core/gltf_node.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "core/gltf_camera.h"
#include "core/gltf_error.h"
#include "core/gltf_light.h"
#include "core/gltf_mesh.h"

namespace nephroid {

namespace {

constexpr size_t max_objects = size_t{1} << 21U;
// Beyond this, areas and their products leave the range of floats.
constexpr double max_coordinate = 1e9;

std::string name_of(int node) {
    return element_name("node", static_cast<size_t>(node));
}

const tinygltf::Node& get_node(const GltfImport& import, int node) {
    return import.document.model.nodes[static_cast<size_t>(node)];
}

glm::dmat4 read_matrix(const GltfImport& import, int node) {
    const std::vector<double>& values = get_node(import, node).matrix;
    glm::dmat4 matrix;
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = values[static_cast<size_t>(i)];
    const glm::dvec4 last_row(matrix[0][3], matrix[1][3], matrix[2][3], matrix[3][3]);
    if (glm::length(last_row - glm::dvec4(0.0, 0.0, 0.0, 1.0)) > 1e-6) {
        fail_gltf(import.document.file, name_of(node), "the last row of its matrix is not 0 0 0 1; re-export the file");
    }
    return matrix;
}

glm::dquat read_rotation(GltfImport& import, int node) {
    const std::vector<double>& values = get_node(import, node).rotation;
    if (values.empty()) return {1.0, 0.0, 0.0, 0.0};
    const glm::dquat rotation(values[3], values[0], values[1], values[2]);
    const double length = glm::length(rotation);
    if (!(length > 1e-6) || !std::isfinite(length)) {
        fail_gltf(import.document.file, name_of(node), "its rotation is not a unit quaternion; re-export the file");
    }
    if (std::abs(length - 1.0) > 1e-3) {
        warn_gltf(import, name_of(node), "its rotation is not a unit quaternion; normalised");
    }
    return rotation / length;
}

glm::dmat4 local_transform(GltfImport& import, int index) {
    const tinygltf::Node& node = get_node(import, index);
    if (!node.matrix.empty()) return read_matrix(import, index);
    glm::dmat4 result = glm::mat4_cast(read_rotation(import, index));
    if (!node.scale.empty()) {
        for (int axis = 0; axis < 3; ++axis) result[axis] *= node.scale[static_cast<size_t>(axis)];
    }
    if (!node.translation.empty()) {
        result[3] = glm::dvec4(node.translation[0], node.translation[1], node.translation[2], 1.0);
    }
    return result;
}

/// Checks that no node has two parents, and that no node hangs in a cycle (is reached from no root).
std::vector<bool> check_graph(const GltfImport& import) {
    const std::vector<tinygltf::Node>& nodes = import.document.model.nodes;
    std::vector<bool> has_parent(nodes.size(), false);
    for (const tinygltf::Node& node : nodes) {
        for (const int child : node.children) {
            if (has_parent[static_cast<size_t>(child)]) {
                fail_gltf(import.document.file, name_of(child), "it has more than one parent; re-export the file");
            }
            has_parent[static_cast<size_t>(child)] = true;
        }
    }
    std::vector<int> pending;
    size_t reached = 0;
    for (size_t i = 0; i < nodes.size(); ++i) {
        if (!has_parent[i]) pending.push_back(static_cast<int>(i));
    }
    while (!pending.empty()) {
        const tinygltf::Node& node = get_node(import, pending.back());
        pending.pop_back();
        ++reached;
        pending.insert(pending.end(), node.children.begin(), node.children.end());
    }
    if (reached != nodes.size()) fail_gltf(import.document.file, "nodes", "they form a cycle; re-export the file");
    return has_parent;
}

std::vector<int> find_roots(const GltfImport& import, const std::vector<bool>& has_parent) {
    const tinygltf::Model& model = import.document.model;
    std::vector<int> roots;
    if (model.scenes.empty()) {
        for (size_t i = 0; i < has_parent.size(); ++i) {
            if (!has_parent[i]) roots.push_back(static_cast<int>(i));
        }
        return roots;
    }
    const auto scene = static_cast<size_t>(std::max(model.defaultScene, 0));
    roots = model.scenes[scene].nodes;
    std::vector<bool> seen(has_parent.size(), false);
    for (const int root : roots) {
        const auto index = static_cast<size_t>(root);
        if (has_parent[index] || seen[index]) {
            fail_gltf(import.document.file, element_name("scene", scene),
                      name_of(root) + " is listed twice or is a child of another node; re-export the file");
        }
        seen[index] = true;
    }
    return roots;
}

void check_magnitude(const GltfImport& import, int node, const glm::dmat4& to_world) {
    for (int column = 0; column < 4; ++column) {
        for (int row = 0; row < 3; ++row) {
            if (std::abs(to_world[column][row]) <= max_coordinate) continue;
            fail_gltf(import.document.file, name_of(node),
                      "its transform to world space has numbers above 1e9; correct it");
        }
    }
}

/// Whether the transform can be inverted as floats.
bool is_invertible(const glm::dmat4& to_world) {
    const Mat3 inverse = glm::inverse(Mat3(glm::dmat3(to_world)));
    for (int column = 0; column < 3; ++column) {
        if (!std::isfinite(glm::dot(inverse[column], Vec3(1.0F)))) return false;
    }
    return true;
}

void check_world_positions(const GltfImport& import, int node, const Bounds& bounds, const glm::dmat4& to_world) {
    const glm::dvec3 largest = glm::max(glm::abs(bounds.min), glm::abs(bounds.max));
    for (int axis = 0; axis < 3; ++axis) {
        double reach = std::abs(to_world[3][axis]);
        for (int column = 0; column < 3; ++column) reach += std::abs(to_world[column][axis]) * largest[column];
        if (reach <= max_coordinate) continue;
        fail_gltf(import.document.file, name_of(node),
                  "its mesh reaches beyond 1e9 metres in world space; repair or rescale it");
    }
}

/// What a node's extras say about its objects and those of its descendants.
struct ObjectExtras {
    bool no_caustics = false;
    float densify = 0.0F;
};

void import_objects(GltfImport& import, int index, const glm::dmat4& to_world, const ObjectExtras& extras) {
    const tinygltf::Node& node = get_node(import, index);
    if (node.mesh < 0) return;
    if (!is_invertible(to_world)) {
        warn_gltf(import, name_of(index), "it is scaled to nothing; its mesh is left out");
        return;
    }
    for (const int mesh : import_mesh(import, node.mesh)) {
        if (import.scene.objects.size() >= max_objects) {
            fail_gltf(import.document.file, name_of(index),
                      "there are more than " + std::to_string(max_objects) + " objects; merge meshes");
        }
        check_world_positions(import, index, import.mesh_bounds[static_cast<size_t>(mesh)], to_world);
        Object object;
        object.name = printable(node.name);
        object.mesh = mesh;
        object.to_world = Mat4(to_world);
        object.no_caustics = extras.no_caustics;
        object.densify = extras.densify;
        import.scene.objects.push_back(std::move(object));
    }
}

bool switches_caustics_off(const tinygltf::Node& node) {
    if (!node.extras.Has("caustics")) return false;
    const tinygltf::Value& value = node.extras.Get("caustics");
    return value.IsString() && value.Get<std::string>() == "none";
}

/// The target edge length of extras.densify, metres; a node's own value wins over the inherited one.
float read_densify(const GltfImport& import, int index, float inherited) {
    const tinygltf::Node& node = get_node(import, index);
    if (!node.extras.Has("densify")) return inherited;
    const double length = number_or(node.extras, "densify", 0.0);
    if (!(length >= 1e-9) || length > max_coordinate) {
        fail_gltf(import.document.file, name_of(index),
                  "extras.densify must be an edge length in metres from 1e-9 to 1e9; correct it");
    }
    return static_cast<float>(length);
}

/// A node that is still to be visited, with what it inherits.
struct Visit {
    int node = 0;
    glm::dmat4 parent_to_world{1.0};
    ObjectExtras extras;
};

}  // namespace

void import_nodes(GltfImport& import) {
    std::vector<int> roots = find_roots(import, check_graph(import));
    std::vector<Visit> pending;
    for (auto root = roots.rbegin(); root != roots.rend(); ++root) pending.push_back({*root, glm::dmat4(1.0), {}});
    while (!pending.empty()) {
        Visit visit = pending.back();
        pending.pop_back();
        const tinygltf::Node& node = get_node(import, visit.node);
        const glm::dmat4 to_world = visit.parent_to_world * local_transform(import, visit.node);
        check_magnitude(import, visit.node, to_world);
        const ObjectExtras extras{visit.extras.no_caustics || switches_caustics_off(node),
                                  read_densify(import, visit.node, visit.extras.densify)};
        import_objects(import, visit.node, to_world, extras);
        import_camera(import, visit.node, to_world);
        import_light(import, visit.node, to_world);
        for (auto child = node.children.rbegin(); child != node.children.rend(); ++child) {
            pending.push_back({*child, to_world, extras});
        }
    }
}

}  // namespace nephroid

#include "core/scene.h"

#include "core/mesh_attributes.h"

namespace nephroid {

namespace {

Mesh& mesh_of(Scene& scene, const Object& object) {
    return scene.meshes[static_cast<size_t>(object.mesh)];
}

bool is_emitting(const Scene& scene, const Mesh& mesh) {
    return scene.materials[static_cast<size_t>(mesh.material)].emits();
}

void move_to_world(Mesh& mesh, const Mat4& to_world) {
    const Mat3 linear(to_world);
    const Mat3 normal_matrix = glm::transpose(glm::inverse(linear));
    const bool mirrored = glm::determinant(linear) < 0.0F;
    for (Vec3& position : mesh.positions) position = Vec3(to_world * Vec4(position, 1.0F));
    for (Vec3& normal : mesh.normals) normal = normalize_or(normal_matrix * normal, normal);
    for (Vec4& tangent : mesh.tangents) {
        tangent = Vec4(normalize_or(linear * Vec3(tangent), Vec3(tangent)), mirrored ? -tangent.w : tangent.w);
    }
    if (!mirrored) return;
    // A reflection turns the order of corners round; turning it back keeps the front side in front.
    for (Triangle& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

size_t approximate_bytes(const Mesh& mesh) {
    return mesh.positions.size() * (2 * sizeof(Vec3) + 2 * sizeof(Vec4)) + mesh.triangles.size() * sizeof(Triangle);
}

/// Gives every object with an emitting mesh a mesh of its own.
void unshare_emitting_meshes(Scene& scene) {
    constexpr size_t max_copied_bytes = size_t{1} << 30U;
    size_t copied_bytes = 0;
    std::vector<bool> taken(scene.meshes.size(), false);
    for (Object& object : scene.objects) {
        const auto index = static_cast<size_t>(object.mesh);
        if (!is_emitting(scene, scene.meshes[index])) continue;
        if (!taken[index]) {
            taken[index] = true;
            continue;
        }
        copied_bytes += approximate_bytes(scene.meshes[index]);
        if (copied_bytes > max_copied_bytes) {
            throw Error(ExitCode::invalid_input, scene.file + ": object " + object.name +
                                                     ": copies of its emitting mesh take more than 1 GiB; use fewer "
                                                     "instances of it or a simpler mesh");
        }
        object.mesh = static_cast<int>(scene.meshes.size());
        Mesh copy = scene.meshes[index];
        copy.positions.reserve(copy.positions.size() + 1);  // A copied vector has no spare capacity.
        scene.meshes.push_back(std::move(copy));
    }
}

}  // namespace

size_t Scene::triangle_count() const {
    size_t count = 0;
    for (const Object& object : objects) count += meshes[static_cast<size_t>(object.mesh)].triangles.size();
    return count;
}

Bounds world_bounds(const Scene& scene) {
    std::vector<Bounds> mesh_bounds(scene.meshes.size());
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        for (const Vec3& position : scene.meshes[i].positions) mesh_bounds[i].extend(position);
    }
    Bounds bounds;
    for (const Object& object : scene.objects) {
        const Bounds& box = mesh_bounds[static_cast<size_t>(object.mesh)];
        if (box.empty()) continue;
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3 point((corner & 1) != 0 ? box.max.x : box.min.x, (corner & 2) != 0 ? box.max.y : box.min.y,
                             (corner & 4) != 0 ? box.max.z : box.min.z);
            bounds.extend(Vec3(object.to_world * Vec4(point, 1.0F)));
        }
    }
    return bounds;
}

void flatten_single_use_meshes(Scene& scene) {
    unshare_emitting_meshes(scene);
    std::vector<size_t> uses(scene.meshes.size(), 0);
    for (const Object& object : scene.objects) ++uses[static_cast<size_t>(object.mesh)];
    for (Object& object : scene.objects) {
        if (uses[static_cast<size_t>(object.mesh)] != 1 || object.to_world == Mat4(1.0F)) continue;
        move_to_world(mesh_of(scene, object), object.to_world);
        object.to_world = Mat4(1.0F);
    }
}

}  // namespace nephroid

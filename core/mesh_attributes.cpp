#include "core/mesh_attributes.h"

#include <cmath>

namespace nephroid {

namespace {

constexpr uint32_t none = 0xFFFFFFFFU;

Vec3 scaled_face_normal(const Mesh& mesh, const Triangle& triangle) {
    const Vec3 origin = mesh.positions[triangle[0]];
    return glm::cross(mesh.positions[triangle[1]] - origin, mesh.positions[triangle[2]] - origin);
}

/// Any unit vector orthogonal to n.
Vec3 any_orthogonal(const Vec3& n) {
    const Vec3 axis = glm::abs(n.x) < 0.6F ? Vec3(1.0F, 0.0F, 0.0F) : Vec3(0.0F, 1.0F, 0.0F);
    return glm::normalize(glm::cross(n, axis));
}

/// How the texture lies on a triangle.
struct TextureFrame {
    Vec3 tangent{0.0F};       ///< Towards growing u; zero where the texture is degenerate.
    float handedness = 0.0F;  ///< +1, -1 for a mirrored texture, 0 where degenerate.
};

TextureFrame texture_frame(const Mesh& mesh, const Triangle& triangle, int uv_set, const glm::mat2& uv_matrix) {
    const std::vector<Vec2>& uvs = mesh.uvs[static_cast<size_t>(uv_set)];
    const Vec3 edge1 = mesh.positions[triangle[1]] - mesh.positions[triangle[0]];
    const Vec3 edge2 = mesh.positions[triangle[2]] - mesh.positions[triangle[0]];
    const Vec2 uv1 = uv_matrix * (uvs[triangle[1]] - uvs[triangle[0]]);
    const Vec2 uv2 = uv_matrix * (uvs[triangle[2]] - uvs[triangle[0]]);
    const float determinant = uv1.x * uv2.y - uv1.y * uv2.x;
    if (!(std::abs(determinant) > 0.0F)) return {};
    const float sign = determinant > 0.0F ? 1.0F : -1.0F;
    // v points down in glTF's pictures: a triangle with its texture the right way round has a negative determinant.
    return {normalize_or(sign * (uv2.y * edge1 - uv1.y * edge2), Vec3(0.0F)), -sign};
}

float corner_angle(const Mesh& mesh, const Triangle& triangle, size_t corner) {
    const Vec3 origin = mesh.positions[triangle[corner]];
    const Vec3 a = normalize_or(mesh.positions[triangle[(corner + 1) % 3]] - origin, Vec3(0.0F));
    const Vec3 b = normalize_or(mesh.positions[triangle[(corner + 2) % 3]] - origin, Vec3(0.0F));
    return std::acos(glm::clamp(glm::dot(a, b), -1.0F, 1.0F));
}

template <typename T>
void append_copy(std::vector<T>& values, uint32_t index) {
    if (values.empty()) return;
    const T copy = values[index];
    values.push_back(copy);
}

uint32_t duplicate_vertex(Mesh& mesh, uint32_t vertex) {
    const auto copy = static_cast<uint32_t>(mesh.positions.size());
    append_copy(mesh.positions, vertex);
    append_copy(mesh.normals, vertex);
    append_copy(mesh.uvs[0], vertex);
    append_copy(mesh.uvs[1], vertex);
    append_copy(mesh.colors, vertex);
    return copy;
}

/// Gives each vertex one handedness: triangles of the other one get a copy of it.
std::vector<float> split_by_handedness(Mesh& mesh, int uv_set, const glm::mat2& uv_matrix) {
    std::vector<float> handedness(mesh.positions.size(), 0.0F);
    std::vector<uint32_t> mirrored_copy(mesh.positions.size(), none);
    for (Triangle& triangle : mesh.triangles) {
        const float sign = texture_frame(mesh, triangle, uv_set, uv_matrix).handedness;
        if (sign == 0.0F) continue;
        for (uint32_t& vertex : triangle) {
            if (handedness[vertex] == 0.0F) handedness[vertex] = sign;
            if (handedness[vertex] == sign) continue;
            if (mirrored_copy[vertex] == none) {
                const uint32_t copy = duplicate_vertex(mesh, vertex);
                mirrored_copy[vertex] = copy;
                mirrored_copy.push_back(none);
                handedness.push_back(sign);
            }
            vertex = mirrored_copy[vertex];
        }
    }
    // Embree may read 4 bytes past the last vertex.
    mesh.positions.reserve(mesh.positions.size() + 1);
    return handedness;
}

/// Averages of adjacent face normals, for meshes without normals: only the plane of the tangent depends on them.
std::vector<Vec3> average_normals(const Mesh& mesh) {
    std::vector<Vec3> sums(mesh.positions.size(), Vec3(0.0F));
    for (const Triangle& triangle : mesh.triangles) {
        const Vec3 normal = normalize_or(scaled_face_normal(mesh, triangle), Vec3(0.0F));
        for (size_t corner = 0; corner < 3; ++corner) {
            sums[triangle[corner]] += normal * corner_angle(mesh, triangle, corner);
        }
    }
    for (Vec3& sum : sums) sum = normalize_or(sum, Vec3(0.0F, 0.0F, 1.0F));
    return sums;
}

}  // namespace

Vec3 normalize_or(const Vec3& v, const Vec3& fallback) {
    const float largest = glm::max(glm::abs(v.x), glm::max(glm::abs(v.y), glm::abs(v.z)));
    if (!(largest > 0.0F) || !std::isfinite(largest)) return fallback;
    return glm::normalize(v / largest);
}

size_t normalize_normals(Mesh& mesh) {
    std::vector<uint32_t> missing;
    for (size_t i = 0; i < mesh.normals.size(); ++i) {
        mesh.normals[i] = normalize_or(mesh.normals[i], Vec3(0.0F));
        if (mesh.normals[i] == Vec3(0.0F)) missing.push_back(static_cast<uint32_t>(i));
    }
    if (missing.empty()) return 0;
    std::vector<Vec3> sums(mesh.normals.size(), Vec3(0.0F));
    for (const Triangle& triangle : mesh.triangles) {
        for (const uint32_t vertex : triangle) sums[vertex] += scaled_face_normal(mesh, triangle);
    }
    for (const uint32_t vertex : missing) mesh.normals[vertex] = normalize_or(sums[vertex], Vec3(0.0F, 0.0F, 1.0F));
    return missing.size();
}

void compute_tangents(Mesh& mesh, int uv_set, const glm::mat2& uv_matrix) {
    const std::vector<float> handedness = split_by_handedness(mesh, uv_set, uv_matrix);
    const std::vector<Vec3> averages = mesh.normals.empty() ? average_normals(mesh) : std::vector<Vec3>();
    const std::vector<Vec3>& normals = mesh.normals.empty() ? averages : mesh.normals;
    std::vector<Vec3> sums(mesh.positions.size(), Vec3(0.0F));
    for (const Triangle& triangle : mesh.triangles) {
        const Vec3 tangent = texture_frame(mesh, triangle, uv_set, uv_matrix).tangent;
        for (size_t corner = 0; corner < 3; ++corner) {
            const Vec3 normal = normals[triangle[corner]];
            const Vec3 projected = normalize_or(tangent - normal * glm::dot(normal, tangent), Vec3(0.0F));
            sums[triangle[corner]] += projected * corner_angle(mesh, triangle, corner);
        }
    }
    mesh.tangents.resize(mesh.positions.size());
    for (size_t i = 0; i < sums.size(); ++i) {
        mesh.tangents[i] = Vec4(normalize_or(sums[i], any_orthogonal(normals[i])), handedness[i] < 0.0F ? -1.0F : 1.0F);
    }
}

}  // namespace nephroid

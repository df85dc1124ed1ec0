// Vertex attributes that a file leaves out.
#pragma once

#include "core/mesh.h"

namespace nephroid {

/// The direction of v, or `fallback` where it has none; right also where the squared length is not a float.
Vec3 normalize_or(const Vec3& v, const Vec3& fallback);

/// Makes all normals unit length; those of length zero become the average direction of the adjacent triangles (weighted
/// by area). Returns how many had no direction.
size_t normalize_normals(Mesh& mesh);

/// Computes `tangents` along the direction in which u grows, after uv_matrix is applied to mesh.uvs[uv_set]; the
/// handedness w makes cross(normal, tangent) * w point up in the picture, where v falls, as glTF's normal maps expect.
/// Contributions of triangles are weighted by angle. Vertices shared by triangles of both handedness (mirrored texture)
/// are duplicated.
void compute_tangents(Mesh& mesh, int uv_set, const glm::mat2& uv_matrix);

}  // namespace nephroid

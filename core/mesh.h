// Triangle meshes: one mesh per glTF primitive, so that each has one material.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"

namespace nephroid {

using Triangle = std::array<uint32_t, 3>;

struct Mesh {
    std::string name;
    int material = 0;                 ///< Index into Scene::materials; always valid.
    std::vector<Triangle> triangles;  ///< Indices below positions.size().
    /// Object space (metres), or world space once `flatten_single_use_meshes` has run. The vector's capacity exceeds
    /// its size by at least one: Embree may read 4 bytes past the last vertex.
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;             ///< Unit shading normals per vertex; empty: the geometric normal.
    std::array<std::vector<Vec2>, 2> uvs;  ///< TEXCOORD_0 and _1; empty where the material needs none.
    std::vector<Vec4> tangents;            ///< xyz unit, w = +-1 handedness; only where a normal map needs them.
    std::vector<Vec4> colors;              ///< COLOR_0, linear RGBA; empty: white.
    size_t coarse_triangles = 0;           ///< Triangles before `densify_objects` split them; 0: as in the file.
};

/// A mesh placed in the world.
struct Object {
    std::string name;          ///< Of the glTF node.
    int mesh = 0;              ///< Index into Scene::meshes.
    Mat4 to_world{1.0F};       ///< Identity once the mesh has been flattened. May mirror (negative determinant).
    bool no_caustics = false;  ///< extras.caustics = "none": never a caster.
    /// extras.densify: no edge of the mesh is to be longer in world space (metres); 0: leave the mesh as it is.
    float densify = 0.0F;
};

}  // namespace nephroid

// Everything that is rendered, as plain data.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/error.h"
#include "core/light.h"
#include "core/material.h"
#include "core/mesh.h"
#include "core/texture.h"

namespace nephroid {

/// Lat-long environment light; environment.h says how directions map to the picture.
struct EnvironmentMap {
    Image image;         ///< float32, 3 channels: radiance.
    float scale = 1.0F;  ///< Factor on the radiance.
};

struct Scene {
    std::string file;  ///< As given on the command line.
    std::vector<Mesh> meshes;
    std::vector<Object> objects;
    std::vector<Material> materials;
    std::vector<Image> images;
    std::vector<PunctualLight> lights;
    std::vector<Camera> cameras;  ///< In the order of the scene's nodes, depth first.
    std::optional<EnvironmentMap> environment;
    Warnings warnings;

    size_t triangle_count() const;  ///< Sum over objects: instances count each time.
};

/// Axis-aligned bounds of all objects in world space; empty (min > max) without geometry. Exact for flattened meshes,
/// the bounds of their transformed boxes for others.
struct Bounds {
    Vec3 min{1e30F};
    Vec3 max{-1e30F};
    bool empty() const { return min.x > max.x; }
    void extend(const Vec3& p) {
        min = glm::min(min, p);
        max = glm::max(max, p);
    }
};
Bounds world_bounds(const Scene& scene);

/// Moves every mesh that exactly one object uses, and every emitting mesh, to world space: its object's transform
/// becomes the identity (an emitting mesh with several objects is copied). Other meshes stay shared (instances).
void flatten_single_use_meshes(Scene& scene);

}  // namespace nephroid

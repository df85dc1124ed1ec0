// Bidirectional weights the slow, obvious way: the density of a whole path under every strategy, vertex by vertex in
// double precision. The twin of integrators/subpaths/mis_recursion.h in tests.
#pragma once

#include <optional>
#include <vector>

#include "core/light_emission.h"
#include "integrators/integrator.h"

namespace nephroid::testing {

/// A surface vertex of a path. Directions follow from the positions of its neighbours.
struct TwinVertex {
    Vec3 position, geometric_normal, shading_normal;
    BsdfParameters<float> bsdf;
    bool delta = false;  ///< The path passes it by its mirror direction.
};

/// A path from a light to the camera: surface vertices from the light on, and where it starts.
struct TwinPath {
    uint32_t light = 0;          ///< Index in the LightSet.
    Vec3 light_point{0.0F};      ///< Unused for directional and environment lights.
    Vec3 light_normal{0.0F};     ///< Of triangles and spheres.
    Vec3 light_direction{0.0F};  ///< Unit, away from the light.
    float light_area = 0.0F;     ///< Of a triangle.
    bool delta_light = false;
    bool infinite = false;
    std::vector<TwinVertex> vertices;
    Vec3 camera_position{0.0F};
    float camera_density = 0.0F;  ///< Of a pixel's camera rays at the last vertex, per area.
};

class BdptTwin {
  public:
    /// Keeps references.
    BdptTwin(const RenderContext& context, const LightEmission& emission, float light_paths)
        : context_(context), emission_(emission), light_paths_(light_paths) {}

    /// A random path of at most `most_vertices` surface vertices, traced from the camera to a sampled light point.
    std::optional<TwinPath> random_path(uint32_t index, size_t most_vertices) const;

    /// Weights of strategies s = 0 .. vertices (s vertices from the light), by the power heuristic; their sum is one.
    std::vector<double> explicit_weights(const TwinPath& path) const;
    /// The same weights from the sums that sub-paths carry; zero where there is no such strategy.
    std::vector<double> recursive_weights(const TwinPath& path) const;

  private:
    double scattering_pdf(const TwinPath& path, size_t vertex, bool towards_camera) const;
    double area_pdf(const TwinPath& path, size_t vertex, bool from_light) const;
    bool exists(const TwinPath& path, size_t s) const;
    double density(const TwinPath& path, size_t s) const;
    double direct_pdf(const TwinPath& path) const;

    const RenderContext& context_;
    const LightEmission& emission_;
    float light_paths_;
};

}  // namespace nephroid::testing

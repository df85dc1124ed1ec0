// Small scenes and the machinery to render them inside a test.
#pragma once

#include <memory>
#include <vector>

#include "accel/accelerator.h"
#include "accel/surface.h"
#include "core/light_set.h"
#include "core/scene.h"
#include "integrators/integrator.h"

namespace nephroid::testing {

/// A mesh of two triangles: the parallelogram corner, corner + a, corner + a + b, corner + b; front side a x b.
Mesh quad(const Vec3& corner, const Vec3& a, const Vec3& b, int material);
/// Unit-normal sphere of `rings` x 2 rings quads with smooth normals.
Mesh sphere(const Vec3& centre, float radius, int rings, int material, bool inward = false);

Material lambert(const Rgb& albedo);
Material metal(const Rgb& f0, float alpha);
Material emitter(const Rgb& radiance, const Rgb& albedo = Rgb(0.0F));

/// Adds a mesh and an object that shows it untransformed.
void add_mesh(Scene& scene, Mesh mesh);

PunctualLight point_light(const Vec3& position, const Rgb& intensity);
Camera look_at(const Vec3& eye, const Vec3& target, float yfov = 0.7F);

/// All that an integrator needs, built from a scene; the scene must outlive it.
struct PreparedScene {
    PreparedScene(const Scene& scene, const Camera& camera, int width, int height);
    Accelerator accelerator;
    Surfaces surfaces;
    LightSet lights;
    RenderContext context;
};

/// Mean of each pixel by `integrator`, RGB interleaved.
struct Picture {
    int width = 0;
    int height = 0;
    std::vector<float> rgb;
    std::vector<float> variance;  ///< Of each value's mean.
    Rgb mean() const;
};
Picture render(const Integrator& integrator, const RenderContext& context, int width, int height, uint32_t spp,
               int threads = 2);

}  // namespace nephroid::testing

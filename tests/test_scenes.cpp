#include "tests/test_scenes.h"

#include <glm/gtc/matrix_transform.hpp>

#include "core/casters.h"
#include "integrators/driver.h"

namespace nephroid::testing {

Mesh quad(const Vec3& corner, const Vec3& a, const Vec3& b, int material) {
    Mesh mesh;
    mesh.material = material;
    mesh.positions.reserve(5);
    mesh.positions = {corner, corner + a, corner + a + b, corner + b};
    mesh.positions.reserve(5);
    mesh.uvs[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

Mesh sphere(const Vec3& centre, float radius, int rings, int material, bool inward) {
    Mesh mesh;
    mesh.material = material;
    const int columns = 2 * rings;
    for (int i = 0; i <= rings; ++i) {
        for (int j = 0; j <= columns; ++j) {
            const float theta = pi * static_cast<float>(i) / static_cast<float>(rings);
            const float phi = 2.0F * pi * static_cast<float>(j) / static_cast<float>(columns);
            const Vec3 n(std::sin(theta) * std::cos(phi), std::cos(theta), -std::sin(theta) * std::sin(phi));
            mesh.positions.push_back(centre + radius * n);
            mesh.normals.push_back(inward ? -n : n);
        }
    }
    mesh.positions.reserve(mesh.positions.size() + 1);
    const auto index = [columns](int i, int j) { return static_cast<uint32_t>(i * (columns + 1) + j); };
    for (int i = 0; i < rings; ++i) {
        for (int j = 0; j < columns; ++j) {
            Triangle first{index(i, j), index(i + 1, j), index(i + 1, j + 1)};
            Triangle second{index(i, j), index(i + 1, j + 1), index(i, j + 1)};
            if (inward) {
                std::swap(first[1], first[2]);
                std::swap(second[1], second[2]);
            }
            if (i + 1 < rings) mesh.triangles.push_back(first);
            if (i > 0) mesh.triangles.push_back(second);
        }
    }
    return mesh;
}

Material lambert(const Rgb& albedo) {
    Material material;
    material.base_color = Vec4(albedo, 1.0F);
    material.metallic = 0.0F;
    material.specular = 0.0F;
    return material;
}

Material metal(const Rgb& f0, float alpha) {
    Material material;
    material.base_color = Vec4(f0, 1.0F);
    material.roughness = std::sqrt(alpha);
    return material;
}

Material emitter(const Rgb& radiance, const Rgb& albedo) {
    Material material = lambert(albedo);
    material.emission = radiance;
    return material;
}

void add_mesh(Scene& scene, Mesh mesh) {
    Object object;
    object.mesh = static_cast<int>(scene.meshes.size());
    scene.meshes.push_back(std::move(mesh));
    scene.objects.push_back(object);
}

PunctualLight point_light(const Vec3& position, const Rgb& intensity) {
    PunctualLight light;
    light.position = position;
    light.intensity = intensity;
    return light;
}

Camera look_at(const Vec3& eye, const Vec3& target, float yfov) {
    Camera camera;
    camera.yfov = yfov;
    const Vec3 direction = glm::normalize(target - eye);
    const Vec3 up = std::abs(direction.y) > 0.99F ? Vec3(0, 0, 1) : Vec3(0, 1, 0);
    camera.to_world = glm::inverse(glm::lookAt(eye, target, up));
    return camera;
}

PreparedScene::PreparedScene(const Scene& scene, const Camera& camera, int width, int height)
    : accelerator(scene, 2),
      surfaces(scene),
      lights(scene),
      context{scene, accelerator, surfaces,           lights, make_camera_rays(camera, width, height),
              12,    0,           SamplerKind::sobol, {}} {
    surfaces.set_casters(find_casters(scene).is_caster);
}

Rgb Picture::mean() const {
    glm::dvec3 sum(0.0);
    for (size_t i = 0; i + 2 < rgb.size(); i += 3) sum += glm::dvec3(rgb[i], rgb[i + 1], rgb[i + 2]);
    return Rgb(sum / (static_cast<double>(rgb.size()) / 3.0));
}

Picture render(const Integrator& integrator, const RenderContext& context, int width, int height, uint32_t spp,
               int threads) {
    AovSelection aovs = context.aovs;
    aovs.variance = true;
    Film film(width, height, {0, 0, width, height}, aovs, true);
    DriverSettings settings;
    settings.spp = spp;
    settings.threads = threads;
    settings.process_start = std::chrono::steady_clock::now();
    Progress progress(Verbosity::quiet);
    run_render(integrator, film, settings, progress);
    return {width, height, film.beauty(), film.variance()};
}

}  // namespace nephroid::testing

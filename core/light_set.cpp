#include "core/light_set.h"

#include <algorithm>
#include <cmath>

#include "core/delta_light.h"
#include "core/frame.h"
#include "core/rounding.h"
#include "core/warp.h"

namespace nephroid {

namespace {

struct EmissiveTriangle {
    Vec3 p0, p1, p2;
    Vec3 cross;  ///< Unnormalised geometric normal; its length is twice the area.
};

EmissiveTriangle triangle_of(const Scene& scene, const TriangleLight& light) {
    const Mesh& mesh = scene.meshes[static_cast<size_t>(scene.objects[light.object].mesh)];
    const Triangle& t = mesh.triangles[light.triangle];
    const Vec3& p0 = mesh.positions[t[0]];
    const Vec3& p1 = mesh.positions[t[1]];
    const Vec3& p2 = mesh.positions[t[2]];
    return {p0, p1, p2, glm::cross(p1 - p0, p2 - p0)};
}

void interpolate_uv(const Mesh& mesh, const Triangle& t, Vec2 b, Vec2 uv[2]) {
    for (size_t set = 0; set < 2; ++set) {
        const auto& values = mesh.uvs[set];
        uv[set] =
            values.empty() ? Vec2(0.0F) : (1.0F - b.x - b.y) * values[t[0]] + b.x * values[t[1]] + b.y * values[t[2]];
    }
}

/// Power-like weight of a triangle: area times mean emitted luminance, estimated at a few points where textured.
/// It only steers the selection, so an estimate is enough.
float triangle_power(const Scene& scene, const Mesh& mesh, const Material& material, const TriangleLight& light) {
    const float area = 0.5F * glm::length(triangle_of(scene, light).cross);
    if (!std::isfinite(area)) return 0.0F;
    float emitted = luminance(material.emission);
    if (material.emissive_texture.image >= 0) {
        constexpr Vec2 probes[] = {{0.33F, 0.33F}, {0.1F, 0.1F},  {0.8F, 0.1F},
                                   {0.1F, 0.8F},   {0.45F, 0.1F}, {0.1F, 0.45F}};
        float sum = 0.0F;
        for (const Vec2& b : probes) {
            Vec2 uv[2];
            interpolate_uv(mesh, mesh.triangles[light.triangle], b, uv);
            sum += luminance(emitted_radiance(scene, material, uv));
        }
        // The share of the untextured emission keeps a triangle selectable whose probes all miss its bright texels.
        emitted = 0.1F * emitted + 0.9F * sum / static_cast<float>(std::size(probes));
    }
    return area * emitted * pi * (material.double_sided ? 2.0F : 1.0F);
}

float sphere_one_minus_cos(float radius, float distance2) {
    const float sin2 = radius * radius / distance2;
    return sin2 / (1.0F + safe_sqrt(1.0F - sin2));
}

}  // namespace

Rgb emitted_radiance(const Scene& scene, const Material& material, const Vec2 uv[2]) {
    const TextureReference& texture = material.emissive_texture;
    if (texture.image < 0) return material.emission;
    return material.emission *
           Rgb(sample_texture(scene.images[static_cast<size_t>(texture.image)], texture, uv[texture.uv_set]));
}

Rgb LightSet::sphere_radiance(const PunctualLight& light) {
    return light.intensity / (pi * light.radius * light.radius);
}

LightSet::LightSet(const Scene& scene) : scene_(scene), first_triangle_(scene.objects.size(), none) {
    const Bounds bounds = world_bounds(scene);
    const float scene_radius = bounds.empty() ? 1.0F : 0.5F * glm::length(bounds.max - bounds.min);
    const float scene_area = pi * scene_radius * scene_radius;

    std::vector<float> powers;
    for (const PunctualLight& light : scene.lights) {
        const float intensity = luminance(light.intensity);
        switch (light.kind) {
            case LightKind::point:
            case LightKind::sphere:
                powers.push_back(4.0F * pi * intensity);
                break;
            case LightKind::spot:
                powers.push_back(2.0F * pi * intensity * (1.0F - 0.5F * (light.cos_inner + light.cos_outer)));
                break;
            case LightKind::directional:
                powers.push_back(intensity * scene_area);
                break;
        }
        hittable_ |= light.kind == LightKind::sphere;
    }
    add_triangles(powers);
    if (scene.environment) {
        environment_.emplace(*scene.environment);
        powers.push_back(environment_->total_luminance() * scene_area);
        hittable_ = true;
    }
    if (!powers.empty()) selection_ = AliasTable(powers);
}

void LightSet::add_triangles(std::vector<float>& powers) {
    for (size_t i = 0; i < scene_.objects.size(); ++i) {
        const Mesh& mesh = scene_.meshes[static_cast<size_t>(scene_.objects[i].mesh)];
        const Material& material = scene_.materials[static_cast<size_t>(mesh.material)];
        if (!material.emits()) continue;
        first_triangle_[i] = static_cast<uint32_t>(powers.size());
        hittable_ = true;
        for (size_t t = 0; t < mesh.triangles.size(); ++t) {
            triangles_.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(t)});
            powers.push_back(triangle_power(scene_, mesh, material, triangles_.back()));
        }
    }
}

LightSample LightSet::sample(float u_select, Vec2 u, const Vec3& p) const {
    const auto light = static_cast<uint32_t>(selection_.sample(u_select));
    const float probability = selection_.probability(light);
    LightSample sample;
    if (light < scene_.lights.size()) {
        sample = sample_punctual(scene_.lights[light], u, p);
    } else if (const size_t triangle = light - scene_.lights.size(); triangle < triangles_.size()) {
        sample = sample_triangle(triangles_[triangle], u, p);
    } else {
        Environment::Evaluation evaluation;
        sample.wi = environment_->sample(u, evaluation);
        sample.pdf = evaluation.pdf;
        sample.radiance = evaluation.radiance;
        sample.infinite = true;
    }
    sample.pdf *= probability;
    sample.light = light;
    return sample;
}

LightSample LightSet::sample_punctual(const PunctualLight& light, Vec2 u, const Vec3& p) const {
    LightSample sample;
    if (light.kind != LightKind::sphere) {
        const DeltaLightSample<float> delta = sample_delta_light(light, to_triple(p));
        sample.wi = to_vec3(delta.wi);
        sample.radiance = to_vec3(delta.irradiance);
        sample.target = light.position;
        sample.infinite = light.kind == LightKind::directional;
        sample.delta = true;
        sample.pdf = 1.0F;
        return sample;
    }
    const Vec3 to_light = light.position - p;
    const float distance2 = glm::dot(to_light, to_light);
    // Uniform in the cone that the sphere subtends; nothing inside the sphere, which emits outwards only.
    if (distance2 <= light.radius * light.radius) return sample;
    const float distance = std::sqrt(distance2);
    const float one_minus_cos_max = sphere_one_minus_cos(light.radius, distance2);
    const Triple<float> local = square_to_uniform_cone(u.x, u.y, one_minus_cos_max);
    sample.wi = to_vec3(make_frame(to_triple(to_light / distance)).to_world(local));
    const float sin2 = local.x * local.x + local.y * local.y;
    const float depth = safe_sqrt(light.radius * light.radius - distance2 * sin2);
    // The ray must end before the sphere's own surface, whose computed depth is off by the rounding of the distance
    // to the sphere's axis, which the silhouette amplifies to a square root.
    const float margin = std::sqrt(rounding_bound(32) * distance * light.radius) + rounding_bound(32) * distance;
    sample.target = p + sample.wi * std::max(distance * local.z - depth - margin, 0.0F);
    sample.radiance = sphere_radiance(light);
    sample.pdf = uniform_cone_pdf(one_minus_cos_max);
    return sample;
}

TrianglePoint sample_triangle_point(const Scene& scene, const TriangleLight& light, Vec2 u) {
    const EmissiveTriangle t = triangle_of(scene, light);
    const Mesh& mesh = scene.meshes[static_cast<size_t>(scene.objects[light.object].mesh)];
    const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
    const Vec2 b = square_to_triangle(u);
    const float b0 = 1.0F - b.x - b.y;
    const float cross_length = glm::length(t.cross);
    Vec2 uv[2];
    interpolate_uv(mesh, mesh.triangles[light.triangle], b, uv);
    TrianglePoint point;
    point.position = b0 * t.p0 + b.x * t.p1 + b.y * t.p2;
    point.error = rounding_bound(8) * (glm::abs(b0 * t.p0) + glm::abs(b.x * t.p1) + glm::abs(b.y * t.p2));
    if (cross_length > 0.0F) point.normal = t.cross / cross_length;
    point.area = 0.5F * cross_length;
    point.radiance = emitted_radiance(scene, material, uv);
    point.double_sided = material.double_sided;
    return point;
}

LightSample LightSet::sample_triangle(const TriangleLight& light, Vec2 u, const Vec3& p) const {
    LightSample sample;
    const TrianglePoint point = sample_triangle_point(scene_, light, u);
    const Vec3 to_light = point.position - p;
    const float distance2 = glm::dot(to_light, to_light);
    if (!(distance2 > 0.0F) || !(point.area > 0.0F)) return sample;
    sample.wi = to_light / std::sqrt(distance2);
    const float cosine = -glm::dot(point.normal, sample.wi);
    if (cosine == 0.0F || (cosine < 0.0F && !point.double_sided)) return sample;
    sample.target = offset_ray_origin(point.position, point.error, point.normal, -sample.wi);
    sample.radiance = point.radiance;
    sample.pdf = distance2 / (std::abs(cosine) * point.area);
    return sample;
}

float LightSet::pdf_triangle(uint32_t object, uint32_t triangle, float area, const Vec3& p, const Vec3& hit,
                             const Vec3& n) const {
    if (first_triangle_[object] == none) return 0.0F;
    const Vec3 to_light = hit - p;
    const float distance2 = glm::dot(to_light, to_light);
    const float cosine = std::abs(glm::dot(n, to_light)) / std::sqrt(distance2);
    const float density = distance2 / (cosine * area);
    return std::isfinite(density) ? selection_.probability(first_triangle_[object] + triangle) * density : 0.0F;
}

float LightSet::pdf_sphere(uint32_t light, const Vec3& p) const {
    const PunctualLight& sphere = scene_.lights[light];
    const Vec3 to_light = sphere.position - p;
    const float distance2 = glm::dot(to_light, to_light);
    if (distance2 <= sphere.radius * sphere.radius) return 0.0F;
    return selection_.probability(light) * uniform_cone_pdf(sphere_one_minus_cos(sphere.radius, distance2));
}

}  // namespace nephroid

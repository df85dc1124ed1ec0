#include "core/casters.h"

#include <algorithm>

namespace nephroid {

namespace {

/// Smallest alpha that a material can show: its roughness texture may lower it to its smallest texel.
float smallest_alpha(const Scene& scene, const Material& material) {
    float roughness = material.roughness;
    const TextureReference& texture = material.metallic_roughness_texture;
    if (texture.image >= 0) {
        const Image& image = scene.images[static_cast<size_t>(texture.image)];
        const auto channels = static_cast<size_t>(image.channels);
        const size_t green = std::min<size_t>(1, channels - 1);
        float smallest = 1.0F;
        for (size_t i = green; i < image.bytes.size(); i += channels) {
            smallest = std::min(smallest, static_cast<float>(image.bytes[i]) / 255.0F);
        }
        for (size_t i = green; i < image.floats.size(); i += channels) smallest = std::min(smallest, image.floats[i]);
        roughness *= smallest;
    }
    return roughness * roughness;
}

bool reflects(const Material& material) {
    return material.metallic > 0.0F || (material.specular > 0.0F && material.ior != 1.0F);
}

Bounds object_bounds(const Scene& scene, const Object& object) {
    Bounds bounds;
    for (const Vec3& p : scene.meshes[static_cast<size_t>(object.mesh)].positions) {
        bounds.extend(Vec3(object.to_world * Vec4(p, 1.0F)));
    }
    return bounds;
}

bool is_small_from(const PunctualLight& light, const Bounds& bounds) {
    if (light.kind != LightKind::sphere) return true;
    const Vec3 nearest = glm::clamp(light.position, bounds.min, bounds.max);
    const float distance = glm::length(nearest - light.position);
    return light.radius < max_small_light_angle * distance;
}

}  // namespace

CasterReport find_casters(const Scene& scene) {
    CasterReport report;
    std::vector<bool> small(scene.lights.size(), false);
    for (const Object& object : scene.objects) {
        const Mesh& mesh = scene.meshes[static_cast<size_t>(object.mesh)];
        const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
        uint8_t caster = 0;
        std::string reason;
        if (object.no_caustics) {
            reason = "switched off by extras.caustics";
        } else if (!reflects(material)) {
            reason = "does not reflect";
        } else if (smallest_alpha(scene, material) > max_caster_alpha) {
            reason = "alpha above " + std::to_string(max_caster_alpha).substr(0, 4);
        } else {
            const Bounds bounds = object_bounds(scene, object);
            for (size_t i = 0; i < scene.lights.size() && !bounds.empty(); ++i) {
                if (!is_small_from(scene.lights[i], bounds)) continue;
                small[i] = true;
                caster = 1;
            }
            reason = caster != 0 ? "glossy and lit by a small light" : "glossy, but no small light";
        }
        report.is_caster.push_back(caster);
        report.reason.push_back(reason);
    }
    for (size_t i = 0; i < small.size(); ++i) {
        if (small[i]) report.small_lights.push_back(static_cast<uint32_t>(i));
    }
    return report;
}

}  // namespace nephroid

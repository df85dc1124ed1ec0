#include "core/gltf_light.h"

#include <algorithm>
#include <cmath>

#include "core/gltf_error.h"

namespace nephroid {

namespace {

/// Radius of the sphere light; the node's value wins over the light's. 0: none given.
float read_radius(GltfImport& import, const tinygltf::Light& light, const tinygltf::Node& node,
                  const std::string& element) {
    const tinygltf::Value* extras = node.extras.Has("radius") ? &node.extras : &light.extras;
    if (!extras->Has("radius")) return 0.0F;
    const double radius = number_or(*extras, "radius", -1.0);
    if (!(radius >= 0.0) || radius > 1e6) {
        fail_gltf(import.document.file, element, "extras.radius must be a length in metres from 0 to 1e6; correct it");
    }
    return static_cast<float>(radius);
}

Rgb read_intensity(const GltfImport& import, const tinygltf::Light& light, const std::string& element) {
    Rgb intensity(static_cast<float>(light.intensity));
    for (int c = 0; c < 3 && light.color.size() == 3; ++c) {
        intensity[c] = static_cast<float>(light.intensity * light.color[static_cast<size_t>(c)]);
    }
    for (int c = 0; c < 3; ++c) {
        // Beyond this, sums and products of radiance leave the range of floats.
        if (intensity[c] >= 0.0F && intensity[c] <= 1e20F) continue;
        fail_gltf(import.document.file, element, "intensity times colour must be from 0 to 1e20; correct it");
    }
    return intensity;
}

void read_cone(GltfImport& import, const tinygltf::SpotLight& spot, const std::string& element, PunctualLight& light) {
    constexpr double right_angle = 1.5707963267948966;
    const double outer = std::clamp(spot.outerConeAngle, 1e-4, right_angle);
    const double inner = std::clamp(spot.innerConeAngle, 0.0, outer);
    if (outer != spot.outerConeAngle || inner != spot.innerConeAngle) {
        warn_gltf(import, element, "cone angles are out of range; clamped to 0 <= inner <= outer <= pi/2");
    }
    light.cos_inner = static_cast<float>(std::cos(inner));
    light.cos_outer = static_cast<float>(std::cos(outer));
}

LightKind read_kind(const GltfImport& import, const tinygltf::Light& light, const std::string& element) {
    if (light.type == "point") return LightKind::point;
    if (light.type == "spot") return LightKind::spot;
    if (light.type == "directional") return LightKind::directional;
    fail_gltf(import.document.file, element,
              "unknown type '" + printable(light.type) + "'; use point, spot or directional");
}

}  // namespace

void import_light(GltfImport& import, int node_index, const glm::dmat4& to_world) {
    const tinygltf::Node& node = import.document.model.nodes[static_cast<size_t>(node_index)];
    const tinygltf::Value* extension = find_extension(node.extensions, "KHR_lights_punctual");
    if (extension == nullptr) return;
    const auto index = static_cast<size_t>(extension->Get("light").GetNumberAsInt());
    const tinygltf::Light& source = import.document.model.lights[index];
    const std::string element = element_name("light", index);

    PunctualLight light;
    light.name = printable(source.name.empty() ? node.name : source.name);
    light.kind = read_kind(import, source, element);
    light.intensity = read_intensity(import, source, element);
    light.position = Vec3(to_world[3]);
    const glm::dvec3 direction = -glm::dvec3(to_world[2]);
    if (light.kind == LightKind::spot || light.kind == LightKind::directional) {
        if (!(glm::length(direction) > 0.0)) {
            warn_gltf(import, element, "its node is scaled to nothing, so it has no direction; ignored");
            return;
        }
        light.direction = Vec3(glm::normalize(direction));
    }
    if (light.kind == LightKind::spot) read_cone(import, source.spot, element, light);
    const float radius = read_radius(import, source, node, element);
    if (radius > 0.0F && light.kind == LightKind::point) {
        light.kind = LightKind::sphere;
        light.radius = radius;
    } else if (radius > 0.0F) {
        warn_gltf(import, element, "extras.radius is for point lights only; ignored");
    }
    if (source.range > 0.0)
        warn_gltf(import, "lights", "range is ignored: intensity falls with the square of distance");
    if (light.intensity == Rgb(0.0F)) return;
    import.scene.lights.push_back(std::move(light));
}

}  // namespace nephroid

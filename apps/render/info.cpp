#include "apps/render/info.h"

#include <algorithm>
#include <sstream>

namespace nephroid {

namespace {

const char* kind_name(LightKind kind) {
    switch (kind) {
        case LightKind::point:
            return "point";
        case LightKind::spot:
            return "spot";
        case LightKind::directional:
            return "directional";
        case LightKind::sphere:
            return "sphere";
    }
    return "";
}

std::string quoted(const std::string& name) {
    return name.empty() ? "(unnamed)" : "'" + name + "'";
}

void describe_lights(const Scene& scene, const CasterReport& casters, std::ostream& out) {
    for (size_t i = 0; i < scene.lights.size(); ++i) {
        const PunctualLight& light = scene.lights[i];
        const bool small = std::count(casters.small_lights.begin(), casters.small_lights.end(), i) > 0;
        out << "light " << i << " " << quoted(light.name) << ": " << kind_name(light.kind) << ", intensity "
            << light.intensity.r << " " << light.intensity.g << " " << light.intensity.b
            << (light.kind == LightKind::directional ? " W/m^2" : " W/sr");
        if (light.kind == LightKind::sphere) out << ", radius " << light.radius << " m";
        out << (small ? ", makes caustics\n" : ", makes no caustics here\n");
    }
    if (scene.environment) {
        out << "environment " << scene.environment->image.name << ": " << scene.environment->image.width << "x"
            << scene.environment->image.height << ", scale " << scene.environment->scale << "\n";
    }
}

}  // namespace

std::string describe_scene(const Scene& scene, const CasterReport& casters) {
    std::ostringstream out;
    out << scene.file << ": " << scene.objects.size() << " objects, " << scene.meshes.size() << " meshes, "
        << scene.triangle_count() << " triangles, " << scene.materials.size() << " materials, " << scene.images.size()
        << " images, " << scene.cameras.size() << " cameras\n";
    for (size_t i = 0; i < scene.cameras.size(); ++i) {
        out << "camera " << i << " " << quoted(scene.cameras[i].name) << ": "
            << (scene.cameras[i].kind == CameraKind::perspective ? "perspective" : "orthographic") << "\n";
    }
    describe_lights(scene, casters, out);
    for (size_t i = 0; i < scene.objects.size(); ++i) {
        const Mesh& mesh = scene.meshes[static_cast<size_t>(scene.objects[i].mesh)];
        const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
        out << "object " << i << " " << quoted(scene.objects[i].name) << ": " << mesh.triangles.size() << " triangles"
            << (mesh.coarse_triangles > 0 ? " (densified from " + std::to_string(mesh.coarse_triangles) + ")" : "")
            << ", material " << quoted(material.name) << ", alpha " << material.roughness * material.roughness << ", "
            << (casters.is_caster[i] != 0 ? "caster" : "receiver") << " (" << casters.reason[i] << ")"
            << (material.emits() ? ", emits" : "") << "\n";
    }
    return out.str();
}

}  // namespace nephroid

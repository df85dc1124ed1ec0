#include "accel/surface.h"

#include <algorithm>
#include <cmath>

#include "core/rounding.h"

namespace nephroid {

namespace {

BsdfParameters<float> make_bsdf(const Material& material, const Rgb& base, float metallic, float roughness) {
    const float ratio = (material.ior - 1.0F) / (material.ior + 1.0F);
    const Rgb f0 = glm::min(ratio * ratio * material.specular_color, Rgb(1.0F)) * material.specular;
    return {to_triple(glm::clamp(base, Rgb(0.0F), Rgb(1.0F))), to_triple(f0), material.specular, metallic,
            std::min(roughness * roughness, 1.0F)};
}

template <class T>
T interpolate(const std::vector<T>& values, const Triangle& t, const Vec3& w) {
    return w.x * values[t[0]] + w.y * values[t[1]] + w.z * values[t[2]];
}

bool has_texture(const Material& m) {
    return m.base_color_texture.image >= 0 || m.metallic_roughness_texture.image >= 0 || m.normal_texture.image >= 0 ||
           m.emissive_texture.image >= 0;
}

}  // namespace

Surfaces::Surfaces(const Scene& scene) : scene_(scene) {
    instances_.reserve(scene.objects.size());
    records_.reserve(scene.objects.size());
    for (const Object& object : scene.objects) {
        const Mesh& mesh = scene.meshes[static_cast<size_t>(object.mesh)];
        const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
        const InstanceTransform* instance = nullptr;
        if (object.to_world != Mat4(1.0F)) {
            instances_.push_back({object.to_world, glm::transpose(glm::inverse(Mat3(object.to_world)))});
            instance = &instances_.back();
        }
        records_.push_back({mesh.triangles.data(), mesh.positions.data(),
                            mesh.normals.empty() ? nullptr : mesh.normals.data(), &material, &mesh, instance,
                            make_bsdf(material, Rgb(material.base_color), material.metallic, material.roughness),
                            has_texture(material) || !mesh.colors.empty(), material.emits(), false});
    }
}

void Surfaces::set_casters(const std::vector<uint8_t>& casters) {
    for (size_t i = 0; i < records_.size(); ++i) records_[i].caster = casters[i] != 0;
}

SurfaceInteraction Surfaces::interact(uint32_t object, uint32_t primitive, float u, float v, const Vec3& wo) const {
    const Record& record = records_[object];
    const Triangle& t = record.triangles[primitive];
    const Vec3 weights(1.0F - u - v, u, v);
    Vec3 p0 = record.positions[t[0]];
    Vec3 p1 = record.positions[t[1]];
    Vec3 p2 = record.positions[t[2]];
    Vec3 transform_error(0.0F);
    if (record.instance != nullptr) {
        const Mat4& m = record.instance->to_world;
        const Mat3 magnitude(glm::abs(Vec3(m[0])), glm::abs(Vec3(m[1])), glm::abs(Vec3(m[2])));
        transform_error = magnitude * glm::max(glm::abs(p0), glm::max(glm::abs(p1), glm::abs(p2))) + glm::abs(Vec3(m[3]));
        p0 = Vec3(m * Vec4(p0, 1.0F));
        p1 = Vec3(m * Vec4(p1, 1.0F));
        p2 = Vec3(m * Vec4(p2, 1.0F));
    }

    SurfaceInteraction surface;
    const Vec3 a = weights.x * p0;
    const Vec3 b = weights.y * p1;
    const Vec3 c = weights.z * p2;
    surface.position = a + b + c;
    // Interpolation rounds relative to the terms; Embree's plane test relative to the vertices' distance from the ray.
    const Vec3 extent = glm::max(glm::abs(p0 - surface.position),
                                 glm::max(glm::abs(p1 - surface.position), glm::abs(p2 - surface.position)));
    surface.error = rounding_bound(8) * (glm::abs(a) + glm::abs(b) + glm::abs(c)) + rounding_bound(8) * extent +
                    rounding_bound(8) * transform_error;

    Vec3 cross = glm::cross(p1 - p0, p2 - p0);
    const float length = glm::length(cross);
    // Mirroring instances reverse the winding (glTF 2.0, Sec. 3.7.2.1).
    const bool mirrored = record.instance != nullptr && glm::determinant(Mat3(record.instance->to_world)) < 0.0F;
    Vec3 normal = length > 0.0F ? cross * ((mirrored ? -1.0F : 1.0F) / length) : Vec3(0.0F);
    surface.front = glm::dot(normal, wo) >= 0.0F;
    surface.geometric_normal = surface.front ? normal : -normal;

    surface.shading_normal = surface.geometric_normal;
    if (record.normals != nullptr) {
        Vec3 n = weights.x * record.normals[t[0]] + weights.y * record.normals[t[1]] + weights.z * record.normals[t[2]];
        if (record.instance != nullptr) n = record.instance->normal_to_world * n;
        const float n_length2 = glm::dot(n, n);
        if (n_length2 > 0.0F) surface.shading_normal = n / std::sqrt(n_length2);
    }
    if (record.textured) {
        interpolate_texture_coordinates(record, t, weights, surface);
        if (record.material->normal_texture.image >= 0) apply_normal_map(record, t, weights, surface);
        surface.bsdf = textured_bsdf(record, t, weights, surface);
    } else {
        surface.bsdf = record.constant_bsdf;
    }
    if (glm::dot(surface.shading_normal, surface.geometric_normal) < 0.0F) {
        surface.shading_normal = -surface.shading_normal;
    }
    if (record.emits) surface.area = 0.5F * length;
    return surface;
}

void Surfaces::interpolate_texture_coordinates(const Record& record, const Triangle& t, const Vec3& weights,
                                               SurfaceInteraction& surface) const {
    for (size_t set = 0; set < 2; ++set) {
        const auto& uvs = record.mesh->uvs[set];
        if (!uvs.empty()) surface.uv[set] = interpolate(uvs, t, weights);
    }
}

void Surfaces::apply_normal_map(const Record& record, const Triangle& t, const Vec3& weights,
                                SurfaceInteraction& surface) const {
    if (record.mesh->tangents.empty()) return;
    Vec3 tangent(interpolate(record.mesh->tangents, t, weights));
    if (record.instance != nullptr) tangent = Mat3(record.instance->to_world) * tangent;
    const Vec3& n = surface.shading_normal;
    tangent -= n * glm::dot(n, tangent);
    const float length2 = glm::dot(tangent, tangent);
    if (!(length2 > 0.0F)) return;
    tangent /= std::sqrt(length2);
    float handedness = record.mesh->tangents[t[0]].w;
    if (record.instance != nullptr && glm::determinant(Mat3(record.instance->to_world)) < 0.0F) handedness = -handedness;
    const Vec3 bitangent = glm::cross(n, tangent) * handedness;

    const Material& material = *record.material;
    const TextureReference& texture = material.normal_texture;
    const Vec3 texel(sample_texture(scene_.images[static_cast<size_t>(texture.image)], texture, surface.uv[texture.uv_set]));
    const Vec3 local = (2.0F * texel - 1.0F) * Vec3(material.normal_scale, material.normal_scale, 1.0F);
    const Vec3 mapped = tangent * local.x + bitangent * local.y + n * local.z;
    const float mapped_length2 = glm::dot(mapped, mapped);
    if (mapped_length2 > 0.0F) surface.shading_normal = mapped / std::sqrt(mapped_length2);
}

BsdfParameters<float> Surfaces::textured_bsdf(const Record& record, const Triangle& t, const Vec3& weights,
                                              const SurfaceInteraction& surface) const {
    const Material& material = *record.material;
    Rgb base(material.base_color);
    float metallic = material.metallic;
    float roughness = material.roughness;
    if (!record.mesh->colors.empty()) base *= Rgb(interpolate(record.mesh->colors, t, weights));
    if (const TextureReference& texture = material.base_color_texture; texture.image >= 0) {
        base *= Rgb(sample_texture(scene_.images[static_cast<size_t>(texture.image)], texture, surface.uv[texture.uv_set]));
    }
    if (const TextureReference& texture = material.metallic_roughness_texture; texture.image >= 0) {
        const Vec4 texel =
            sample_texture(scene_.images[static_cast<size_t>(texture.image)], texture, surface.uv[texture.uv_set]);
        roughness *= texel.g;
        metallic *= texel.b;
    }
    return make_bsdf(material, base, std::clamp(metallic, 0.0F, 1.0F), roughness);
}

}  // namespace nephroid

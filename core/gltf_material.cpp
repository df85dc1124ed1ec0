#include "core/gltf_material.h"

#include <algorithm>
#include <cmath>

#include "core/gltf_error.h"
#include "core/gltf_image.h"

namespace nephroid {

namespace {

/// A factor clamped into its range, with a warning where that changes it.
float clamped(GltfImport& import, double value, double low, double high, const std::string& element,
              const char* property) {
    const double result = std::clamp(value, low, high);
    if (result != value) {
        warn_gltf(import, element, std::string(property) + " is out of range; clamped to " + std::to_string(result));
    }
    return static_cast<float>(result);
}

/// Colours above 1 stay possible where only negative numbers are senseless.
constexpr double unbounded = 1e30;

WrapMode wrap_mode(GltfImport& import, int mode, const std::string& element) {
    switch (mode) {
        case TINYGLTF_TEXTURE_WRAP_REPEAT:
            return WrapMode::repeat;
        case TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT:
            return WrapMode::mirrored_repeat;
        case TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE:
            return WrapMode::clamp_to_edge;
        default:
            warn_gltf(import, element, "unknown wrap mode " + std::to_string(mode) + "; repeat is used");
    }
    return WrapMode::repeat;
}

void apply_sampler(GltfImport& import, const tinygltf::Texture& texture, TextureReference& reference) {
    if (texture.sampler < 0) return;
    const tinygltf::Sampler& sampler = import.document.model.samplers[static_cast<size_t>(texture.sampler)];
    const std::string element = element_name("sampler", static_cast<size_t>(texture.sampler));
    reference.wrap_u = wrap_mode(import, sampler.wrapS, element);
    reference.wrap_v = wrap_mode(import, sampler.wrapT, element);
    reference.nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
}

Vec2 vec2_or(const tinygltf::Value& object, const char* key, const Vec2& fallback) {
    if (!object.Has(key)) return fallback;
    const tinygltf::Value& value = object.Get(key);
    return {static_cast<float>(value.Get(0).GetNumberAsDouble()), static_cast<float>(value.Get(1).GetNumberAsDouble())};
}

void apply_texture_transform(const tinygltf::Value& transform, TextureReference& reference) {
    const Vec2 scale = vec2_or(transform, "scale", Vec2(1.0F));
    const auto rotation = static_cast<float>(number_or(transform, "rotation", 0.0));
    const float c = std::cos(rotation);
    const float s = std::sin(rotation);
    // A positive angle turns uv counter-clockwise as seen in the picture, whose v axis points down.
    reference.uv_matrix = glm::mat2(c * scale.x, -s * scale.x, s * scale.y, c * scale.y);
    reference.uv_offset = vec2_or(transform, "offset", Vec2(0.0F));
    reference.uv_set = static_cast<int>(number_or(transform, "texCoord", reference.uv_set));
}

/// Reads a slot of one of tinygltf's texture info types; without a usable texture the slot stays empty.
template <typename TextureInfo>
TextureReference import_texture(GltfImport& import, const TextureInfo& info, bool srgb, const std::string& element) {
    TextureReference reference;
    if (info.index < 0) return reference;
    const tinygltf::Texture& texture = import.document.model.textures[static_cast<size_t>(info.index)];
    const std::string texture_element = element_name("texture", static_cast<size_t>(info.index));
    if (texture.source < 0) {
        warn_gltf(import, texture_element, "it has no picture in a supported format; ignored");
        return reference;
    }
    reference.uv_set = info.texCoord;
    const tinygltf::Value* transform = find_extension(info.extensions, "KHR_texture_transform");
    if (transform != nullptr) apply_texture_transform(*transform, reference);
    if (reference.uv_set > 1) {
        warn_gltf(import, element, "only TEXCOORD_0 and TEXCOORD_1 are supported; " + texture_element + " ignored");
        return {};
    }
    apply_sampler(import, texture, reference);
    reference.srgb = srgb;
    reference.image = import_image(import, texture.source, srgb);
    return reference;
}

void apply_metallic_roughness(GltfImport& import, const tinygltf::PbrMetallicRoughness& source,
                              const std::string& element, Material& material) {
    for (int c = 0; c < 4; ++c) {
        material.base_color[c] =
            clamped(import, source.baseColorFactor[static_cast<size_t>(c)], 0.0, 1.0, element, "baseColorFactor");
    }
    material.metallic = clamped(import, source.metallicFactor, 0.0, 1.0, element, "metallicFactor");
    material.roughness = clamped(import, source.roughnessFactor, 0.0, 1.0, element, "roughnessFactor");
    material.base_color_texture = import_texture(import, source.baseColorTexture, true, element);
    material.metallic_roughness_texture = import_texture(import, source.metallicRoughnessTexture, false, element);
}

void apply_emission(GltfImport& import, const tinygltf::Material& source, const std::string& element,
                    Material& material) {
    const tinygltf::Value* extension = find_extension(source.extensions, "KHR_materials_emissive_strength");
    double strength = 1.0;
    if (extension != nullptr) {
        strength = double{clamped(import, number_or(*extension, "emissiveStrength", 1.0), 0.0, unbounded, element,
                                  "emissiveStrength")};
    }
    for (int c = 0; c < 3; ++c) {
        const double factor = source.emissiveFactor.empty() ? 0.0 : source.emissiveFactor[static_cast<size_t>(c)];
        material.emission[c] = clamped(import, std::max(factor, 0.0) * strength, 0.0, unbounded, element, "emission");
        if (factor < 0.0) warn_gltf(import, element, "emissiveFactor is negative; 0 is used");
    }
    if (material.emits()) material.emissive_texture = import_texture(import, source.emissiveTexture, true, element);
}

void apply_ior(GltfImport& import, const tinygltf::Material& source, const std::string& element, Material& material) {
    const tinygltf::Value* extension = find_extension(source.extensions, "KHR_materials_ior");
    if (extension == nullptr) return;
    const double ior = number_or(*extension, "ior", 1.5);
    // ior = 0 stands for F0 = 1, which ((ior - 1) / (ior + 1))^2 gives by itself.
    if (ior != 0.0) material.ior = clamped(import, ior, 1.0, 100.0, element, "ior");
    if (ior == 0.0) material.ior = 0.0F;
}

void apply_specular(GltfImport& import, const tinygltf::Material& source, const std::string& element,
                    Material& material) {
    const tinygltf::Value* extension = find_extension(source.extensions, "KHR_materials_specular");
    if (extension == nullptr) return;
    material.specular =
        clamped(import, number_or(*extension, "specularFactor", 1.0), 0.0, 1.0, element, "specularFactor");
    if (extension->Has("specularColorFactor")) {
        const tinygltf::Value& color = extension->Get("specularColorFactor");
        for (int c = 0; c < 3; ++c) {
            material.specular_color[c] =
                clamped(import, color.Get(c).GetNumberAsDouble(), 0.0, unbounded, element, "specularColorFactor");
        }
    }
    if (extension->Has("specularTexture") || extension->Has("specularColorTexture")) {
        warn_gltf(import, element, "textures of KHR_materials_specular are not supported; its factors are used");
    }
}

void apply_unsupported(GltfImport& import, const tinygltf::Material& source, const std::string& element,
                       Material& material) {
    if (find_extension(source.extensions, "KHR_materials_unlit") != nullptr) {
        warn_gltf(import, element, "KHR_materials_unlit is rendered as a diffuse surface that is lit");
        material.metallic = 0.0F;
        material.roughness = 1.0F;
        material.specular = 0.0F;
        material.emission = Rgb(0.0F);
        material.metallic_roughness_texture = {};
        material.normal_texture = {};
        material.emissive_texture = {};
    }
    for (const char* name : {"KHR_materials_transmission", "KHR_materials_volume"}) {
        if (find_extension(source.extensions, name) == nullptr) continue;
        warn_gltf(import, element, std::string(name) + " is not supported; the surface is opaque");
    }
}

void apply_alpha(GltfImport& import, const tinygltf::Material& source, const std::string& element, Material& material) {
    if (source.alphaMode == "MASK") {
        material.alpha_mode = AlphaMode::mask;
    } else if (source.alphaMode == "BLEND") {
        material.alpha_mode = AlphaMode::blend;
    } else if (source.alphaMode != "OPAQUE") {
        warn_gltf(import, element, "unknown alphaMode '" + printable(source.alphaMode) + "'; OPAQUE is used");
    }
    material.alpha_cutoff = clamped(import, source.alphaCutoff, 0.0, unbounded, element, "alphaCutoff");
}

Material convert_material(GltfImport& import, int index) {
    const tinygltf::Material& source = import.document.model.materials[static_cast<size_t>(index)];
    const std::string element = element_name("material", static_cast<size_t>(index));
    Material material;
    material.name = printable(source.name);
    material.double_sided = source.doubleSided;
    material.normal_scale = static_cast<float>(source.normalTexture.scale);
    material.normal_texture = import_texture(import, source.normalTexture, false, element);
    apply_metallic_roughness(import, source.pbrMetallicRoughness, element, material);
    apply_emission(import, source, element, material);
    apply_ior(import, source, element, material);
    apply_specular(import, source, element, material);
    apply_alpha(import, source, element, material);
    apply_unsupported(import, source, element, material);
    return material;
}

}  // namespace

int import_material(GltfImport& import, int index) {
    const auto found = import.materials.find(index);
    if (found != import.materials.end()) return found->second;
    Material material;
    if (index < 0) {
        material.name = "default";
    } else {
        material = convert_material(import, index);
    }
    const auto result = static_cast<int>(import.scene.materials.size());
    import.scene.materials.push_back(std::move(material));
    import.materials[index] = result;
    return result;
}

}  // namespace nephroid

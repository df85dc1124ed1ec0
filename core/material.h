// Material description as glTF has it: metallic-roughness with factors and textures. bsdf.h gives it meaning.
#pragma once

#include <string>

#include "core/texture.h"

namespace nephroid {

enum class AlphaMode : uint8_t { opaque, mask, blend };

struct Material {
    std::string name;
    Vec4 base_color{1.0F};      ///< Linear RGB reflectance (F0 of the metal, albedo of the base) and alpha.
    float metallic = 1.0F;      ///< 0 dielectric .. 1 metal.
    float roughness = 1.0F;     ///< Perceptual: alpha = roughness^2.
    Rgb emission{0.0F};         ///< Radiance, W/(m^2 sr): emissiveFactor times emissiveStrength.
    float ior = 1.5F;           ///< KHR_materials_ior: F0 of the dielectric is ((ior-1)/(ior+1))^2.
    float specular = 1.0F;      ///< KHR_materials_specular: scales F0 and F90 of the dielectric coat.
    Rgb specular_color{1.0F};   ///< KHR_materials_specular: tints F0 of the dielectric coat.
    float normal_scale = 1.0F;  ///< Scale of the x and y components of the normal map.
    AlphaMode alpha_mode = AlphaMode::opaque;
    float alpha_cutoff = 0.5F;  ///< With mask: alpha below it is a hole.
    bool double_sided = false;  ///< Emits from both sides; reflection is always two-sided.
    TextureReference base_color_texture;
    TextureReference metallic_roughness_texture;  ///< Green: roughness factor, blue: metallic factor.
    TextureReference normal_texture;
    TextureReference emissive_texture;

    bool emits() const { return emission.r > 0.0F || emission.g > 0.0F || emission.b > 0.0F; }
};

}  // namespace nephroid

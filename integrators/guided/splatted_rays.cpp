#include "integrators/guided/splatted_rays.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "core/rounding.h"

namespace nephroid {

namespace {

/// Photons that are looked at: each costs a shadow ray, and the emission's cells are filled by fewer.
constexpr size_t most_photons = 65536;

bool is_inside(const CameraView<float>& view, const PixelRegion& crop) {
    return view.depth > 0.0F && view.x >= static_cast<float>(crop.x0) && view.x < static_cast<float>(crop.x1) &&
           view.y >= static_cast<float>(crop.y0) && view.y < static_cast<float>(crop.y1);
}

/// Rays of a pixel per area of the surface, times the photon's power: its part in the picture but for the BSDF.
float splat_of(const RenderContext& context, const CameraProjection& projection, const CausticPhoton& photon,
               const PixelRegion& crop) {
    const Receiver& at = photon.at;
    const CameraView<float> view = projection.view(to_triple(at.position));
    const Vec3 to_camera = to_vec3(view.wi);
    const float cosine = glm::dot(at.geometric_normal, to_camera);
    if (!is_inside(view, crop) || !(cosine > 0.0F)) return 0.0F;
    const Vec3 origin = offset_ray_origin(at.position, at.error, at.geometric_normal, to_camera);
    if (context.accelerator.occluded({origin, to_vec3(view.target) - origin, 1.0F})) return 0.0F;
    return photon.power * view.pixel_density * cosine;
}

}  // namespace

std::vector<AimedRay> splatted_rays(const RenderContext& context, std::span<const CausticPhoton> photons,
                                    const PixelRegion& crop) {
    const CameraProjection projection(context.camera_rays);
    const size_t stride = std::max<size_t>((photons.size() + most_photons - 1) / most_photons, 1);
    std::vector<AimedRay> rays((photons.size() + stride - 1) / stride);
    tbb::parallel_for(size_t{0}, rays.size(), [&](size_t i) {
        const CausticPhoton& photon = photons[i * stride];
        const PunctualLight& light = context.scene.lights[photon.light];
        const bool directional = light.kind == LightKind::directional;
        rays[i].light = photon.light;
        rays[i].to = directional ? photon.first_reflection : glm::normalize(photon.first_reflection - light.position);
        rays[i].weight = splat_of(context, projection, photon, crop);
    });
    return rays;
}

}  // namespace nephroid

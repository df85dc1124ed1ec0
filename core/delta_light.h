// Point, spot and directional lights seen from a point, for one point or a vector of points.
#pragma once

#include "core/light.h"
#include "core/simd.h"

namespace nephroid {

template <class F>
struct DeltaLightSample {
    Triple<F> wi;          ///< Unit, towards the light.
    Triple<F> irradiance;  ///< On a plane across wi, without occlusion, W/m^2; zero at the light itself.
};

/// Intensity of a spot light in direction `away` (unit, from the light), relative to its centre (KHR_lights_punctual).
template <class F>
F spot_falloff(const PunctualLight& light, const Triple<F>& away) {
    const float width = light.cos_inner - light.cos_outer;
    const float scale = 1.0F / (width > 1e-3F ? width : 1e-3F);
    const Triple<F> axis{F(light.direction.x), F(light.direction.y), F(light.direction.z)};
    const F ramp = minimum(maximum((dot(away, axis) - F(light.cos_outer)) * F(scale), F(0.0F)), F(1.0F));
    return ramp * ramp;
}

template <class F>
DeltaLightSample<F> sample_delta_light(const PunctualLight& light, const Triple<F>& p) {
    const Triple<F> intensity{F(light.intensity.x), F(light.intensity.y), F(light.intensity.z)};
    if (light.kind == LightKind::directional) {
        return {{F(-light.direction.x), F(-light.direction.y), F(-light.direction.z)}, intensity};
    }
    const Triple<F> to_light = Triple<F>{F(light.position.x), F(light.position.y), F(light.position.z)} - p;
    const F distance2 = dot(to_light, to_light);
    const F inverse2 = select(distance2 > F(0.0F), F(1.0F) / distance2, F(0.0F));
    const Triple<F> wi = to_light * square_root(inverse2);
    if (light.kind == LightKind::spot) return {wi, intensity * (inverse2 * spot_falloff(light, -wi))};
    return {wi, intensity * inverse2};
}

}  // namespace nephroid

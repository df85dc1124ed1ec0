// Light that arrives as a spherical Gaussian and leaves a glossy surface as another: Eqs. 3 to 5 of Li et al. 2022.
//
// At a reflector point, `wi` points to where light comes from and `wo` to where it goes; n is the shading normal on
// their side. Only the importance of a lobe matters to guiding, so that lobes carry luminance.
#pragma once

#include "core/bsdf.h"
#include "guiding/spherical_gaussian.h"

namespace nephroid {

/// Radius over distance that a point or directional light is given as an emitter of radiance, radians. Any value far
/// below the narrowest glossy lobe (alpha 1e-4) gives the same reflected lobe.
inline constexpr double nominal_light_angle = 1e-6;

/// Eq. 4: a light of angular radius `angle` (radius over distance, radians) that makes the irradiance `irradiance`
/// (W/m^2, across the direction to it) at the reflector. The paper's amplitude 2 I has the radiance I of a sphere
/// light: I = irradiance / (pi angle^2).
inline SphericalGaussian<double> light_lobe(const Triple<double>& to_light, double angle, double irradiance) {
    const double size = std::max(angle, nominal_light_angle);
    constexpr double pi_double = 3.14159265358979323846;
    return {to_light, 4.0 / (size * size), 2.0 * irradiance / (pi_double * size * size)};
}

/// v mirrored at n.
template <class F>
Triple<F> reflected(const Triple<F>& v, const Triple<F>& n) {
    return n * (F(2) * dot(v, n)) - v;
}

/// Eq. 3: sharpness of the slice of a GGX lobe of width alpha, as a function of wi, for the given n.wo > 0.
inline double slice_sharpness(double alpha, double cos_o) {
    return 0.5 / (alpha * alpha * cos_o);
}

/// Eq. 5: the radiance that leaves a surface of normal n towards wo and around it, as a lobe over outgoing directions,
/// where `incident` arrives. The amplitude of Eq. 3 is the normal distribution's alone; here it has the Fresnel and
/// the masking factor of the mirror direction and 1 / (4 cos cos) as well. Amplitude zero where n does not see both
/// sides.
inline SphericalGaussian<double> reflected_lobe(const SphericalGaussian<double>& incident,
                                                const BsdfParameters<float>& bsdf, const Triple<double>& n,
                                                const Triple<double>& wo) {
    const double cos_i = dot(n, incident.axis), cos_o = dot(n, wo);
    const Triple<double> axis = reflected(incident.axis, n);
    if (!(cos_i > 0.0) || !(cos_o > 0.0)) return {axis, 1.0, 0.0};
    const double alpha = std::max(double{bsdf.alpha}, double{delta_alpha});
    const double slice = slice_sharpness(alpha, cos_o);
    const Triple<double> slice_axis = reflected(wo, n);
    const Triple<double> sum = incident.axis * incident.sharpness + slice_axis * slice;
    const double joint = std::sqrt(dot(sum, sum));
    const double reflectance = luminance(specular_reflectance(bsdf, static_cast<float>(cos_i)));
    const auto smith = [alpha](double cosine) {
        return std::sqrt(cosine * cosine + alpha * alpha * (1.0 - cosine * cosine));
    };
    // Peak of the normal distribution times G2 / (4 cos_i cos_o) times cos_i, as in core/bsdf.h.
    const double peak = cos_i * 0.5 / (cos_i * smith(cos_o) + cos_o * smith(cos_i)) / (double{pi} * alpha * alpha);
    const double sharpness = slice * incident.sharpness / (slice + incident.sharpness);
    return {axis, sharpness, reflectance * peak * incident.amplitude * unit_integral(joint)};
}

}  // namespace nephroid

// The one reflection model: glTF's metallic-roughness material.
//
//   f = metallic * F_metal(v.h) S + (1 - metallic) * [ F_coat(v.h) S + T(cos_o) T(cos_i) / T_mean * base / pi ]
//   S = D G2 / (4 cos_o cos_i): GGX normal distribution with height-correlated Smith masking and shadowing
//   F_metal = Schlick(base, 1), F_coat = Schlick(f0, f90), T = 1 - max F_coat
//
// Energy split: light enters the base through the coat and leaves it through the coat, hence T twice; dividing by the
// mean of T over the hemisphere accounts for what the coat sends back into the base, so that the base's albedo is
// T(cos_o) * base. glTF's own example (Appendix B) has 1 - F(v.h) instead, which reflects up to 1.5 times the light
// that arrives at grazing angles; this form is reciprocal too and its albedo stays below one. Directions are local (z =
// shading normal) and point away from the surface; values include the cosine of wi; densities are per solid angle.
// alpha = roughness^2; below `delta_alpha` S is a perfect mirror (delta) and only the diffuse part is evaluated.
// Templates over F = float or FloatV.
#pragma once

#include "core/frame.h"
#include "core/simd.h"
#include "core/warp.h"

namespace nephroid {

inline constexpr float delta_alpha = 1e-4F;

/// The material at one surface point, textures resolved.
template <class F>
struct BsdfParameters {
    Triple<F> base;     ///< Albedo of the base, F0 of the metal; in [0, 1].
    Triple<F> coat_f0;  ///< Reflectance of the dielectric coat at normal incidence.
    F coat_f90;         ///< The same at grazing incidence.
    F metallic;         ///< 0 .. 1.
    F alpha;            ///< GGX width, 0 .. 1.
};

/// Whether a surface of this metallic and alpha reflects by its specular lobe alone, and that is narrower than `limit`:
/// with delta_alpha, whether it is a perfect mirror.
template <class F>
MaskOf<F> is_narrow_metal(const F& metallic, const F& alpha, float limit) {
    return (metallic >= F(1.0F)) && (alpha < F(limit));
}

/// (1 - x)^5 of Schlick's approximation.
template <class F>
F schlick_weight(const F& cosine) {
    const F m = maximum(F(1.0F) - cosine, F(0.0F));
    const F m2 = m * m;
    return m2 * m2 * m;
}

/// GGX density of normals, per solid angle, for a unit half vector. |n x h|^2 = h.x^2 + h.y^2 keeps the digits that
/// (n.h)^2 (alpha^2 - 1) + 1 loses: at alpha 1e-4 in float the error is 1e-3 instead of everything.
template <class F>
F ggx_density(const Triple<F>& h, const F& alpha) {
    const F a2 = alpha * alpha;
    const F t = h.z * h.z * a2 + h.x * h.x + h.y * h.y;
    return a2 * F(inv_pi) / (t * t);
}

/// sqrt(cos^2 + alpha^2 sin^2): the Smith term of one direction, cos * (1 + 2 Lambda).
template <class F>
F smith_term(const Triple<F>& w, const F& alpha) {
    const F slope = alpha * alpha * (w.x * w.x + w.y * w.y);
    return square_root(w.z * w.z + slope);
}

/// The coat's reflectance at a cosine, by channel.
template <class F>
Triple<F> coat_reflectance(const BsdfParameters<F>& p, const F& weight) {
    return {p.coat_f0.x + (p.coat_f90 - p.coat_f0.x) * weight, p.coat_f0.y + (p.coat_f90 - p.coat_f0.y) * weight,
            p.coat_f0.z + (p.coat_f90 - p.coat_f0.z) * weight};
}

/// Fresnel factor of the specular part at v.h = cosine: metallic * F_metal + (1 - metallic) * F_coat.
template <class F>
Triple<F> specular_reflectance(const BsdfParameters<F>& p, const F& cosine) {
    const F weight = schlick_weight(cosine);
    const Triple<F> metal{p.base.x + (F(1.0F) - p.base.x) * weight, p.base.y + (F(1.0F) - p.base.y) * weight,
                          p.base.z + (F(1.0F) - p.base.z) * weight};
    return metal * p.metallic + coat_reflectance(p, weight) * (F(1.0F) - p.metallic);
}

/// T: what the coat lets through at a cosine, the same for all channels so that it does not tint the base.
template <class F>
F coat_transmittance(const BsdfParameters<F>& p, const F& cosine) {
    return F(1.0F) - max_component(coat_reflectance(p, schlick_weight(cosine)));
}

/// (1 - metallic) T(cos_i) / T_mean. The exact cosine-weighted mean of Schlick's weight is 1/21; with 1/22 the albedo
/// stays below one also where a slightly rough coat reflects 0.1 % more than a smooth one (the weight is convex).
template <class F>
F base_share(const BsdfParameters<F>& p, const F& cos_i) {
    const F mean = F(1.0F) - max_component(coat_reflectance(p, F(1.0F / 22.0F)));
    return (F(1.0F) - p.metallic) * coat_transmittance(p, cos_i) / maximum(mean, F(1e-6F));
}

/// Probability of sampling the specular part: its share of the energy at the view angle, kept away from 0 and 1
/// where both parts exist.
template <class F>
F specular_probability(const BsdfParameters<F>& p, const F& cos_o) {
    const F specular = luminance(specular_reflectance(p, cos_o));
    const F diffuse = (F(1.0F) - p.metallic) * coat_transmittance(p, cos_o) * luminance(p.base);
    const F total = specular + diffuse;
    const F ratio = select(total > F(0.0F), specular / maximum(total, F(1e-30F)), F(0.0F));
    const F bounded = minimum(maximum(ratio, F(0.05F)), F(0.95F));
    return select(diffuse <= F(0.0F), F(1.0F), select(specular <= F(0.0F), F(0.0F), bounded));
}

template <class F>
struct BsdfEvaluation {
    Triple<F> value;  ///< f * cos_i, 1/sr.
    F pdf;            ///< Of sample_bsdf for wi, per solid angle; without the delta part.
};

/// f * cos_i and the density; zero unless both directions are above the surface.
template <class F>
BsdfEvaluation<F> evaluate_bsdf(const BsdfParameters<F>& p, const Triple<F>& wo, const Triple<F>& wi) {
    const auto above = (wo.z > F(0.0F)) && (wi.z > F(0.0F));
    const Triple<F> h = normalized(wo + wi);
    const F cos_h = dot(wo, h);
    const F probability = specular_probability(p, wo.z);
    const Triple<F> specular = specular_reflectance(p, cos_h);
    const F diffuse = coat_transmittance(p, wo.z) * base_share(p, wi.z);

    const F density = ggx_density(h, p.alpha);
    const F term_o = smith_term(wo, p.alpha);
    const F term_i = smith_term(wi, p.alpha);
    // G2 / (4 cos_o cos_i) and G1 / (4 cos_o), written so that nothing is divided by a cosine.
    const F visibility = F(0.5F) / (wi.z * term_o + wo.z * term_i);
    const F visible_normal = F(0.5F) / (wo.z + term_o);

    const auto glossy = above && (p.alpha >= F(delta_alpha));
    const F lobe = select(glossy, density * visibility * wi.z, F(0.0F));
    const F lobe_pdf = select(glossy, density * visible_normal, F(0.0F));
    const F cosine_pdf = select(above, wi.z * F(inv_pi), F(0.0F));
    const F zero(0.0F);
    // Below the horizon h may be undefined (wi = -wo): the select drops what was computed from it.
    return {select<F>(above, specular * lobe + p.base * (diffuse * cosine_pdf), {zero, zero, zero}),
            probability * lobe_pdf + (F(1.0F) - probability) * cosine_pdf};
}

/// Visible normal of GGX (Heitz 2018) by reflecting off a spherical cap (Dupuy and Benyoub 2023). wo.z > 0.
template <class F>
Triple<F> sample_visible_normal(const Triple<F>& wo, const F& alpha, const F& u, const F& v) {
    const Triple<F> stretched = normalized(Triple<F>{wo.x * alpha, wo.y * alpha, wo.z});
    F sine, cosine;
    sincos_turn(u, sine, cosine);
    const F z = (F(1.0F) - v) * (F(1.0F) + stretched.z) - stretched.z;
    const F radius = safe_sqrt(F(1.0F) - z * z);
    const Triple<F> h{radius * cosine + stretched.x, radius * sine + stretched.y, z + stretched.z};
    return normalized(Triple<F>{h.x * alpha, h.y * alpha, maximum(h.z, F(1e-20F))});
}

template <class F>
struct BsdfSample {
    Triple<F> wi;      ///< Local, unit.
    Triple<F> weight;  ///< f * cos_i / pdf; zero: the sample failed (absorbed).
    F pdf;             ///< Per solid angle; meaningless where delta.
    MaskOf<F> delta;   ///< wi came from the mirror of alpha < delta_alpha: weight excludes every density.
};

/// Draws wi with density evaluate_bsdf(...).pdf, or the mirror direction. u_lobe picks the part, (u, v) the direction.
template <class F>
BsdfSample<F> sample_bsdf(const BsdfParameters<F>& p, const Triple<F>& wo, const F& u_lobe, const F& u, const F& v) {
    const F probability = specular_probability(p, wo.z);
    const auto specular = u_lobe < probability;
    const auto delta = specular && (p.alpha < F(delta_alpha));

    const Triple<F> h = sample_visible_normal(wo, maximum(p.alpha, F(delta_alpha)), u, v);
    const F cos_h = dot(wo, h);
    const Triple<F> glossy_wi = h * (F(2.0F) * cos_h) - wo;
    const Triple<F> mirror_wi{-wo.x, -wo.y, wo.z};
    const Triple<F> diffuse_wi = square_to_cosine_hemisphere(u, v);
    const Triple<F> wi = select<F>(delta, mirror_wi, select<F>(specular, glossy_wi, diffuse_wi));

    const BsdfEvaluation<F> evaluation = evaluate_bsdf(p, wo, wi);
    const auto valid = (wo.z > F(0.0F)) && (wi.z > F(0.0F)) && (delta || (evaluation.pdf > F(0.0F)));
    const F inverse_pdf = select(evaluation.pdf > F(0.0F), F(1.0F) / maximum(evaluation.pdf, F(1e-37F)), F(0.0F));
    const Triple<F> mirror_weight = specular_reflectance(p, wo.z) * (F(1.0F) / maximum(probability, F(1e-6F)));
    const Triple<F> weight = select<F>(delta, mirror_weight, evaluation.value * inverse_pdf);
    const F zero(0.0F);
    return {wi, select<F>(valid, weight, {zero, zero, zero}), evaluation.pdf, delta};
}

}  // namespace nephroid

// The product of a slope lobe with the narrow specular part of the BSDF at the shading point: where light arrives in a
// narrow lobe and leaves in one, neither of them samples what both let through (lobes.md, Sec. 6).
//
// In the lobe's own coordinates m, its slopes in units of its width, the direction is w = axis + m1 u1 + m2 u2, and the
// BSDF's slope is c(m) = ((H.s, H.t) / (H.n)) / alpha with H = wo + w / |w|. Both profiles are GGX's, so that the
// product is proportional to ((1 + |m|^2) (1 + |c|^2))^-2. Iteratively reweighted least squares,
//
//   m -= S^-1 (t_m m + t_c A^T c),  S = t_m I + t_c A^T A,  A = dc/dm,  t_m = 1 / (1 + |m|^2), t_c = 1 / (1 + |c|^2)
//
// leads to a maximum of it, with S the quadratic form of the lobe there: rows of S's Cholesky factor. Whatever the
// iteration ends with, the density is exact. Templates over F = float or FloatV.
#pragma once

#include "core/bsdf.h"
#include "guiding/slope_lobe.h"

namespace nephroid {

/// What a shading point scatters to wo, in luminance. World space.
template <class F>
struct GlossyView {
    Triple<F> wo;               ///< Unit.
    Triple<F> normal, tangent;  ///< Of the shading frame.
    F alpha;                    ///< Not below delta_alpha; zero where there is no narrow specular part.
    F f0, f90;                  ///< Schlick's reflectance of the specular part.
    F diffuse;                  ///< The diffuse part's value, 1/sr.
};

/// `wo` unit.
inline GlossyView<float> make_glossy_view(const BsdfParameters<float>& bsdf, const Triple<float>& wo,
                                          const Frame<float>& frame) {
    const float rest = 1.0F - bsdf.metallic;
    const float transmittance = coat_transmittance(bsdf, std::max(dot(wo, frame.n), 0.0F));
    return {wo,
            frame.n,
            frame.s,
            bsdf.alpha,
            bsdf.metallic * luminance(bsdf.base) + rest * luminance(bsdf.coat_f0),
            bsdf.metallic + rest * bsdf.coat_f90,
            rest * transmittance * luminance(bsdf.base) * inv_pi};
}

/// At v.h = cosine.
template <class F>
F specular_reflectance(const GlossyView<F>& view, const F& cosine) {
    return view.f0 + (view.f90 - view.f0) * schlick_weight(cosine);
}

/// The specular part's value in direction w (unit), without the cosine, 1/sr; zero below the horizon.
template <class F>
F specular_value(const GlossyView<F>& view, const Triple<F>& w) {
    const Triple<F> bitangent = cross(view.normal, view.tangent);
    const Triple<F> wo{dot(view.wo, view.tangent), dot(view.wo, bitangent), dot(view.wo, view.normal)};
    const Triple<F> wi{dot(w, view.tangent), dot(w, bitangent), dot(w, view.normal)};
    const auto above = (wo.z > F(0.0F)) && (wi.z > F(0.0F));
    const Triple<F> h = normalized(wo + wi);
    const F visibility = F(0.5F) / (wi.z * smith_term(wo, view.alpha) + wo.z * smith_term(wi, view.alpha));
    const F value = specular_reflectance(view, dot(wo, h)) * ggx_density(h, view.alpha) * visibility;
    return select(above, value, F(0.0F));
}

/// Density of a lobe, per solid angle.
template <class F>
F lobe_density(const SlopeLobe<F>& lobe, const Triple<F>& w) {
    return relative_density(lobe, w) * lobe.determinant() * F(inv_pi);
}

/// A point in a lobe's coordinates and the product's form there.
template <class F>
struct ProductCentre {
    F m1, m2;
    F s11, s12, s22;      ///< S.
    Triple<F> direction;  ///< Unit.
};

/// What the iteration needs of a lobe.
template <class F>
struct LobePlane {
    Triple<F> axis, u1, u2;  ///< w = axis + m1 u1 + m2 u2.
};

template <class F>
LobePlane<F> plane_of(const SlopeLobe<F>& lobe) {
    const F inverse = F(1.0F) / dot(lobe.axis, cross(lobe.row1, lobe.row2));
    return {cross(lobe.row1, lobe.row2) * inverse, cross(lobe.row2, lobe.axis) * inverse,
            cross(lobe.axis, lobe.row1) * inverse};
}

/// A step of the iteration from (m1, m2), where S is.
template <class F>
ProductCentre<F> product_step(const LobePlane<F>& plane, const GlossyView<F>& view, F& m1, F& m2) {
    const F one(1.0F);
    const Triple<F> along = plane.axis + plane.u1 * m1 + plane.u2 * m2;
    const F inverse_length = reciprocal_square_root(dot(along, along));
    const Triple<F> w = along * inverse_length;
    const Triple<F> sum = view.wo + w;
    const F inverse_normal = one / maximum(dot(sum, view.normal), F(1e-4F));
    const F inverse_alpha = one / view.alpha;
    const Triple<F> bitangent = cross(view.normal, view.tangent);
    const F slope1 = dot(sum, view.tangent) * inverse_normal, slope2 = dot(sum, bitangent) * inverse_normal;
    const auto column = [&](const Triple<F>& u, F& a1, F& a2) {
        const Triple<F> change = (u - w * dot(w, u)) * inverse_length;
        const F tilt = dot(change, view.normal);
        a1 = (dot(change, view.tangent) - slope1 * tilt) * inverse_normal * inverse_alpha;
        a2 = (dot(change, bitangent) - slope2 * tilt) * inverse_normal * inverse_alpha;
    };
    F a11, a21, a12, a22;
    column(plane.u1, a11, a21);
    column(plane.u2, a12, a22);
    const F c1 = slope1 * inverse_alpha, c2 = slope2 * inverse_alpha;
    const F t_m = one / (one + m1 * m1 + m2 * m2), t_c = one / (one + c1 * c1 + c2 * c2);
    ProductCentre<F> at{m1, m2, {}, {}, {}, w};
    at.s11 = t_m + t_c * (a11 * a11 + a21 * a21);
    at.s12 = t_c * (a11 * a12 + a21 * a22);
    at.s22 = t_m + t_c * (a12 * a12 + a22 * a22);
    const F g1 = t_m * m1 + t_c * (a11 * c1 + a21 * c2), g2 = t_m * m2 + t_c * (a12 * c1 + a22 * c2);
    // det S is at least t_m^2, but rounding may take it below where A has a large and a small singular value.
    const F inverse = one / maximum(at.s11 * at.s22 - at.s12 * at.s12, t_m * t_m);
    m1 = m1 - (at.s22 * g1 - at.s12 * g2) * inverse;
    m2 = m2 - (at.s11 * g2 - at.s12 * g1) * inverse;
    return at;
}

inline constexpr int product_steps = 4;

template <class F>
ProductCentre<F> product_centre(const LobePlane<F>& plane, const GlossyView<F>& view, F m1, F m2) {
    for (int i = 0; i < product_steps; ++i) product_step(plane, view, m1, m2);
    return product_step(plane, view, m1, m2);
}

/// The lobe of S about its centre, on the plane of `lobe`.
template <class F>
SlopeLobe<F> product_shape(const SlopeLobe<F>& lobe, const ProductCentre<F>& at) {
    const F l11 = square_root(at.s11);
    const F l21 = at.s12 / l11;
    const F l22 = square_root(maximum(at.s22 - l21 * l21, at.s22 * F(1e-6F)));
    const Triple<F> k1 = lobe.row1 - lobe.axis * at.m1, k2 = lobe.row2 - lobe.axis * at.m2;
    return with_orthogonal_rows<F>({lobe.axis, k1 * l11 + k2 * l21, k2 * l22});
}

/// How a lobe of weight one is best sampled together with the BSDF: the weights of the lobe itself, of the product's
/// lobe and of BSDF sampling, in the specular part's share of what the lobe brings.
template <class F>
struct LobeProduct {
    SlopeLobe<F> lobe;
    F product_weight;
    F own_weight;
    F bsdf_weight;
};

/// Least share of what the BSDF's value times the lobe's density would give it, for a lobe that others overlap.
inline constexpr float least_overlapped_share = 0.1F;

/// Integrals are not told at more grazing angles than that.
inline constexpr float least_cosine = 0.02F;

/// `lobe` needs a volume, and the view a specular part.
template <class F>
LobeProduct<F> make_lobe_product(const SlopeLobe<F>& lobe, const GlossyView<F>& view) {
    const F zero(0.0F), least(least_overlapped_share);
    const F cosine = dot(view.wo, view.normal);
    const Triple<F> mirror = view.normal * (F(2.0F) * cosine) - view.wo;
    const LobePlane<F> plane = plane_of(lobe);
    // From the lobe's centre or the BSDF's, whichever brings more: the product of tails this long has a maximum near
    // each if they are far apart.
    const F own_density = lobe_density(lobe, plane.axis), own_value = specular_value(view, plane.axis);
    const F mirror_density = lobe_density(lobe, mirror), mirror_value = specular_value(view, mirror);
    const F depth = dot(lobe.axis, mirror);
    const auto from_mirror = (depth > F(0.01F)) && (mirror_density * mirror_value > own_density * own_value);
    const F scale = select(from_mirror, F(1.0F) / depth, zero);
    const ProductCentre<F> centre =
        product_centre(plane, view, dot(lobe.row1, mirror) * scale, dot(lobe.row2, mirror) * scale);
    LobeProduct<F> result;
    result.lobe = product_shape(lobe, centre);
    const F centre_density = lobe_density(result.lobe, centre.direction);
    const F centre_target = lobe_density(lobe, centre.direction) * specular_value(view, centre.direction);
    const auto usable =
        is_usable(result.lobe) && is_finite(centre_density) && (centre_density > zero) && is_finite(centre_target);
    result.product_weight = select(usable, centre_target / centre_density, zero);
    const auto covered = [&](const Triple<F>& w) {
        return select(usable, result.product_weight * lobe_density(result.lobe, w), zero);
    };
    // What is left for the lobe at its own centre, and for the BSDF at its own.
    result.own_weight = maximum(own_value - covered(plane.axis) / own_density, least * own_value);
    const F mirror_left = mirror_density * (mirror_value - result.own_weight) - covered(mirror);
    // The BSDF's sampling has the shape of its value, whose integral is about F / cos.
    const F integral = specular_reflectance(view, cosine) / maximum(cosine, F(least_cosine));
    result.bsdf_weight =
        select(mirror_value > zero, maximum(mirror_left / mirror_value, least * mirror_density) * integral, zero);
    return result;
}

}  // namespace nephroid

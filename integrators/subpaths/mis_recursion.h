// Weights of bidirectional strategies by the power heuristic (exponent 2), without walking along the path.
//
// A path of k edges can be made in up to k + 1 ways: s vertices from the light, t from the camera. Strategies that are
// neighbours differ in who made one vertex, so that the sum over all others of (p_i / p)^2 is a nested product of
// ratios that each sub-path can carry along (van Antwerpen 2011; the notation dVCM, dVC is Georgiev's, "Implementing
// Vertex Connection and Merging", 2012). For a vertex x of a sub-path, made with density p per area from its
// predecessor y:
//
//   connect = (1 / p)^2, times the light's or camera's own ratio where y is the sub-path's first vertex
//   chain   = (g / p)^2 (connect_y + reverse_y^2 chain_y), with g = cos_y / distance^2
//
// such that (reverse density of x, per area)^2 (connect + reverse density of y, per solid angle^2 chain) is the sum
// over all strategies that shift vertices from this sub-path to the other one. Both are zero where a strategy cannot
// be: at delta events, lights of no size and the camera. Cosines are of geometric normals: they belong to area
// densities. Survival in Russian roulette is no part of any density here: the weights of a path's strategies sum to one
// with any densities that all of them use alike.
#pragma once

#include "core/simd.h"

namespace nephroid {

template <class F>
F squared(const F& x) {
    return x * x;
}

/// What a sub-path carries to its vertices.
template <class F>
struct MisSums {
    F connect, chain;
};

/// Cosines and densities below this are as good as this: no division by zero, no infinity times zero.
inline constexpr float mis_floor = 1e-10F;

/// At the camera sub-path's first surface vertex; `density`: of one pixel's camera rays there, per area. Every camera
/// sample comes with as many light paths as the picture has pixels that trace, all of which may splat its pixel; where
/// it is several camera paths, their number is a factor of the density.
template <class F>
MisSums<F> mis_camera_start(const F& density, const F& light_paths) {
    return {squared(light_paths / maximum(density, F(mis_floor))), F(0.0F)};
}

/// At the light sub-path's first surface vertex. `direct_pdf`: of next event estimation from there, `ray_density`: of
/// emitted rays (LightEmission), `cosine`: there.
template <class F>
MisSums<F> mis_light_start(const F& direct_pdf, const F& ray_density, const F& cosine, const MaskOf<F>& delta_light) {
    const F inverse = F(1.0F) / maximum(ray_density * cosine, F(1e-30F));
    return {squared(direct_pdf * inverse), select(delta_light, F(0.0F), squared(inverse))};
}

/// Past a scattering: `cosine` of the direction that was chosen, densities per solid angle of it and of its reverse.
template <class F>
MisSums<F> mis_scatter(const MisSums<F>& sums, const F& cosine, const F& pdf, const F& reverse_pdf,
                       const MaskOf<F>& delta) {
    // Of a delta event both densities are the same and cancel.
    const F inverse = F(1.0F) / maximum(pdf, F(mis_floor));
    const F chain = select(delta, sums.chain, squared(inverse) * (sums.connect + squared(reverse_pdf) * sums.chain));
    return {select(delta, F(0.0F), squared(inverse)), squared(cosine) * chain};
}

/// At the next vertex: from solid angle to area.
template <class F>
MisSums<F> mis_arrive(const MisSums<F>& sums, const F& distance, const F& cosine) {
    const F inverse = F(1.0F) / squared(maximum(cosine, F(mis_floor)));
    return {sums.connect * squared(squared(distance)) * inverse, sums.chain * inverse};
}

/// Sum over the strategies that give one sub-path's last vertices to the other. `area_pdf`: density of the last vertex
/// from the other side, per area; `reverse_pdf`: from there of its predecessor, per solid angle.
template <class F>
F mis_others(const MisSums<F>& sums, const F& area_pdf, const F& reverse_pdf) {
    return squared(area_pdf) * (sums.connect + squared(reverse_pdf) * sums.chain);
}

/// Of a camera path that runs into a light; sums past the last scattering, before mis_arrive: the light's cosine and
/// distance cancel.
template <class F>
F mis_weight_hit(const MisSums<F>& sums, const F& direct_pdf, const F& ray_density) {
    return F(1.0F) / (F(1.0F) + squared(direct_pdf) * sums.connect + squared(ray_density) * sums.chain);
}

/// Of next event estimation from a camera vertex: `bsdf_pdf` towards the light (0 for lights of no size), `cosine` and
/// `reverse_pdf` there.
template <class F>
F mis_weight_light(const MisSums<F>& sums, const F& direct_pdf, const F& bsdf_pdf, const F& ray_density,
                   const F& cosine, const F& reverse_pdf) {
    const F inverse = F(1.0F) / maximum(direct_pdf, F(1e-30F));
    return F(1.0F) /
           (F(1.0F) + squared(bsdf_pdf * inverse) + mis_others(sums, ray_density * cosine * inverse, reverse_pdf));
}

/// Of a light vertex that the camera sees; `density` as for mis_camera_start.
template <class F>
F mis_weight_camera(const MisSums<F>& sums, const F& density, float light_paths, const F& reverse_pdf) {
    return F(1.0F) / (F(1.0F) + mis_others(sums, density * F(1.0F / light_paths), reverse_pdf));
}

}  // namespace nephroid

// Lobes for light of two and more reflections, from the photons that land around a cached point.
//
// GGX's profile of slopes is a bivariate Student t distribution with two degrees of freedom, whose fit by expectation
// maximisation has a closed form (lobes.md, Sec. 6): with gnomonic coordinates q about the lobe's axis,
// u = 4 / (2 + q^T S^-1 q), S = sum of u q q^T over their number, and the lobe's K has K^T K = S^-1 / 2.
#pragma once

#include <span>
#include <vector>

#include "guiding/slope_warp.h"

namespace nephroid {

/// Where light comes from that arrives near a cached point.
struct PhotonOrigin {
    Vec3 y{0.0F};        ///< The last reflection, world space, metres.
    float power = 0.0F;  ///< W.
};

/// A few lobes for all of them, seen from `x`, none where there are too few. Weights add up to `irradiance`. Lobes are
/// no narrower than what the origins' number and `spacing` (metres, between the places where photons land) can tell.
std::vector<CachedSlopeLobe<float>> fit_photon_lobes(const Vec3& x, std::span<const PhotonOrigin> origins,
                                                     float irradiance, float spacing);

}  // namespace nephroid

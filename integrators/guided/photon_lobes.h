// Lobes for light of two and more reflections, from the photons that land around a cached point.
//
// Where a photon was reflected last depends on where it lands: behind a flat mirror the image of a distant lamp goes
// along with the receiver, a caustic's focus runs against it. So each lobe is a line of regression: on a plane across
// the light, offset + slope * shift of the receiver, with what is left as the lobe's shape. The slope is the derivative
// by which the lobe moves to a shading point.
//
// GGX's profile of slopes is a bivariate Student t distribution with two degrees of freedom, whose fit by expectation
// maximisation has a closed form (lobes.md, Sec. 6): with residuals r, u = 4 / (2 + r^T S^-1 r), S = sum of u r r^T
// over their number, and the lobe's K has K^T K = S^-1 / 2.
#pragma once

#include <span>
#include <vector>

#include "guiding/slope_warp.h"

namespace nephroid {

/// A photon that lands near a cached point. World space.
struct LandedPhoton {
    Vec3 x{0.0F};           ///< Where it lands.
    Vec3 wi{0.0F};          ///< Unit, to where it was reflected last.
    float distance = 0.0F;  ///< To there, metres.
    float power = 0.0F;     ///< W.
};

/// A few lobes for all photons, as the receiver at `x` with that unit normal sees them; none where there are too few.
/// Weights add up to `irradiance`. `spacing`: metres, across the area where they landed.
std::vector<CachedSlopeLobe<float>> fit_photon_lobes(const Vec3& x, const Vec3& normal,
                                                     std::span<const LandedPhoton> photons, float irradiance,
                                                     float spacing);

}  // namespace nephroid

// The lobe of a representative specular path: the spherical Gaussians of its light and its reflectors, one after the
// other (Sec. 3.4, Li et al. 2022), and the light's image that tells how it moves with the receiver (Sec. 3.5).
#pragma once

#include <span>

#include "core/bsdf.h"
#include "guiding/reflected_lobe.h"
#include "guiding/sg_lobe.h"

namespace nephroid {

/// A reflector vertex of a path, on the side where the light runs.
struct GlossyVertex {
    Vec3d position{0.0};          ///< World space, metres.
    PrincipalCurvatures surface;  ///< With the shading normal on the light's side.
    BsdfParameters<float> bsdf{};
};

/// The light at the end of a path, as seen from the last vertex.
struct PathEmitter {
    PathEnd end;
    double angle = 0.0;       ///< Radius over distance, radians; zero for point and directional lights.
    double irradiance = 0.0;  ///< Luminance of the irradiance across its direction, without occlusion, W/m^2.
};

/// A lobe for a receiver at x; `vertices` from the receiver's side on, at least one. The weight is what the lobe brings
/// to the receiver: its integral, luminance in W/m^2 before the receiver's cosine; zero where a normal does not see
/// both sides.
SgLobe make_sg_lobe(const Vec3d& x, std::span<const GlossyVertex> vertices, const PathEmitter& light);

}  // namespace nephroid

// How much one sample of the light that reaches a point by two reflections deviates, with the guide at the point and at
// the reflector that was really hit.
#pragma once

#include "guiding/directional_guide.h"
#include "integrators/integrator.h"
#include "pathcut/path_light.h"
#include "pathcut/receiver_sampler.h"

namespace nephroid::testing {

/// Relative standard deviations of one sample of the irradiance.
struct TwoReflections {
    double irradiance = 0.0;       ///< W/m^2 of luminance.
    double guided = 0.0;           ///< As rendered.
    double guided_at_point = 0.0;  ///< Its part if the second direction brought no noise.
    double path = 0.0;             ///< BSDF sampling alone.
};

/// At a point that scatters evenly. All are measured with the same proposal, half guide and half BSDF at either vertex:
/// measured with its own samples, a guide that misses part of the light looks good. `samples` first directions, eight
/// second ones for each. Deterministic.
TwoReflections measure_two_reflections(const RenderContext& context, const DirectionalGuide& guide,
                                       const Receiver& receiver, const PathLight& light, uint32_t samples);

}  // namespace nephroid::testing

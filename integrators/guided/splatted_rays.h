// Which rays of the lights end where the camera sees them: what the emission of light paths learns from photons.
#pragma once

#include <span>
#include <vector>

#include "core/aimed_emission.h"
#include "integrators/guided/caustic_photons.h"

namespace nephroid {

/// The rays that photons began with, worth what would be splatted inside the crop from where they landed. Parallel and
/// deterministic.
std::vector<AimedRay> splatted_rays(const RenderContext& context, std::span<const CausticPhoton> photons,
                                    const PixelRegion& crop);

}  // namespace nephroid

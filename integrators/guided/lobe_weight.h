// How much light a lobe brings to its receiver: the integrand over the lobe's density, with visibility (lobes.md,
// Sec. 2).
#pragma once

#include "guiding/slope_warp.h"
#include "integrators/guided/guided_paths.h"

namespace nephroid {

/// Radiance that the light sends to the receiver by one reflection at what is seen along the direction (unit), with
/// visibility; luminance, W/(m^2 sr).
float reflected_radiance(const RenderContext& context, const Receiver& receiver, const PathLight& light,
                         const Vec3& direction);

class LobeWeights {
  public:
    /// Keeps references.
    LobeWeights(const RenderContext& context, const GuidedPaths& found) : context_(context), found_(found) {}

    /// Irradiance at the receiver, luminance in W/m^2. `density` is the lobe's at the path itself, per area of all its
    /// reflectors. One reflection: the mean over five points of the lobe, with shadow rays, each no more than what the
    /// centre would bring unoccluded, and never less than a twentieth of that: five dark points do not make a dark
    /// lobe.
    float of(const Receiver& receiver, const RepresentativePath& path, double density,
             const CachedSlopeLobe<float>& lobe) const;

  private:
    double unoccluded(const Receiver& receiver, const RepresentativePath& path, double density) const;

    const RenderContext& context_;
    const GuidedPaths& found_;
};

}  // namespace nephroid

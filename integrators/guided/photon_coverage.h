// How well a cache of lobes covers the light that photons have found, and where it needs more points.
#pragma once

#include <span>
#include <vector>

#include "guiding/slope_mixture.h"
#include "integrators/guided/caustic_photons.h"

namespace nephroid {

/// What guiding does at a photon.
struct PhotonCoverage {
    uint32_t nearest = 0;    ///< The cached point.
    float guide_pdf = 0.0F;  ///< Of the mixture for the direction that the photon comes from, 1/sr.
    float bsdf_pdf = 0.0F;   ///< Of a diffuse surface, 1/sr; zero: no cached point serves the photon.

    /// One sample of the irradiance that goes the photon's way, W/m^2, where the guide has the probability `fraction`.
    float sample_value(const CausticPhoton& photon, float fraction) const {
        const float cosine = bsdf_pdf * pi;
        return photon.radiance * cosine / (fraction * guide_pdf + (1.0F - fraction) * bsdf_pdf);
    }
};

/// For every photon. Parallel and deterministic.
std::vector<PhotonCoverage> measure_coverage(const SlopeCache& cache, const SlopeMixtureOptions& options,
                                             std::span<const CausticPhoton> photons);

/// About the area that a cached point stands for, m^2.
float cached_area(const CachedPoint& point);

/// By photons that land near each cached point, W/m^2.
std::vector<float> irradiance_at_points(const SlopeCache& cache, std::span<const CausticPhoton> photons,
                                        std::span<const PhotonCoverage> coverage);

/// What photons of two and more reflections add to the second moment of a sample, as a multiple of the squared mean of
/// all photons' light.
double second_moment_of_long_paths(const SlopeCache& cache, std::span<const CausticPhoton> photons,
                                   std::span<const PhotonCoverage> coverage);

/// Where a cache needs more points.
struct PoorlyCovered {
    std::vector<Receiver> points;
    /// What bright dots add to the second moment of a sample, as a multiple of the squared mean, over the photons.
    double excess = 0.0;
};

/// Photons of one reflection that would be bright dots, and whose light is worth a cached point of their own: those
/// that add most to the variance, `most` of them at the most.
PoorlyCovered poorly_covered(const SlopeCache& cache, const std::vector<CausticPhoton>& photons,
                             const std::vector<PhotonCoverage>& coverage, size_t most);

}  // namespace nephroid

// Who watches paths being traced, to learn from them where light comes from.
#pragma once

#include <algorithm>

#include "integrators/path/wave.h"

namespace nephroid {

/// The paths of a wave that go on after scattering.
struct ScatteredPaths {
    const PathWave& paths;              ///< Rays that have been traced; throughput and density after scattering.
    const PathArray<uint32_t>& vertex;  ///< Of each ray: where in `vertices` it starts.
    const VertexWave& vertices;         ///< As they were before scattering.
    const GuideBatch* directions;       ///< Fractions and densities of the guide, by vertex; null: the BSDF alone.
};

/// The BSDF's density of a direction, from the density `pdf` of guide and BSDF together (the inverse of mixed_pdf).
/// `fraction`: of the guide, below 1.
inline float bsdf_pdf_within(float pdf, float fraction, float guide_pdf) {
    return std::max((pdf - fraction * guide_pdf) / (1.0F - fraction), 0.0F);
}

/// Virtual per wave, not per ray.
class PathObserver {
  public:
    virtual ~PathObserver() = default;
    /// After every scattering, once rays have been traced; `samples` holds what the paths have gathered up to their
    /// vertices, next event estimation there included.
    virtual void scattered(const ScatteredPaths& scattered, const SampleBuffer& samples) = 0;
    /// After the last scattering of a block: what all paths have gathered.
    virtual void finished(const SampleBuffer& samples) = 0;
};

}  // namespace nephroid

// Who watches paths being traced, to learn from them where light comes from.
#pragma once

#include "integrators/path/wave.h"

namespace nephroid {

/// The paths of a wave that go on after scattering.
struct ScatteredPaths {
    const PathWave& paths;              ///< Rays that leave; throughput and density after scattering.
    const PathArray<uint32_t>& vertex;  ///< Of each ray: where in `vertices` it starts.
    const VertexWave& vertices;         ///< As they were before scattering.
    const GuideBatch* directions;       ///< Fractions and densities of the guide, by vertex; null: the BSDF alone.
};

/// Virtual per wave, not per ray.
class PathObserver {
  public:
    virtual ~PathObserver() = default;
    /// After every scattering; `samples` holds what the paths have gathered up to their vertices, next event estimation
    /// there included.
    virtual void scattered(const ScatteredPaths& scattered, const SampleBuffer& samples) = 0;
    /// After the last scattering of a block: what all paths have gathered.
    virtual void finished(const SampleBuffer& samples) = 0;
};

}  // namespace nephroid

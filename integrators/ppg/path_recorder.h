// Collects the vertices of a block's paths and, once the paths are done, tells the SD-tree what arrived at them.
#pragma once

#include <vector>

#include "guiding/sd_tree.h"
#include "integrators/path/path_observer.h"
#include "integrators/ppg/ppg_learner.h"

namespace nephroid {

/// What arrives is the light left to guide to: without what next event estimation at the vertex has found, and emission
/// that the direction runs into with its share by multiple importance sampling. Directions without a density (mirrors)
/// and paths that end at the vertex are no records.
class PathRecorder final : public PathObserver {
  public:
    /// Keeps a reference to the learner's tree.
    explicit PathRecorder(PpgLearner& learner) : tree_(learner.tree()) {}
    void scattered(const ScatteredPaths& scattered, const SampleBuffer& samples) override;
    void finished(const SampleBuffer& samples) override;

  private:
    struct Vertex {
        Vec3 position, direction;
        Rgb throughput;         ///< After scattering.
        Rgb throughput_before;  ///< When the path arrived.
        Rgb reached;            ///< The slot's radiance, next event estimation at the vertex included.
        float pdf;              ///< Of the direction; 0: it has none.
        float bsdf_share;       ///< LightRecord::bsdf_share.
        uint32_t slot;
    };

    void record(const Vertex& vertex, const Rgb& gathered);

    SdTree& tree_;
    std::vector<Vertex> vertices_;  // Keep their capacity from block to block.
    std::vector<QuadShare> quadrants_;
};

}  // namespace nephroid

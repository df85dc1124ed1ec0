// Camera paths of the few pixels with highlights: their film positions come from a FilmGuide, and one sample is the
// mean over several of them.
#pragma once

#include <vector>

#include "guiding/film_guide.h"
#include "integrators/integrator.h"

namespace nephroid {

/// Where a camera path starts.
struct CameraStart {
    Vec3 origin, direction;
    float weight = 0.0F;  ///< Its throughput. Zero: no position was found, black counts, and there is no ray.
    uint32_t seed, index;
};

class HighlightSamples {
  public:
    /// A sample of a pixel with highlights.
    struct Sample {
        const FilmGuide::Pixel* pixel;
        uint32_t slot, seed, index;
    };

    /// Keeps references. `film_dimension`: the pair of random numbers that film positions come from.
    HighlightSamples(const RenderContext& context, const FilmGuide& guide, uint32_t film_dimension)
        : context_(context), guide_(guide), film_dimension_(film_dimension) {}

    /// All samples of the block that lie in highlights; `seeds` and `indices` per slot.
    const std::vector<Sample>& find(const SampleBlock& block, const AlignedArray<uint32_t>& seeds,
                                    const AlignedArray<uint32_t>& indices);
    const std::vector<Sample>& found() const { return samples_; }
    /// Of a sample; `position` below pixel->positions.
    CameraStart start(const Sample& sample, uint32_t position) const;

  private:
    const RenderContext& context_;
    const FilmGuide& guide_;
    uint32_t film_dimension_;
    std::vector<Sample> samples_;
};

}  // namespace nephroid

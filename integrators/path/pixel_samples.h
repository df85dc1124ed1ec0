// The samples of a block that are more than one camera path through an evenly chosen film position: in pixels with
// highlights, positions come from a FilmGuide; and one sample may be the mean over several paths, as a FilmGuide or
// AdaptiveSampling wants it.
#pragma once

#include <array>
#include <vector>

#include "guiding/film_guide.h"
#include "integrators/integrator.h"
#include "integrators/path/adaptive_sampling.h"

namespace nephroid {

/// Where a camera path starts.
struct CameraStart {
    Vec3 origin, direction;
    float weight = 0.0F;  ///< Its throughput. Zero: no position was found, black counts, and there is no ray.
    uint32_t seed, index;
};

class PixelSamples {
  public:
    struct Sample {
        const FilmGuide::Pixel* highlight;  ///< Null: there is none.
        int x, y;                           ///< Pixel of the image.
        uint32_t slot, seed;
        uint32_t paths;       ///< Whose mean it is; at least 1.
        uint32_t first_path;  ///< Number of the first one, of all the pixel's paths.
    };

    /// Keeps references. `film_dimension`: the pair of random numbers that film positions come from. Guide and
    /// adaptive sampling may be null: there are no highlights, and nothing is learned of pixels.
    PixelSamples(const RenderContext& context, const FilmGuide* guide, const AdaptiveSampling* adaptive,
                 uint32_t film_dimension)
        : context_(context), guide_(guide), adaptive_(adaptive), film_dimension_(film_dimension) {}

    /// All such samples of the block, and of pixels that have had others; `seeds` per slot.
    const std::vector<Sample>& find(const SampleBlock& block, const AlignedArray<uint32_t>& seeds);
    const std::vector<Sample>& found() const { return samples_; }
    /// Of a sample; `path` below sample.paths.
    CameraStart start(const Sample& sample, uint32_t path) const;

  private:
    void find_highlights(const SampleBlock& block);

    const RenderContext& context_;
    const FilmGuide* guide_;
    const AdaptiveSampling* adaptive_;
    uint32_t film_dimension_;
    std::array<const FilmGuide::Pixel*, static_cast<size_t>(tile_size) * tile_size> highlights_{};  ///< By pixel.
    std::vector<Sample> samples_;
};

}  // namespace nephroid

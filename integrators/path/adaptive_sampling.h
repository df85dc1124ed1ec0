// How many camera paths make one sample of each pixel: more where one path deviates more, learned while rendering.
//
// A few pixels often have most of a picture's variance: highlights, caustics seen in metal, light of many reflections.
// The mean of n paths has an n-th of one path's variance, so the least sum of variances, for a number of rays in all,
// has n in proportion to the standard deviation of a pixel's paths over the square root of their rays. One path at
// least: every sample stays a whole picture. All samples of a pixel count alike, however many paths make them, and what
// is learned from a sample changes later ones alone: each sample has the pixel's mean as its expectation, and so has
// the picture. (Weighting samples by their paths would not have: what happens to be dark would get fewer paths, and
// less weight.)
//
// Variances count in units of the surroundings' radiance, half-way between squared error and relative squared error:
// highlights above white are worth less than their squared error says.
//
// How many paths are spent in all is learned too. What was known before the last samples tells how many each pixel
// would have had, and those samples tell what that would have made of their variance and rays, light paths and their
// splats included, which stay as many: bright dots that come anywhere are worth no paths, nor is the rest of a picture
// that light paths make.
#pragma once

#include <span>
#include <vector>

#include "core/film.h"
#include "integrators/learner.h"

namespace nephroid {

class AdaptiveSampling final : public Learner {
  public:
    /// For the crop's pixels, one path each.
    explicit AdaptiveSampling(const PixelRegion& crop);

    /// A pixel whose first samples are made of so many paths, at least one, because of what is known to lie there:
    /// nothing about its neighbours. Pixels outside of the crop are ignored.
    void start_with(int x, int y, uint32_t paths);

    /// Of one sample of a pixel of the image; outside of the crop, 1.
    uint32_t paths(int x, int y) const { return crop_.contains(x, y) ? pixels_[crop_.index_of(x, y)].paths : 1; }
    /// Number of the first path of a pixel's sample `index`, counted through all paths of the pixel: they are one
    /// sequence of sample points.
    uint32_t first_path(int x, int y, uint32_t index) const;
    /// What a path found, luminance, with so many rays. One thread at a time for each pixel.
    void record(int x, int y, float radiance, uint32_t rays) {
        if (crop_.contains(x, y)) recent_[crop_.index_of(x, y)].add(radiance, rays);
    }
    /// What a light path of the tile at (tile_x, tile_y) adds to one sample of the pixel (x, y), luminance. One thread
    /// at a time for each tile, here and below.
    void record_splat(int tile_x, int tile_y, int x, int y, float radiance);
    void record_light_rays(int tile_x, int tile_y, uint64_t rays) { light_[tile_of(tile_x, tile_y)].rays += rays; }

    std::optional<uint32_t> next_lesson(uint32_t samples) const override;
    void learn(uint32_t samples) override;
    EarlierSamples earlier_samples() const override { return EarlierSamples::kept; }
    std::vector<uint8_t> state() const override;
    void restore(const std::vector<uint8_t>& state) override;

    /// Camera paths for each sample, the mean over all pixels.
    double mean_paths() const;

  private:
    struct Pixel {
        uint32_t paths = 1;
        uint32_t earlier_paths = 0;  ///< Of the samples before the last lesson.
        uint32_t is_known = 0;       ///< start_with: 1.
    };
    /// Sums over single paths. Double: highlights are made of 1e5 paths that hardly differ.
    struct Recent {
        double sum = 0.0, squares = 0.0;
        uint32_t count = 0, rays = 0;
        void add(float value, uint32_t by_rays) {
            sum += double{value};
            squares += double{value} * double{value};
            ++count;
            rays += by_rays;
        }
        /// Sum of squared differences from the mean.
        double spread() const;
    };
    /// What they tell.
    struct Seen {
        float mean = 0.0F;
        float spread = 0.0F;
        uint32_t count = 0, rays = 0;
        void add(const Recent& recent);
    };
    /// Of a tile's light paths.
    struct LightMoments {
        double squares = 0.0;  ///< Of what their splats add to samples, over the radiance around.
        uint64_t rays = 0;
    };

    size_t tile_of(int tile_x, int tile_y) const {
        return static_cast<size_t>((tile_y - crop_.y0 / tile_size * tile_size) / tile_size * tile_columns_ +
                                   (tile_x - crop_.x0 / tile_size * tile_size) / tile_size);
    }
    void tell_radiance_around();
    std::vector<float> deviations() const;
    void choose_further_share(std::span<const float> deviations, uint32_t samples);

    PixelRegion crop_;
    std::vector<Pixel> pixels_;
    std::vector<Seen> seen_;       ///< Before the last lesson.
    std::vector<Recent> recent_;   ///< Since then.
    std::vector<float> radiance_;  ///< As far as seen: what a pixel's variance is divided by; zero: nothing was seen.
    int tile_columns_;
    std::vector<LightMoments> light_;  ///< Of tiles, since the last lesson.
    uint32_t last_lesson_ = 0;
    double further_share_;  ///< Second and further paths for each sample, the mean over all pixels.
};

}  // namespace nephroid

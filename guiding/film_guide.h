// Film positions where the camera sees a lamp mirrored in glossy metal: highlights smaller than a pixel, which evenly
// spread samples of the pixel hit once in a thousand times.
//
// To the pinhole, a highlight is what a caustic is to a receiver, so it has slope lobes too, whether the lamp is seen
// in one mirror or in several. In the few pixels that they touch, positions come from the lobes with a probability and
// evenly otherwise. With the density of both, the pixel's mean stays what it is.
//
// A lobe may reach beyond its pixel. How much of it lies inside has no closed form; so several positions are drawn, one
// of those inside is used, and their share is its weight (resampling; Talbot et al. 2005): the mean is right for any
// number of them. One that lies inside almost for sure is used as it is, which keeps the samples stratified.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/camera.h"
#include "guiding/slope_lobe.h"

namespace nephroid {

/// A highlight as the camera sees it.
struct FilmLobe {
    SlopeLobe<float> lobe;    ///< At the pinhole.
    float irradiance = 0.0F;  ///< That it brings to the pinhole, luminance in W/m^2.
    float background = 0.0F;  ///< Radiance of what else its pixels may show, W/(m^2 sr), as a scale.
    uint32_t light = 0;       ///< Whose it is, in the order of the search.
    uint32_t reflections = 1;
};

class FilmGuide {
  public:
    /// A pixel of the image with highlights.
    struct Pixel {
        int x = 0, y = 0;
        float fraction = 0.0F;  ///< Probability of the lobes.
        uint32_t first = 0;     ///< Of its lobes.
        uint32_t count = 0;
        uint32_t candidates = 1;  ///< Positions that are drawn for one that is used.
        uint32_t positions = 1;   ///< Positions that make one sample, their mean.
        float radiance = 0.0F;    ///< Of the highlights alone, W/(m^2 sr), as a scale.
    };

    FilmGuide() : projection_(CameraRays{}) {}
    /// For a pinhole camera.
    FilmGuide(const CameraRays& rays, std::span<const FilmLobe> lobes);

    /// All pixels that are guided, in rows. Not the ones where a highlight is as wide as the pixel.
    const std::vector<Pixel>& pixels() const { return pixels_; }
    bool empty() const { return pixels_.empty(); }

    /// Of a pixel, 0 .. count - 1.
    const FilmLobe& lobe(const Pixel& pixel, uint32_t i) const { return lobes_[shares_[pixel.first + i].lobe]; }

    /// Spends about so many positions beyond one on each round of samples, most where one position deviates most: a few
    /// pixels that outshine the rest of the picture by thousands have most of its variance. `deviations` of all pixels,
    /// not negative, in any unit.
    void add_positions(double count, std::span<const float> deviations);

    /// A position inside the pixel.
    struct Position {
        Vec2 film;
        float weight = 0.0F;  ///< What a sample there counts. Zero: none was found, and black counts.
    };
    /// u_choice, u, v, u_pick in [0, 1).
    Position sample_inside(const Pixel& pixel, float u_choice, float u, float v, float u_pick) const;
    /// A film position in pixels, maybe outside of the pixel; u_choice, u, v in [0, 1).
    Vec2 sample(const Pixel& pixel, float u_choice, float u, float v) const;
    /// Density per square pixel inside the pixel; positive.
    float pdf(const Pixel& pixel, const Vec2& film) const;

  private:
    /// A lobe's part in a pixel.
    struct Share {
        uint32_t lobe = 0;
        float weight = 0.0F;  ///< Probability among the pixel's lobes.
    };

    Vec2 film_position(const FilmLobe& lobe, float u_width, float u, float v) const;
    float film_density(const FilmLobe& lobe, const Vec2& film) const;

    CameraRays rays_{};
    CameraProjection projection_;
    std::vector<FilmLobe> lobes_;
    std::vector<Share> shares_;
    std::vector<Pixel> pixels_;
};

}  // namespace nephroid

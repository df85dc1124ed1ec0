// Lat-long environment light: look-up and importance sampling.
//
// Direction d (world, +Y up) maps to u = 1/2 + atan2(d.x, -d.z) / (2 pi), v = acos(d.y) / pi with row 0 at the top:
// the picture's centre column looks along -Z. Radiance is bilinear between texel centres, u wraps, v clamps.
#pragma once

#include <string>
#include <vector>

#include "core/scene.h"
#include "core/vec.h"

namespace nephroid {

/// Reads a lat-long picture (EXR, HDR, ...) as radiance; 8-bit pictures are taken as sRGB. Negative and non-finite
/// texels become black, with a warning. Throws Error(invalid_input).
EnvironmentMap load_environment(const std::string& path, float scale, Warnings& warnings);

class Environment {
  public:
    explicit Environment(const EnvironmentMap& map);

    struct Evaluation {
        Rgb radiance{0.0F};  ///< Arriving from the direction, W/(m^2 sr).
        float pdf = 0.0F;    ///< Density of sample(), per solid angle; positive wherever radiance is.
    };
    Evaluation evaluate(const Vec3& d) const;
    Rgb radiance(const Vec3& d) const { return evaluate(d).radiance; }
    float pdf(const Vec3& d) const { return evaluate(d).pdf; }

    /// Unit direction drawn by importance, with what evaluate says of it (pdf 0: no light at all).
    Vec3 sample(Vec2 u, Evaluation& evaluation) const;
    /// Integral of the luminance over the sphere, W/m^2.
    float total_luminance() const { return total_luminance_; }

  private:
    const Rgb& texel(int x, int y) const { return texels_[static_cast<size_t>(y) * width_ + static_cast<size_t>(x)]; }
    Rgb radiance_at(float u, float v) const;
    float pdf_of_cell(int x, int y, float sin_theta) const;

    size_t width_ = 0;
    size_t height_ = 0;
    std::vector<Rgb> texels_;
    // Piecewise constant over texels: cumulative sums over rows, and inside each row, both normalised to 1.
    std::vector<float> row_cdf_;
    std::vector<float> column_cdf_;
    float total_luminance_ = 0.0F;
};

}  // namespace nephroid

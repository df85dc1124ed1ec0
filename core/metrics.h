// Error of a picture against a reference.
#pragma once

#include <span>

namespace nephroid {

struct ImageError {
    double rmse = 0.0;            ///< Over all pixels and channels of linear RGB.
    double relmse = 0.0;          ///< mean((x - r)^2 / (r^2 + 0.01)).
    double relmse_trimmed = 0.0;  ///< The same without the worst 0.1 % of the pixels.
};

/// Both hold interleaved RGB of the same size.
ImageError compare_images(std::span<const float> image, std::span<const float> reference);

}  // namespace nephroid

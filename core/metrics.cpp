#include "core/metrics.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace nephroid {

ImageError compare_images(std::span<const float> image, std::span<const float> reference) {
    const size_t pixels = image.size() / 3;
    ImageError error;
    if (pixels == 0) return error;
    std::vector<double> relative(pixels);
    double squares = 0.0;
    for (size_t p = 0; p < pixels; ++p) {
        for (size_t c = 0; c < 3; ++c) {
            const double r = reference[p * 3 + c];
            const double difference = image[p * 3 + c] - r;
            squares += difference * difference;
            relative[p] += difference * difference / (r * r + 0.01) / 3.0;
        }
    }
    error.rmse = std::sqrt(squares / static_cast<double>(pixels * 3));
    const auto dropped = static_cast<size_t>(std::ceil(static_cast<double>(pixels) * 0.001));
    std::nth_element(relative.begin(), relative.end() - static_cast<std::ptrdiff_t>(dropped), relative.end());
    double trimmed = 0.0;
    for (size_t p = 0; p + dropped < pixels; ++p) trimmed += relative[p];
    double all = trimmed;
    for (size_t p = pixels - dropped; p < pixels; ++p) all += relative[p];
    error.relmse = all / static_cast<double>(pixels);
    error.relmse_trimmed = pixels > dropped ? trimmed / static_cast<double>(pixels - dropped) : 0.0;
    return error;
}

}  // namespace nephroid

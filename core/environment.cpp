#include "core/environment.h"

#include <algorithm>
#include <cmath>

#include "core/image_io.h"
#include "core/simd.h"

namespace nephroid {

namespace {

float srgb_to_linear(float encoded) {
    return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

struct LatLong {
    float u, v, sin_theta;
};

LatLong to_lat_long(const Vec3& d) {
    const float u = 0.5F + std::atan2(d.x, -d.z) * (0.5F * inv_pi);
    // acos loses digits near the poles; atan2 does not.
    const float sin_theta = std::sqrt(d.x * d.x + d.z * d.z);
    return {u, std::atan2(sin_theta, d.y) * inv_pi, sin_theta};
}

/// Last index i with cdf[i] <= u; cdf has n + 1 entries from 0 to 1.
size_t find_interval(const float* cdf, size_t n, float u) {
    const float* found = std::upper_bound(cdf, cdf + n + 1, u);
    const auto index = static_cast<size_t>(std::max<std::ptrdiff_t>(found - cdf - 1, 0));
    return std::min(index, n - 1);
}

/// Weights -> cumulative sums from 0 to 1 (uniform where all weights vanish). Returns the sum of the weights.
double accumulate_cdf(const std::vector<double>& weights, float* cdf) {
    double sum = 0.0;
    for (const double w : weights) sum += w;
    const auto n = weights.size();
    double running = 0.0;
    cdf[0] = 0.0F;
    for (size_t i = 0; i < n; ++i) {
        running += sum > 0.0 ? weights[i] / sum : 1.0 / static_cast<double>(n);
        cdf[i + 1] = static_cast<float>(std::min(running, 1.0));
    }
    cdf[n] = 1.0F;
    return sum;
}

}  // namespace

EnvironmentMap load_environment(const std::string& path, float scale, Warnings& warnings) {
    const Image image = read_image(path);
    EnvironmentMap map;
    map.scale = scale;
    map.image.name = path;
    map.image.width = image.width;
    map.image.height = image.height;
    map.image.channels = 3;
    map.image.storage = Image::Storage::float32;
    const size_t pixels = static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
    const auto channels = static_cast<size_t>(image.channels);
    map.image.floats.resize(pixels * 3);
    size_t replaced = 0;
    for (size_t i = 0; i < pixels * 3; ++i) {
        const size_t source = i / 3 * channels + std::min(i % 3, channels - 1);
        const bool is_float = image.storage == Image::Storage::float32;
        float value =
            is_float ? image.floats[source] : srgb_to_linear(static_cast<float>(image.bytes[source]) / 255.0F);
        if (!std::isfinite(value) || value < 0.0F) {
            value = 0.0F;
            ++replaced;
        }
        map.image.floats[i] = value;
    }
    if (replaced > 0) {
        warnings.push_back(path + ": environment: " + std::to_string(replaced) +
                           " negative or non-finite values became black");
    }
    return map;
}

Environment::Environment(const EnvironmentMap& map)
    : width_(static_cast<size_t>(map.image.width)), height_(static_cast<size_t>(map.image.height)) {
    texels_.resize(width_ * height_);
    for (size_t i = 0; i < texels_.size(); ++i) {
        const float* value = &map.image.floats[i * static_cast<size_t>(map.image.channels)];
        texels_[i] = map.scale * glm::max(Rgb(value[0], value[1], value[2]), Rgb(0.0F));
    }

    // A cell's weight is the largest luminance among its neighbours' texels, since the look-up is bilinear: so the
    // density is positive wherever the radiance is.
    row_cdf_.resize(height_ + 1);
    column_cdf_.resize(height_ * (width_ + 1));
    std::vector<double> rows(height_);
    std::vector<double> columns(width_);
    double total = 0.0;
    for (size_t y = 0; y < height_; ++y) {
        const double sin_theta = std::sin(M_PI * (static_cast<double>(y) + 0.5) / static_cast<double>(height_));
        for (size_t x = 0; x < width_; ++x) {
            float brightest = 0.0F;
            for (int dy = -1; dy <= 1; ++dy) {
                const auto row = static_cast<size_t>(std::clamp<std::ptrdiff_t>(
                    static_cast<std::ptrdiff_t>(y) + dy, 0, static_cast<std::ptrdiff_t>(height_) - 1));
                for (size_t dx = 0; dx < 3; ++dx) {
                    brightest = std::max(brightest, luminance(texels_[row * width_ + (x + width_ + dx - 1) % width_]));
                }
            }
            columns[x] = brightest;
            total += static_cast<double>(luminance(texels_[y * width_ + x])) * sin_theta;
        }
        rows[y] = sin_theta * accumulate_cdf(columns, &column_cdf_[y * (width_ + 1)]);
    }
    accumulate_cdf(rows, row_cdf_.data());
    total_luminance_ = static_cast<float>(total * 2.0 * M_PI * M_PI / static_cast<double>(width_ * height_));
}

Rgb Environment::radiance_at(float u, float v) const {
    const float x = u * static_cast<float>(width_) - 0.5F;
    const float y = std::clamp(v * static_cast<float>(height_) - 0.5F, 0.0F, static_cast<float>(height_ - 1));
    const float x_floor = std::floor(x);
    const float fx = x - x_floor;
    const int w = static_cast<int>(width_);
    const int x0 = (static_cast<int>(x_floor) + w) % w;
    const int x1 = (x0 + 1) % w;
    const int y0 = static_cast<int>(y);
    const int y1 = std::min(y0 + 1, static_cast<int>(height_) - 1);
    const float fy = y - static_cast<float>(y0);
    return glm::mix(glm::mix(texel(x0, y0), texel(x1, y0), fx), glm::mix(texel(x0, y1), texel(x1, y1), fx), fy);
}

float Environment::pdf_of_cell(int x, int y, float sin_theta) const {
    if (sin_theta <= 0.0F) return 0.0F;
    const float* columns = &column_cdf_[static_cast<size_t>(y) * (width_ + 1)];
    const float in_row = row_cdf_[static_cast<size_t>(y) + 1] - row_cdf_[static_cast<size_t>(y)];
    const float in_column = columns[x + 1] - columns[x];
    // du dv = dw / (2 pi^2 sin theta).
    return in_row * in_column * static_cast<float>(width_ * height_) / (2.0F * pi * pi * sin_theta);
}

Environment::Evaluation Environment::evaluate(const Vec3& d) const {
    const LatLong at = to_lat_long(d);
    const int x = std::clamp(static_cast<int>(at.u * static_cast<float>(width_)), 0, static_cast<int>(width_) - 1);
    const int y = std::clamp(static_cast<int>(at.v * static_cast<float>(height_)), 0, static_cast<int>(height_) - 1);
    return {radiance_at(at.u, at.v), pdf_of_cell(x, y, at.sin_theta)};
}

Vec3 Environment::sample(Vec2 random, Evaluation& evaluation) const {
    const size_t y = find_interval(row_cdf_.data(), height_, random.y);
    const float* columns = &column_cdf_[y * (width_ + 1)];
    const size_t x = find_interval(columns, width_, random.x);
    const auto inside = [](const float* cdf, size_t i, float value) {
        const float step = cdf[i + 1] - cdf[i];
        return step > 0.0F ? std::clamp((value - cdf[i]) / step, 0.0F, 0.9999999F) : 0.5F;
    };
    const float u = (static_cast<float>(x) + inside(columns, x, random.x)) / static_cast<float>(width_);
    const float v = (static_cast<float>(y) + inside(row_cdf_.data(), y, random.y)) / static_cast<float>(height_);
    float sin_theta, cos_theta, sin_phi, cos_phi;
    sincos_turn(0.5F * v, sin_theta, cos_theta);
    sincos_turn(u, sin_phi, cos_phi);
    evaluation.radiance = radiance_at(u, v);
    evaluation.pdf = total_luminance_ > 0.0F ? pdf_of_cell(static_cast<int>(x), static_cast<int>(y), sin_theta) : 0.0F;
    // The azimuth is 2 pi (u - 1/2), half a turn behind u.
    return {-sin_theta * sin_phi, cos_theta, sin_theta * cos_phi};
}

}  // namespace nephroid

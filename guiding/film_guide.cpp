#include "guiding/film_guide.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "core/sampler.h"

namespace nephroid {

namespace {

/// Points of a lobe that tell which pixels it covers.
constexpr uint32_t probe_points = 256;

/// Pixels with less than this share of a lobe's light do not need it.
constexpr float least_share = 0.01F;

/// Density within a pixel over its mean there, above which even samples are too few.
constexpr float least_contrast = 1.5F;

/// Probability of the lobes where a highlight outshines all else.
constexpr float most_fraction = 0.99F;

/// Share of the lobes inside of the pixel above which one position will do.
constexpr float mostly_inside = 0.9F;
/// Otherwise so many inside are drawn on average, at most this number in all.
constexpr float wanted_inside = 4.0F;
constexpr uint32_t most_candidates = 64;

/// Positions of a sample.
constexpr double most_positions = 1024.0;

/// (x + i * step) modulo 1: evenly spread for i = 0, 1, ...
float spread(float x, uint32_t i, double step) {
    const double sum = static_cast<double>(x) + static_cast<double>(i) * step;
    return std::min(static_cast<float>(sum - std::floor(sum)), 0x1.fffffep-1F);
}

/// What a lobe's points in a pixel add up to.
struct Coverage {
    float share = 0.0F;
    float density = 0.0F;  ///< Sum over the points.
};

}  // namespace

FilmGuide::FilmGuide(const CameraRays& rays, std::span<const FilmLobe> lobes)
    : rays_(rays), projection_(rays), lobes_(lobes.begin(), lobes.end()) {
    std::map<std::pair<int, int>, std::vector<std::pair<uint32_t, Coverage>>> covered;  // By row and column.
    for (uint32_t k = 0; k < lobes_.size(); ++k) {
        std::map<std::pair<int, int>, Coverage> coverage;
        for (uint32_t i = 0; i < probe_points; ++i) {
            const auto [u, v] = sample_2d(SamplerKind::sobol, 0U, i, 0);
            const Vec2 film = film_position(lobes_[k], sample_1d(SamplerKind::sobol, 0U, i, 1), u, v);
            // Far outside of any film, or not in front of the camera.
            if (!(std::abs(film.x) < 1e6F && std::abs(film.y) < 1e6F)) continue;
            Coverage& pixel = coverage[{static_cast<int>(std::floor(film.y)), static_cast<int>(std::floor(film.x))}];
            pixel.share += 1.0F / probe_points;
            pixel.density += film_density(lobes_[k], film) / probe_points;
        }
        for (const auto& [at, pixel] : coverage) {
            const float mean_density = pixel.density / pixel.share;
            if (pixel.share < least_share || !(mean_density > least_contrast * pixel.share)) continue;
            covered[at].push_back({k, pixel});
        }
    }
    for (const auto& [at, found] : covered) {
        Pixel pixel;
        pixel.x = at.second;
        pixel.y = at.first;
        pixel.first = static_cast<uint32_t>(shares_.size());
        pixel.count = static_cast<uint32_t>(found.size());
        float total = 0.0F, background = 0.0F;
        for (const auto& [lobe, coverage] : found) {
            shares_.push_back({lobe, lobes_[lobe].irradiance * coverage.share});
            total += shares_.back().weight;
            background = std::max(background, lobes_[lobe].background);
        }
        float inside = 0.0F;
        for (size_t i = 0; i < found.size(); ++i) {
            shares_[pixel.first + i].weight /= total;
            inside += shares_[pixel.first + i].weight * found[i].second.share;
        }
        if (inside < mostly_inside) {
            pixel.candidates =
                static_cast<uint32_t>(std::min(wanted_inside / inside, static_cast<float>(most_candidates))) + 1;
        }
        const Vec2 centre(static_cast<float>(pixel.x) + 0.5F, static_cast<float>(pixel.y) + 0.5F);
        const Triple<float> direction = rays_.direction(centre.x, centre.y);
        const CameraView<float> view = projection_.view_along(direction);
        pixel.radiance = total * view.pixel_density;
        pixel.fraction = most_fraction * pixel.radiance / (pixel.radiance + background);
        if (pixel.fraction > 0.0F && std::isfinite(pixel.fraction)) pixels_.push_back(pixel);
    }
}

// The least sum of all variances has positions in proportion to their deviations.
void FilmGuide::add_positions(double count, std::span<const float> deviations) {
    double sum = 0.0;
    for (const float deviation : deviations) sum += double{deviation};
    if (!(sum > 0.0) || !std::isfinite(sum)) return;
    for (size_t i = 0; i < pixels_.size(); ++i) {
        const double share = count * double{deviations[i]} / sum;
        pixels_[i].positions = static_cast<uint32_t>(std::min(1.0 + share, most_positions));
    }
}

Vec2 FilmGuide::film_position(const FilmLobe& lobe, float u_width, float u, float v) const {
    const Vec3 direction = sample_slope_lobe(lobe.lobe, u_width, u, v);
    const CameraView<float> view = projection_.view_along(to_triple(direction));
    if (!(view.depth > 0.0F)) return Vec2(std::numeric_limits<float>::infinity());
    return {view.x, view.y};
}

float FilmGuide::film_density(const FilmLobe& lobe, const Vec2& film) const {
    const Triple<float> direction = rays_.direction(film.x, film.y);
    const CameraView<float> view = projection_.view_along(direction);
    const float per_solid_angle = relative_density(lobe.lobe, direction) * lobe.lobe.determinant() * inv_pi;
    return per_solid_angle / view.pixel_density;
}

Vec2 FilmGuide::sample(const Pixel& pixel, float u_choice, float u, float v) const {
    if (u_choice >= pixel.fraction) return {static_cast<float>(pixel.x) + u, static_cast<float>(pixel.y) + v};
    float left = u_choice / pixel.fraction;
    for (uint32_t i = pixel.first; i < pixel.first + pixel.count; ++i) {
        const Share& share = shares_[i];
        if (left < share.weight || i + 1 == pixel.first + pixel.count) {
            return film_position(lobes_[share.lobe], std::min(left / share.weight, 0x1.fffffep-1F), u, v);
        }
        left -= share.weight;
    }
    return Vec2(std::numeric_limits<float>::infinity());
}

FilmGuide::Position FilmGuide::sample_inside(const Pixel& pixel, float u_choice, float u, float v, float u_pick) const {
    // Powers of 1 / x with x^4 = x + 1: evenly spread in three dimensions (Roberts 2018).
    constexpr double step = 0.8191725133961645;
    Position chosen;
    uint32_t inside = 0;
    for (uint32_t i = 0; i < pixel.candidates; ++i) {
        const Vec2 film =
            sample(pixel, spread(u_choice, i, step), spread(u, i, step * step), spread(v, i, step * step * step));
        if (std::floor(film.x) != static_cast<float>(pixel.x) || std::floor(film.y) != static_cast<float>(pixel.y)) {
            continue;
        }
        // Each of those inside with the same probability.
        ++inside;
        u_pick *= static_cast<float>(inside);
        const bool taken = u_pick < 1.0F;
        if (taken) chosen.film = film;
        u_pick = taken ? u_pick : (u_pick - 1.0F) / static_cast<float>(inside - 1);
    }
    if (inside > 0)
        chosen.weight = static_cast<float>(inside) / (static_cast<float>(pixel.candidates) * pdf(pixel, chosen.film));
    return chosen;
}

float FilmGuide::pdf(const Pixel& pixel, const Vec2& film) const {
    float density = 0.0F;
    for (uint32_t i = pixel.first; i < pixel.first + pixel.count; ++i) {
        density += shares_[i].weight * film_density(lobes_[shares_[i].lobe], film);
    }
    return (1.0F - pixel.fraction) + pixel.fraction * density;
}

}  // namespace nephroid

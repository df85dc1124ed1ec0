#include "integrators/guided/film_deviation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "core/sampler.h"
#include "integrators/guided/lobe_weight.h"

namespace nephroid {

namespace {

/// Film positions in a pixel that tell how much one of them deviates.
constexpr uint32_t measured_positions = 32;

/// Of one position by two and more reflections, over its radiance: measured on the Snail (docs/guiding.md).
constexpr float longer_deviation = 4.0F;

/// The lights of the pixel's highlights by one reflection, each once.
std::vector<uint32_t> lights_of(const FilmGuide& film, const FilmGuide::Pixel& pixel) {
    std::vector<uint32_t> found;
    for (uint32_t i = 0; i < pixel.count; ++i) {
        const FilmLobe& lobe = film.lobe(pixel, i);
        if (lobe.reflections == 1) found.push_back(lobe.light);
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
}

bool has_longer_paths(const FilmGuide& film, const FilmGuide::Pixel& pixel) {
    for (uint32_t i = 0; i < pixel.count; ++i) {
        if (film.lobe(pixel, i).reflections > 1) return true;
    }
    return false;
}

/// Doubles, for squares of the brightest highlights are beyond floats.
double measured_deviation(const RenderContext& context, std::span<const PathLight> lights, const FilmGuide& film,
                          const FilmGuide::Pixel& pixel) {
    const std::vector<uint32_t> shining = lights_of(film, pixel);
    if (shining.empty()) return 0.0;
    Receiver pinhole;
    pinhole.position = context.camera_rays.origin_base;
    double sum = 0.0, squares = 0.0;
    for (uint32_t i = 0; i < measured_positions; ++i) {
        const auto [u, v] = sample_2d(SamplerKind::sobol, 0U, i, 0);
        const auto [choice, pick] = sample_2d(SamplerKind::sobol, 0U, i, 1);
        const FilmGuide::Position position = film.sample_inside(pixel, choice, u, v, pick);
        if (!(position.weight > 0.0F)) continue;
        const Vec3 direction = to_vec3(context.camera_rays.direction(position.film.x, position.film.y));
        pinhole.geometric_normal = direction;
        double radiance = 0.0;
        for (const uint32_t light : shining) {
            radiance += double{reflected_radiance(context, pinhole, lights[light], direction)};
        }
        radiance *= double{position.weight};
        sum += radiance;
        squares += radiance * radiance;
    }
    const double mean = sum / measured_positions;
    return std::sqrt(std::max(squares / measured_positions - mean * mean, 0.0));
}

}  // namespace

std::vector<float> film_deviations(const RenderContext& context, std::span<const PathLight> lights,
                                   const FilmGuide& film) {
    std::vector<float> deviations(film.pixels().size());
    tbb::parallel_for(size_t{0}, deviations.size(), [&](size_t i) {
        const FilmGuide::Pixel& pixel = film.pixels()[i];
        const float longer = has_longer_paths(film, pixel) ? longer_deviation * pixel.radiance : 0.0F;
        deviations[i] = longer + static_cast<float>(measured_deviation(context, lights, film, pixel));
    });
    return deviations;
}

}  // namespace nephroid

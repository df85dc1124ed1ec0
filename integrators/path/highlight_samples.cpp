#include "integrators/path/highlight_samples.h"

#include <algorithm>

namespace nephroid {

namespace {

/// Tells the random numbers of FilmGuide's choice from all others.
constexpr uint32_t choice_salt = 0x5bd1e995U;
/// Tells those of further positions from those of the first.
constexpr uint32_t further_salt = 0x7feb352dU;

}  // namespace

const std::vector<HighlightSamples::Sample>& HighlightSamples::find(const SampleBlock& block,
                                                                    const AlignedArray<uint32_t>& seeds,
                                                                    const AlignedArray<uint32_t>& indices) {
    samples_.clear();
    const auto& pixels = guide_.pixels();
    const auto is_above = [](const FilmGuide::Pixel& pixel, int y) { return pixel.y < y; };
    auto pixel = std::lower_bound(pixels.begin(), pixels.end(), block.tile_y, is_above);
    for (; pixel != pixels.end() && pixel->y < block.tile_y + tile_size; ++pixel) {
        for (uint32_t p = 0; p < block.pixel_count; ++p) {
            if (block.tile_x + block.pixel_x[p] != pixel->x || block.tile_y + block.pixel_y[p] != pixel->y) continue;
            for (uint32_t s = 0; s < block.sample_count; ++s) {
                const uint32_t slot = s * block.pixel_count + p;
                samples_.push_back({&*pixel, slot, seeds[slot], indices[slot]});
            }
        }
    }
    return samples_;
}

CameraStart HighlightSamples::start(const Sample& sample, uint32_t position) const {
    CameraStart start;
    start.seed = sample.seed;
    start.index = sample.index;
    if (position > 0) {
        start.seed = pixel_seed(sample.seed, further_salt, context_.seed);
        start.index = sample.index * (sample.pixel->positions - 1) + position - 1;
    }
    const auto [u, v] = sample_2d(context_.sampler, start.seed, start.index, film_dimension_);
    const uint32_t choice_seed = pixel_seed(start.seed, choice_salt, context_.seed);
    const auto [choice, pick] = sample_2d(context_.sampler, choice_seed, start.index, film_dimension_);
    const FilmGuide::Position found = guide_.sample_inside(*sample.pixel, choice, u, v, pick);
    start.weight = found.weight;
    if (!(found.weight > 0.0F)) return start;
    start.origin = to_vec3(context_.camera_rays.origin(found.film.x, found.film.y));
    start.direction = to_vec3(context_.camera_rays.direction(found.film.x, found.film.y));
    return start;
}

}  // namespace nephroid

#include "integrators/path/pixel_samples.h"

#include <algorithm>

namespace nephroid {

namespace {

/// Tells the random numbers of FilmGuide's choice from all others.
constexpr uint32_t choice_salt = 0x5bd1e995U;

}  // namespace

void PixelSamples::find_highlights(const SampleBlock& block) {
    std::fill_n(highlights_.begin(), block.pixel_count, nullptr);
    if (guide_ == nullptr) return;
    const auto& pixels = guide_->pixels();
    const auto is_above = [](const FilmGuide::Pixel& pixel, int y) { return pixel.y < y; };
    auto pixel = std::lower_bound(pixels.begin(), pixels.end(), block.tile_y, is_above);
    for (; pixel != pixels.end() && pixel->y < block.tile_y + tile_size; ++pixel) {
        for (uint32_t p = 0; p < block.pixel_count; ++p) {
            if (block.tile_x + block.pixel_x[p] != pixel->x || block.tile_y + block.pixel_y[p] != pixel->y) continue;
            highlights_[p] = &*pixel;
        }
    }
}

const std::vector<PixelSamples::Sample>& PixelSamples::find(const SampleBlock& block,
                                                            const AlignedArray<uint32_t>& seeds) {
    samples_.clear();
    find_highlights(block);
    for (uint32_t p = 0; p < block.pixel_count; ++p) {
        const FilmGuide::Pixel* highlight = highlights_[p];
        const int x = block.tile_x + block.pixel_x[p], y = block.tile_y + block.pixel_y[p];
        uint32_t paths = highlight != nullptr ? highlight->positions : 1;
        uint32_t first_path = block.first_sample * paths;
        if (adaptive_ != nullptr) {
            paths = adaptive_->paths(x, y);
            first_path = adaptive_->first_path(x, y, block.first_sample);
        }
        if (highlight == nullptr && paths == 1 && first_path == block.first_sample) continue;
        for (uint32_t s = 0; s < block.sample_count; ++s, first_path += paths) {
            const uint32_t slot = s * block.pixel_count + p;
            samples_.push_back({highlight, x, y, slot, seeds[slot], paths, first_path});
        }
    }
    return samples_;
}

CameraStart PixelSamples::start(const Sample& sample, uint32_t path) const {
    CameraStart start;
    start.seed = sample.seed;
    start.index = sample.first_path + path;
    const auto [u, v] = sample_2d(context_.sampler, start.seed, start.index, film_dimension_);
    Vec2 film(static_cast<float>(sample.x) + u, static_cast<float>(sample.y) + v);
    start.weight = 1.0F;
    if (sample.highlight != nullptr) {
        const uint32_t choice_seed = pixel_seed(start.seed, choice_salt, context_.seed);
        const auto [choice, pick] = sample_2d(context_.sampler, choice_seed, start.index, film_dimension_);
        const FilmGuide::Position found = guide_->sample_inside(*sample.highlight, choice, u, v, pick);
        start.weight = found.weight;
        if (!(found.weight > 0.0F)) return start;
        film = found.film;
    }
    start.origin = to_vec3(context_.camera_rays.origin(film.x, film.y));
    start.direction = to_vec3(context_.camera_rays.direction(film.x, film.y));
    return start;
}

}  // namespace nephroid

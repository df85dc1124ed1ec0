#include "core/film.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

namespace nephroid {

SampleBuffer::SampleBuffer()
    : radiance{AlignedArray<float>(max_slots_per_block), AlignedArray<float>(max_slots_per_block),
               AlignedArray<float>(max_slots_per_block)},
      caustic{AlignedArray<float>(max_slots_per_block), AlignedArray<float>(max_slots_per_block),
              AlignedArray<float>(max_slots_per_block)},
      albedo{AlignedArray<float>(max_slots_per_block), AlignedArray<float>(max_slots_per_block),
             AlignedArray<float>(max_slots_per_block)},
      normal{AlignedArray<float>(max_slots_per_block), AlignedArray<float>(max_slots_per_block),
             AlignedArray<float>(max_slots_per_block)},
      depth(max_slots_per_block) {}

SampleBlock make_tile_block(int tile_x, int tile_y, int image_width, int image_height) {
    SampleBlock block;
    block.tile_x = tile_x;
    block.tile_y = tile_y;
    for (int square = 0; square < 16; ++square) {
        for (int i = 0; i < 16; ++i) {
            const int x = (square % 4) * 4 + i % 4;
            const int y = (square / 4) * 4 + i / 4;
            if (tile_x + x >= image_width || tile_y + y >= image_height) continue;
            block.pixel_x[block.pixel_count] = static_cast<uint8_t>(x);
            block.pixel_y[block.pixel_count] = static_cast<uint8_t>(y);
            ++block.pixel_count;
        }
    }
    return block;
}

uint64_t light_paths_per_sample(int image_width, int image_height, const PixelRegion& crop) {
    const auto extent = [](int begin, int end, int limit) {
        return std::min((end + tile_size - 1) / tile_size * tile_size, limit) - begin / tile_size * tile_size;
    };
    return static_cast<uint64_t>(extent(crop.x0, crop.x1, image_width)) *
           static_cast<uint64_t>(extent(crop.y0, crop.y1, image_height));
}

Film::Film(int image_width, int image_height, const PixelRegion& crop, const AovSelection& aovs, bool keep_squares)
    : image_width_(image_width), image_height_(image_height), crop_(crop), aovs_(aovs) {
    const size_t pixels = static_cast<size_t>(crop.width()) * static_cast<size_t>(crop.height());
    counts_.resize(pixels);
    nonfinite_.resize(pixels);
    beauty_.resize(pixels * 3);
    if (keep_squares || aovs.variance) squares_.resize(pixels * 3);
    if (aovs.albedo) albedo_.resize(pixels * 3);
    if (aovs.normal) normal_.resize(pixels * 3);
    if (aovs.depth) depth_.resize(pixels);
    if (aovs.caustic) caustic_.resize(pixels * 3);
}

namespace {

void add_three(std::vector<double>& sums, size_t pixel, const AlignedArray<float> (&values)[3], size_t slot) {
    if (sums.empty()) return;
    for (size_t c = 0; c < 3; ++c) sums[pixel * 3 + c] += static_cast<double>(values[c][slot]);
}

}  // namespace

void Film::expect_splats() {
    splat_counts_.resize(splat_count_kinds);
    splats_.resize(beauty_.size());
    caustic_splats_.resize(caustic_.size());
    splat_squares_.resize(squares_.size());
}

void Film::add_splats(const SampleBlock& block, uint32_t skip, uint32_t take, const SampleBuffer& buffer) {
    const auto count = [this](SplatCount kind, uint64_t n) {
        std::atomic_ref<uint64_t>(splat_counts_[kind]).fetch_add(n, std::memory_order_relaxed);
    };
    count(light_path_count, uint64_t{take} * block.pixel_count);
    const double scale = 1.0 / static_cast<double>(light_paths_per_sample(image_width_, image_height_, crop_));
    for (const Splat& splat : buffer.splats) {
        const uint32_t sample = splat.slot / block.pixel_count;
        if (sample < skip || sample >= skip + take || !crop_.contains(splat.x, splat.y)) continue;
        // "Not below" rather than "above": NaN must be counted too.
        const float sum = splat.value.r + splat.value.g + splat.value.b;
        if (!(static_cast<double>(sum) < ExactSums::largest_value)) {
            count(nonfinite_splat_count, 1);
            continue;
        }
        const size_t pixel = crop_.index_of(splat.x, splat.y);
        for (int c = 0; c < 3; ++c) {
            const size_t i = pixel * 3 + static_cast<size_t>(c);
            const auto value = static_cast<double>(splat.value[c]);
            splats_.add(i, value);
            if (splat.caustic && !caustic_splats_.empty()) caustic_splats_.add(i, value);
            if (!splat_squares_.empty()) splat_squares_.add(i, std::min(value * scale * value * scale, 0x1p46));
        }
    }
}

void Film::add(const SampleBlock& block, uint32_t skip, uint32_t take, const SampleBuffer& buffer) {
    if (!splat_counts_.empty()) add_splats(block, skip, take, buffer);
    for (uint32_t p = 0; p < block.pixel_count; ++p) {
        const int x = block.tile_x + block.pixel_x[p];
        const int y = block.tile_y + block.pixel_y[p];
        if (!crop_.contains(x, y)) continue;
        const size_t pixel = crop_.index_of(x, y);
        counts_[pixel] += take;
        for (uint32_t s = skip; s < skip + take; ++s) {
            const size_t slot = size_t{s} * block.pixel_count + p;
            const float sum = buffer.radiance[0][slot] + buffer.radiance[1][slot] + buffer.radiance[2][slot];
            if (!std::isfinite(sum)) {
                ++nonfinite_[pixel];
                continue;
            }
            add_three(beauty_, pixel, buffer.radiance, slot);
            for (size_t c = 0; c < 3 && !squares_.empty(); ++c) {
                const auto value = static_cast<double>(buffer.radiance[c][slot]);
                squares_[pixel * 3 + c] += value * value;
            }
            add_three(caustic_, pixel, buffer.caustic, slot);
            add_three(albedo_, pixel, buffer.albedo, slot);
            add_three(normal_, pixel, buffer.normal, slot);
            if (!depth_.empty()) depth_[pixel] += static_cast<double>(buffer.depth[slot]);
        }
    }
}

std::vector<float> Film::mean(const std::vector<double>& sums, size_t channels, const ExactSums& splats) const {
    std::vector<float> result(counts_.size() * channels);
    const double splat_scale = !splats.empty() && light_paths() > 0.0 ? 1.0 / light_paths() : 0.0;
    for (size_t i = 0; i < result.size(); ++i) {
        const uint32_t n = counts_[i / channels];
        if (n == 0) continue;
        result[i] = static_cast<float>(sums[i] / n);
        if (splat_scale > 0.0) result[i] = static_cast<float>(sums[i] / n + splats.sum(i) * splat_scale);
    }
    return result;
}

std::vector<float> Film::normal() const {
    std::vector<float> result = mean(normal_, 3);
    for (size_t i = 0; i + 2 < result.size(); i += 3) {
        const float length =
            std::sqrt(result[i] * result[i] + result[i + 1] * result[i + 1] + result[i + 2] * result[i + 2]);
        for (size_t c = 0; c < 3 && length > 0.0F; ++c) result[i + c] /= length;
    }
    return result;
}

std::vector<float> Film::variance() const {
    std::vector<float> result(squares_.size());
    for (size_t i = 0; i < result.size(); ++i) {
        const double n = counts_[i / 3];
        if (n < 2.0) continue;
        const double average = beauty_[i] / n;
        result[i] = static_cast<float>(std::max(squares_[i] / n - average * average, 0.0) / (n - 1.0));
        if (!splat_counts_.empty()) result[i] += static_cast<float>(splat_variance(i));
    }
    return result;
}

// Of the mean over light paths, most of which give the pixel nothing: (E[x^2] - E[x]^2) / (number of paths).
double Film::splat_variance(size_t i) const {
    if (light_paths() < 2.0) return 0.0;
    const auto per_sample = static_cast<double>(light_paths_per_sample(image_width_, image_height_, crop_));
    const double average = splats_.sum(i) / light_paths();
    const double square = splat_squares_.sum(i) * per_sample * per_sample / light_paths();
    return std::max(square - average * average, 0.0) / (light_paths() - 1.0);
}

std::vector<float> Film::spp() const {
    return {counts_.begin(), counts_.end()};
}

double Film::relative_noise() const {
    const std::vector<float> variances = variance();
    const std::vector<float> means = beauty();
    double variance_sum = 0.0;
    double mean_sum = 0.0;
    for (size_t i = 0; i < variances.size(); ++i) {
        variance_sum += static_cast<double>(variances[i]);
        mean_sum += static_cast<double>(means[i]);
    }
    const auto n = static_cast<double>(variances.size());
    return mean_sum > 0.0 ? std::sqrt(variance_sum / n) / (mean_sum / n) : 0.0;
}

double Film::sample_variance() const {
    const std::vector<float> variances = variance();
    double sum = 0.0;
    for (size_t i = 0; i < variances.size(); ++i) sum += static_cast<double>(variances[i]) * counts_[i / 3];
    return variances.empty() ? 0.0 : sum / static_cast<double>(variances.size());
}

void Film::clear() {
    for (auto* sums : state().sums) std::fill(sums->begin(), sums->end(), 0.0);
    std::fill(counts_.begin(), counts_.end(), 0);
    std::fill(nonfinite_.begin(), nonfinite_.end(), 0);
    for (auto* digits : state().exact) std::fill(digits->begin(), digits->end(), 0);
}

Film Film::combine(std::span<const Film* const> films, std::span<const double> weights) {
    Film result = *films[0];
    result.clear();
    std::vector<double> weight_sums(result.counts_.size());
    for (size_t f = 0; f < films.size(); ++f) {
        for (size_t i = 0; i < weight_sums.size(); ++i) {
            weight_sums[i] += weights[f] * films[f]->counts_[i];
            result.counts_[i] += films[f]->counts_[i];
            result.nonfinite_[i] += films[f]->nonfinite_[i];
        }
    }
    // As many samples as all films have, of the weighted mean.
    const State to = result.state();
    std::vector<double> variances(result.squares_.size());
    for (size_t f = 0; f < films.size(); ++f) {
        Film film = *films[f];
        const State from = film.state();
        const auto scale = [&](size_t pixel) {
            return weight_sums[pixel] > 0.0 ? weights[f] / weight_sums[pixel] * result.counts_[pixel] : 0.0;
        };
        for (size_t layer = 0; layer < to.sums.size(); ++layer) {
            const size_t channels = to.sums[layer]->size() / weight_sums.size();
            for (size_t i = 0; i < to.sums[layer]->size(); ++i) {
                (*to.sums[layer])[i] += scale(i / channels) * (*from.sums[layer])[i];
            }
        }
        const std::vector<float> own = film.variance();
        for (size_t i = 0; i < variances.size(); ++i) {
            const double share = weights[f] * film.counts_[i / 3] / std::max(weight_sums[i / 3], 1e-300);
            variances[i] += share * share * static_cast<double>(own[i]);
        }
    }
    result.set_variance(variances);
    return result;
}

// The squares that `variance` would turn into these values.
void Film::set_variance(const std::vector<double>& variances) {
    for (size_t i = 0; i < squares_.size(); ++i) {
        const double n = counts_[i / 3];
        if (n == 0.0) continue;
        const double average = beauty_[i] / n;
        squares_[i] = n * (average * average + variances[i] * (n - 1.0));
    }
}

uint64_t Film::sample_count() const {
    return std::accumulate(counts_.begin(), counts_.end(), uint64_t{0});
}

uint32_t Film::min_spp() const {
    return counts_.empty() ? 0 : *std::min_element(counts_.begin(), counts_.end());
}

uint64_t Film::nonfinite_samples() const {
    const uint64_t splats = splat_counts_.empty() ? 0 : splat_counts_[nonfinite_splat_count];
    return std::accumulate(nonfinite_.begin(), nonfinite_.end(), splats);
}

Film::State Film::state() {
    return {{&beauty_, &squares_, &albedo_, &normal_, &depth_, &caustic_},
            &counts_,
            &nonfinite_,
            {&splats_.digits(), &caustic_splats_.digits(), &splat_squares_.digits(), &splat_counts_}};
}

}  // namespace nephroid

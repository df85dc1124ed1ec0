#include "integrators/path/adaptive_sampling.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "core/byte_stream.h"

namespace nephroid {

namespace {

/// Variances are known well enough by then.
constexpr uint32_t last_lesson = 64;

/// Pixels this far away tell about a pixel that has had few paths itself.
constexpr int neighbourhood = 2;
/// They count as so many paths of its own.
constexpr float neighbours_paths = 256.0F;

/// Radiances below this share of the picture's mean count as that much.
constexpr double least_radiance = 0.25;

/// Of one sample of a pixel: a highlight may be a million times brighter than the rest.
constexpr float most_paths = 1024.0F;

/// Second and further paths for each sample, before there is anything to choose by, and what there is to choose from.
constexpr double first_further_share = 0.5;
constexpr std::array<double, 5> further_shares{0.05, 0.1, 0.25, 0.5, 1.0};

/// A float, and far from its end.
constexpr double most_spread = 1e36;

/// Paths of one sample, with one path for each `unit` of deviation.
float paths_for(float deviation, float unit) {
    return std::clamp(std::floor(deviation / unit + 0.5F), 1.0F, most_paths);
}

/// Calls visit(index) for the pixels around one of a picture of width x height, itself among them.
template <class Visit>
void for_neighbourhood(int x, int y, int width, int height, const Visit& visit) {
    for (int v = std::max(y - neighbourhood, 0); v <= std::min(y + neighbourhood, height - 1); ++v) {
        for (int u = std::max(x - neighbourhood, 0); u <= std::min(x + neighbourhood, width - 1); ++u) {
            visit(static_cast<size_t>(v * width + u));
        }
    }
}

/// Deviations by magnitude, so that the search for a unit does not look at every pixel again.
class DeviationCounts {
  public:
    explicit DeviationCounts(std::span<const float> deviations) : counts_(bins) {
        for (const float deviation : deviations) counts_[bin_of(deviation)] += 1.0;
    }
    /// The least unit with no more than `further` second and further paths in all.
    float unit_for(double further) const {
        float low = value_of(0) / most_paths, high = value_of(bins - 1);
        for (int step = 0; step < steps; ++step) {
            const float middle = std::sqrt(low) * std::sqrt(high);
            (further_paths(middle) > further ? low : high) = middle;
        }
        return high;
    }

  private:
    static constexpr size_t bins_per_octave = 16;
    static constexpr float least_exponent = -60.0F, most_exponent = 60.0F;
    static constexpr size_t bins = bins_per_octave * 120 + 1;
    static constexpr int steps = 40;

    static size_t bin_of(float deviation) {
        if (!(deviation > 0.0F)) return 0;
        const float exponent = std::clamp(std::log2(deviation), least_exponent, most_exponent);
        return static_cast<size_t>((exponent - least_exponent) * bins_per_octave);
    }
    static float value_of(size_t bin) { return std::exp2(static_cast<float>(bin) / bins_per_octave + least_exponent); }
    double further_paths(float unit) const {
        double sum = 0.0;
        for (size_t bin = 0; bin < bins; ++bin) {
            if (counts_[bin] > 0.0) sum += counts_[bin] * (double{paths_for(value_of(bin), unit)} - 1.0);
        }
        return sum;
    }

    std::vector<double> counts_;
};

}  // namespace

double AdaptiveSampling::Recent::spread() const {
    if (count < 2) return 0.0;
    const double result = squares - sum * sum / count;
    return std::isfinite(result) ? std::clamp(result, 0.0, most_spread) : 0.0;
}

// Chan et al. 1979.
void AdaptiveSampling::Seen::add(const Recent& recent) {
    if (recent.count == 0 || !std::isfinite(recent.squares)) return;
    const double before = count, more = recent.count, all = before + more;
    const double difference = recent.sum / more - double{mean};
    spread = static_cast<float>(
        std::min(double{spread} + recent.spread() + difference * difference * before * more / all, most_spread));
    mean = static_cast<float>(double{mean} + difference * more / all);
    count += recent.count;
    rays += recent.rays;
}

AdaptiveSampling::AdaptiveSampling(const PixelRegion& crop)
    : crop_(crop),
      pixels_(static_cast<size_t>(crop.width()) * static_cast<size_t>(crop.height())),
      seen_(pixels_.size()),
      recent_(pixels_.size()),
      radiance_(pixels_.size()),
      tile_columns_((crop.x1 - 1) / tile_size - crop.x0 / tile_size + 1),
      light_(static_cast<size_t>(tile_columns_) *
             static_cast<size_t>((crop.y1 - 1) / tile_size - crop.y0 / tile_size + 1)),
      further_share_(first_further_share) {}

void AdaptiveSampling::start_with(int x, int y, uint32_t paths) {
    if (!crop_.contains(x, y)) return;
    Pixel& pixel = pixels_[crop_.index_of(x, y)];
    pixel.paths = paths;
    pixel.is_known = 1;
}

uint32_t AdaptiveSampling::first_path(int x, int y, uint32_t index) const {
    if (!crop_.contains(x, y)) return index;
    const Pixel& pixel = pixels_[crop_.index_of(x, y)];
    return pixel.earlier_paths + (index - last_lesson_) * pixel.paths;
}

void AdaptiveSampling::record_splat(int tile_x, int tile_y, int x, int y, float radiance) {
    if (!crop_.contains(x, y)) return;
    const double around = double{radiance_[crop_.index_of(x, y)]};
    const double square = double{radiance} * double{radiance};
    if (around > 0.0 && std::isfinite(square)) light_[tile_of(tile_x, tile_y)].squares += square / around;
}

std::optional<uint32_t> AdaptiveSampling::next_lesson(uint32_t samples) const {
    if (samples >= last_lesson) return std::nullopt;
    return std::bit_ceil(samples + 1);
}

void AdaptiveSampling::learn(uint32_t samples) {
    last_lesson_ += samples;
    for (Pixel& pixel : pixels_) pixel.earlier_paths += samples * pixel.paths;
    // Samples before this lesson by what was seen before them, if that was two samples at least.
    if (last_lesson_ > 2) choose_further_share(deviations(), samples);
    for (size_t i = 0; i < pixels_.size(); ++i) seen_[i].add(recent_[i]);
    std::fill(recent_.begin(), recent_.end(), Recent());
    std::fill(light_.begin(), light_.end(), LightMoments());
    tell_radiance_around();
    if (last_lesson_ < 2) return;
    const std::vector<float> deviation = deviations();
    const float unit = DeviationCounts(deviation).unit_for(further_share_ * static_cast<double>(pixels_.size()));
    for (size_t i = 0; i < pixels_.size(); ++i) pixels_[i].paths = static_cast<uint32_t>(paths_for(deviation[i], unit));
}

// The mean of the neighbourhood.
void AdaptiveSampling::tell_radiance_around() {
    double sum = 0.0;
    for (const Seen& seen : seen_) sum += double{seen.mean};
    const auto least = static_cast<float>(least_radiance * sum / static_cast<double>(seen_.size()));
    const int width = crop_.width(), height = crop_.height();
    tbb::parallel_for(0, height, [&](int y) {
        for (int x = 0; x < width; ++x) {
            float around = 0.0F, count = 0.0F;
            for_neighbourhood(x, y, width, height, [&](size_t i) {
                around += seen_[i].mean;
                count += 1.0F;
            });
            radiance_[static_cast<size_t>(y * width + x)] = std::max(around / count, least);
        }
    });
}

// Of one path, over the square root of the radiance around and of its rays: from the pixel itself and its neighbours.
std::vector<float> AdaptiveSampling::deviations() const {
    std::vector<float> deviation(pixels_.size());
    const int width = crop_.width(), height = crop_.height();
    tbb::parallel_for(0, height, [&](int y) {
        for (int x = 0; x < width; ++x) {
            const auto i = static_cast<size_t>(y * width + x);
            const Seen& seen = seen_[i];
            if (seen.count == 0) continue;
            float spread = seen.spread, freedom = static_cast<float>(seen.count - 1);
            if (pixels_[i].is_known == 0) {
                float around = 0.0F, count = 0.0F;
                for_neighbourhood(x, y, width, height, [&](size_t k) {
                    if (pixels_[k].is_known != 0 || seen_[k].count < 2) return;
                    around += seen_[k].spread / static_cast<float>(seen_[k].count - 1);
                    count += 1.0F;
                });
                if (count > 0.0F) {
                    spread += neighbours_paths * around / count;
                    freedom += neighbours_paths;
                }
            }
            const float mean_rays = static_cast<float>(seen.rays) / static_cast<float>(seen.count);
            const float scale = freedom * radiance_[i] * mean_rays;
            if (scale > 0.0F) deviation[i] = std::sqrt(spread / scale);
        }
    });
    return deviation;
}

// By variance times rays. Samples since the last lesson had no part in the deviations.
void AdaptiveSampling::choose_further_share(std::span<const float> deviations, uint32_t samples) {
    const DeviationCounts counts(deviations);
    double light_variance = 0.0, light_rays = 0.0;
    for (const LightMoments& light : light_) {
        light_variance += light.squares / samples;
        light_rays += static_cast<double>(light.rays) / samples;
    }
    double least = 0.0;
    for (const double share : further_shares) {
        const float unit = counts.unit_for(share * static_cast<double>(pixels_.size()));
        double variance = light_variance, rays = light_rays;
        for (size_t i = 0; i < pixels_.size(); ++i) {
            const double n = double{paths_for(deviations[i], unit)};
            const Recent& recent = recent_[i];
            if (recent.count < 2) continue;
            rays += n * recent.rays / recent.count;
            if (radiance_[i] > 0.0F) variance += recent.spread() / (double{radiance_[i]} * n * (recent.count - 1));
        }
        const double cost = variance * rays;
        if (share != further_shares.front() && !(cost < least)) continue;
        least = cost;
        further_share_ = share;
    }
}

double AdaptiveSampling::mean_paths() const {
    double sum = 0.0;
    for (const Pixel& pixel : pixels_) sum += pixel.paths;
    return pixels_.empty() ? 1.0 : sum / static_cast<double>(pixels_.size());
}

std::vector<uint8_t> AdaptiveSampling::state() const {
    ByteWriter writer;
    writer.value(last_lesson_);
    writer.value(further_share_);
    writer.array(pixels_);
    writer.array(seen_);
    writer.array(recent_);
    writer.array(radiance_);
    writer.array(light_);
    return writer.take();
}

void AdaptiveSampling::restore(const std::vector<uint8_t>& state) {
    ByteReader reader(state);
    last_lesson_ = reader.value<uint32_t>();
    further_share_ = reader.value<double>();
    reader.array(pixels_);
    reader.array(seen_);
    reader.array(recent_);
    reader.array(radiance_);
    reader.array(light_);
}

}  // namespace nephroid

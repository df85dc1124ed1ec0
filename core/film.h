// Sums of samples per pixel, and the picture they give.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/aligned_array.h"
#include "core/exact_sums.h"
#include "core/vec.h"

namespace nephroid {

/// Half-open pixel rectangle [x0, x1) x [y0, y1).
struct PixelRegion {
    int x0 = 0;
    int y0 = 0;
    int x1 = 0;
    int y1 = 0;
    int width() const { return x1 - x0; }
    int height() const { return y1 - y0; }
    bool contains(int x, int y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
    /// Of a pixel inside, row by row.
    size_t index_of(int x, int y) const {
        return static_cast<size_t>(y - y0) * static_cast<size_t>(width()) + static_cast<size_t>(x - x0);
    }
    bool operator==(const PixelRegion&) const = default;
};

/// Layers beside beauty that a render may produce.
struct AovSelection {
    bool albedo = false;
    bool normal = false;
    bool depth = false;
    bool caustic = false;
    bool variance = false;
    bool spp = false;
};

/// Tiles are aligned to the whole image's pixel grid and always traced whole, whatever the crop: which rays share a
/// packet, and so every last bit of a pixel, does not depend on the crop.
inline constexpr int tile_size = 16;
inline constexpr uint32_t max_samples_per_block = 4;
inline constexpr size_t max_slots_per_block = size_t{tile_size} * tile_size * max_samples_per_block;

/// Light that a light path of a block sends to some pixel, anywhere in the image: 1 / (density of the light path),
/// times what the pixel's mean radiance gets from it. Divided by the number of light paths when the picture is made.
struct Splat {
    int x, y;       ///< Pixel of the image.
    uint32_t slot;  ///< Of the light path: one per sample of the block.
    bool caustic;   ///< It arrived as a caustic.
    Rgb value;
};

/// What a block of samples returned: one slot per sample, in an order that the block defines.
struct SampleBuffer {
    SampleBuffer();
    AlignedArray<float> radiance[3];
    AlignedArray<float> caustic[3];                   ///< Part of radiance that arrived as a caustic.
    AlignedArray<float> albedo[3], normal[3], depth;  ///< Of the first hit; zero where nothing was hit.
    std::vector<Splat> splats;  ///< Of integrators that trace light paths; keeps its capacity from block to block.

    Rgb radiance_of(size_t slot) const { return {radiance[0][slot], radiance[1][slot], radiance[2][slot]}; }
};

/// Samples [first_sample, first_sample + sample_count) of every pixel of one tile. Slot s * pixel_count + p is sample
/// first_sample + s of pixel p; 16 consecutive pixels form a 4 x 4 square, so packets of camera rays are coherent.
struct SampleBlock {
    int tile_x = 0;  ///< Pixel coordinates of the tile's corner.
    int tile_y = 0;
    uint32_t pixel_count = 0;                ///< Pixels of the tile inside the image.
    uint8_t pixel_x[tile_size * tile_size];  ///< Offsets inside the tile.
    uint8_t pixel_y[tile_size * tile_size];
    uint32_t first_sample = 0;
    uint32_t sample_count = 0;

    size_t slot_count() const { return size_t{pixel_count} * sample_count; }
};

/// The pixels of a tile in the order that SampleBlock describes.
SampleBlock make_tile_block(int tile_x, int tile_y, int image_width, int image_height);

/// The fixed partition of sample indices into blocks: {0} {1} {2,3} {4..7} {8..11} ... Returns how many samples the
/// block that starts at `first` has. Fixed, so that passes, resumption and deadlines never change a sample.
inline uint32_t samples_in_block(uint32_t first) {
    if (first < 2) return 1;
    return first == 2 ? 2 : max_samples_per_block;
}

/// Light paths that come with one sample of every pixel: the pixels of all tiles that the crop touches.
uint64_t light_paths_per_sample(int image_width, int image_height, const PixelRegion& crop);

/// Accumulated image of the crop region. Sums are double: they must not lose samples after 1e7 of them.
class Film {
  public:
    Film(int image_width, int image_height, const PixelRegion& crop, const AovSelection& aovs, bool keep_squares);

    int image_width() const { return image_width_; }
    int image_height() const { return image_height_; }
    const PixelRegion& crop() const { return crop_; }
    const AovSelection& aovs() const { return aovs_; }

    /// Makes room for splats, which then count from the next block on: one light path per sample of a tile's pixels,
    /// whether inside the crop or not. Films without splats take no memory and no time for them.
    void expect_splats();
    /// Makes room for the squares of samples, which `variance` needs.
    void keep_squares() { squares_.resize(beauty_.size()); }
    /// Back to no samples.
    void clear();
    /// Adds samples [skip, skip + take) of the block. Non-finite ones count as black and are counted. Different tiles
    /// may be added concurrently.
    void add(const SampleBlock& block, uint32_t skip, uint32_t take, const SampleBuffer& buffer);

    /// Mean of a layer: interleaved, crop.width() * crop.height() * channels values.
    std::vector<float> beauty() const { return mean(beauty_, 3, splats_); }
    std::vector<float> albedo() const { return mean(albedo_, 3); }
    std::vector<float> normal() const;
    std::vector<float> depth() const { return mean(depth_, 1); }
    std::vector<float> caustic() const { return mean(caustic_, 3, caustic_splats_); }
    /// Estimated variance of the pixel's mean. Samples of a pixel are stratified, so it is an upper estimate. Splats
    /// add theirs, with every splat taken for a light path of its own: low where one path splats a pixel twice.
    std::vector<float> variance() const;
    std::vector<float> spp() const;

    /// Root of the mean variance of the pixels' means over the mean luminance: the noise that --noise limits.
    double relative_noise() const;
    uint64_t sample_count() const;
    uint32_t min_spp() const;
    uint64_t nonfinite_samples() const;
    /// Variance of single samples, the mean over pixels and channels; 0: unknown, or there is none. Needs squares.
    double sample_variance() const;

    /// One film for several of the same kind, without splats: the mean of all samples, those of films[i] weighing
    /// weights[i], and the variance of that mean, as if they had come to one film.
    static Film combine(std::span<const Film* const> films, std::span<const double> weights);

    /// All accumulated state as named arrays, for checkpoints.
    struct State {
        std::vector<std::vector<double>*> sums;
        std::vector<uint32_t>* counts;
        std::vector<uint32_t>* nonfinite;
        std::vector<std::vector<uint64_t>*> exact;  ///< Of splats; empty arrays where none are expected.
    };
    State state();

  private:
    std::vector<float> mean(const std::vector<double>& sums, size_t channels, const ExactSums& splats = {}) const;
    void add_splats(const SampleBlock& block, uint32_t skip, uint32_t take, const SampleBuffer& buffer);
    double splat_variance(size_t i) const;
    void set_variance(const std::vector<double>& variances);
    double light_paths() const { return static_cast<double>(splat_counts_[light_path_count]); }

    int image_width_;
    int image_height_;
    PixelRegion crop_;
    AovSelection aovs_;
    std::vector<uint32_t> counts_;
    std::vector<uint32_t> nonfinite_;
    std::vector<double> beauty_, squares_, albedo_, normal_, depth_, caustic_;
    ExactSums splats_, caustic_splats_;
    ExactSums splat_squares_;  ///< Of splats divided by the light paths per sample: of the size of radiances.
    enum SplatCount : size_t { light_path_count, nonfinite_splat_count, splat_count_kinds };
    std::vector<uint64_t> splat_counts_;  ///< Empty: no splats are expected.
};

}  // namespace nephroid

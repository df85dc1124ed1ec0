// Film, metrics, alias table, cameras, rounding, picture files.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <limits>

#include "core/alias_table.h"
#include "core/camera.h"
#include "core/error.h"
#include "core/film.h"
#include "core/fingerprint.h"
#include "core/image_io.h"
#include "core/image_write.h"
#include "core/metrics.h"
#include "core/rounding.h"
#include "core/sampler.h"
#include "core/simd.h"

using namespace nephroid;

namespace {

std::string scratch(const std::string& name) {
    return (std::filesystem::temp_directory_path() / ("nephroid_test_" + name)).string();
}

}  // namespace

TEST_CASE("metrics of known pictures") {
    const std::vector<float> reference(3000, 1.0F);
    std::vector<float> image = reference;
    for (float& value : image) value += 0.1F;
    image[0] += 10.0F;
    const ImageError error = compare_images(image, reference);
    CHECK(error.rmse == doctest::Approx(std::sqrt((2999 * 0.01 + 10.1 * 10.1) / 3000)).epsilon(1e-4));
    CHECK(error.relmse_trimmed == doctest::Approx(0.01 / 1.01).epsilon(1e-4));
    CHECK(error.relmse > error.relmse_trimmed);
    CHECK(compare_images(reference, reference).rmse == 0.0);
}

TEST_CASE("columns of rows that lie anywhere") {
    std::vector<float> values(simd_width * simd_width + 1);
    for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
    std::array<const float*, simd_width> rows;
    for (size_t r = 0; r < simd_width; ++r) rows[r] = &values[1 + (r * 5 + 3) % simd_width * simd_width];
    const std::array<FloatV, simd_width> columns = load_transposed(rows);
    for (size_t c = 0; c < simd_width; ++c) {
        for (size_t r = 0; r < simd_width; ++r) CHECK(static_cast<float>(columns[c][r]) == rows[r][c]);
    }
}

TEST_CASE("alias table draws what it says") {
    const std::vector<float> weights = {0.0F, 1.0F, 5.0F, 0.25F, 0.0F, 3.75F};
    const AliasTable table(weights);
    std::vector<int> counts(weights.size(), 0);
    constexpr uint32_t n = 200000;
    double remapped = 0.0;
    for (uint32_t i = 0; i < n; ++i) {
        float u = (static_cast<float>(i) + 0.5F) / n;
        ++counts[table.sample(u)];
        CHECK((u >= 0.0F && u < 1.0F));
        remapped += u;
    }
    for (size_t i = 0; i < weights.size(); ++i) {
        CHECK(table.probability(i) == doctest::Approx(weights[i] / 10.0F));
        CHECK(counts[i] == doctest::Approx(n * weights[i] / 10.0).epsilon(1e-3));
    }
    CHECK(remapped / n == doctest::Approx(0.5).epsilon(1e-2));
    const AliasTable zero(std::vector<float>{0.0F, 0.0F});
    CHECK(zero.probability(0) == 0.5F);
}

TEST_CASE("film: means, variance, non-finite samples, crop") {
    AovSelection aovs;
    aovs.variance = true;
    Film film(20, 20, {2, 3, 19, 18}, aovs, false);
    SampleBuffer samples;
    for (int ty = 0; ty < 20; ty += tile_size) {
        for (int tx = 0; tx < 20; tx += tile_size) {
            SampleBlock block = make_tile_block(tx, ty, 20, 20);
            block.sample_count = 4;
            for (uint32_t s = 0; s < 4; ++s) {
                for (uint32_t p = 0; p < block.pixel_count; ++p) {
                    const size_t slot = size_t{s} * block.pixel_count + p;
                    const auto x = static_cast<float>(tx + block.pixel_x[p]);
                    for (auto& channel : samples.radiance) channel[slot] = x + static_cast<float>(s % 2);
                    const bool bad = s == 3 && tx + block.pixel_x[p] == 5 && ty + block.pixel_y[p] == 5;
                    if (bad) samples.radiance[1][slot] = std::numeric_limits<float>::quiet_NaN();
                }
            }
            film.add(block, 0, 2, samples);
            film.add(block, 2, 2, samples);
        }
    }
    CHECK(film.sample_count() == 17U * 15U * 4U);
    CHECK(film.nonfinite_samples() == 1U);
    const std::vector<float> beauty = film.beauty();
    CHECK(beauty.size() == 17U * 15U * 3U);
    CHECK(beauty[0] == doctest::Approx(2.5));
    CHECK(beauty[(16) * 3] == doctest::Approx(18.5));
    // Values 2, 3, 2, 3: variance of a sample 1/3, of the mean 1/12.
    CHECK(film.variance()[0] == doctest::Approx(1.0 / 12.0));
}

TEST_CASE("tiles list each pixel once, in packets of 4 x 4") {
    const SampleBlock whole = make_tile_block(0, 0, 100, 100);
    CHECK(whole.pixel_count == 256);
    for (size_t i = 0; i < 16; ++i) CHECK((whole.pixel_x[i] < 4 && whole.pixel_y[i] < 4));
    CHECK(make_tile_block(96, 96, 100, 99).pixel_count == 12);
    uint32_t covered = 0;
    for (uint32_t first = 0; first < 100; first += samples_in_block(first)) covered += samples_in_block(first);
    CHECK(covered == 100);
}

TEST_CASE("camera rays pass through the corners of the view") {
    Camera camera;
    camera.yfov = 1.0F;
    const CameraRays rays = make_camera_rays(camera, 200, 100);
    const Triple<float> top = rays.direction(100.0F, 0.0F);
    CHECK(top.y / -top.z == doctest::Approx(std::tan(0.5)));
    const Triple<float> right = rays.direction(200.0F, 50.0F);
    CHECK(right.x / -right.z == doctest::Approx(2.0 * std::tan(0.5)));
    camera.kind = CameraKind::orthographic;
    camera.ymag = 3.0F;
    const CameraRays parallel = make_camera_rays(camera, 200, 100);
    CHECK(parallel.origin(200.0F, 0.0F).x == doctest::Approx(6.0));
    CHECK(parallel.origin(200.0F, 0.0F).y == doctest::Approx(3.0));
    CHECK(parallel.direction(0.0F, 0.0F).z == doctest::Approx(-1.0));
}

TEST_CASE("nudge moves by one or two units in the last place, always outwards") {
    for (const float x : {0.0F, 1.0F, -1.0F, 1e-30F, -3e7F, 1e30F}) {
        CHECK(nudge(x, 1.0F) > x);
        CHECK(nudge(x, -1.0F) < x);
        CHECK(std::abs(nudge(x, 1.0F) - x) <= 2.5F * std::numeric_limits<float>::epsilon() * std::abs(x) + 2e-30F);
    }
}

TEST_CASE("EXR: layers, crop window and attributes survive a round trip; nothing temporary remains") {
    const std::string path = scratch("layers.exr");
    const PixelRegion crop{3, 2, 7, 5};
    std::vector<float> rgb(4 * 3 * 3);
    for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<float>(i) * 1.5F;
    rgb[4] = 1e30F;
    write_exr(path, 10, 8, crop,
              {{"", "RGB", rgb}, {"albedo", "RGB", rgb}, {"depth", "Z", std::vector<float>(12, 2.0F)}},
              {{"nephroid/seed", "7"}});
    const Image image = read_image(path);
    CHECK(image.width == 4);
    CHECK(image.height == 3);
    REQUIRE(image.channels >= 3);
    for (size_t p = 0; p < 12; ++p) {
        for (size_t c = 0; c < 3; ++c)
            CHECK(image.floats[p * static_cast<size_t>(image.channels) + c] == rgb[p * 3 + c]);
    }
    CHECK_FALSE(std::filesystem::exists(temporary_path(path)));
    std::filesystem::remove(path);
}

TEST_CASE("output paths are checked before anything is rendered") {
    CHECK_THROWS_AS(check_output_path("/nonexistent_folder/x.exr"), Error);
    CHECK_THROWS_AS(check_output_path(scratch("x.jpg")), Error);
    CHECK_NOTHROW(check_output_path(scratch("x.png")));
}

TEST_CASE("fingerprints notice every byte") {
    std::vector<uint8_t> data(37, 3);
    const auto hash = [&] {
        Fingerprint fingerprint;
        fingerprint.add(data);
        return fingerprint.value();
    };
    const uint64_t before = hash();
    CHECK(hash() == before);
    for (uint8_t& byte : data) {
        byte ^= 1;
        CHECK(hash() != before);
        byte ^= 1;
    }
}

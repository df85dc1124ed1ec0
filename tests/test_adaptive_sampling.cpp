// Adaptive sampling: known optima, dots that come anywhere, light paths, extremes; pictures that stay what they are.
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <set>

#include "integrators/path/adaptive_sampling.h"
#include "integrators/path/path_integrator.h"
#include "tests/guided_renders.h"
#include "tests/statistics.h"

using namespace nephroid;

namespace {

constexpr PixelRegion crop{3, 5, 35, 29};

/// Value of a path through a pixel.
using PathValue = std::function<float(int x, int y, std::mt19937& generator)>;

/// Samples up to `samples`, with lessons where they belong; what all samples of a pixel add up to, if asked for.
void run_samples(AdaptiveSampling& adaptive, uint32_t samples, const PathValue& value, uint32_t seed = 1,
                 uint32_t rays = 2, std::vector<double>* sums = nullptr) {
    std::mt19937 generator(seed);
    uint32_t last_lesson = 0;
    std::optional<uint32_t> lesson = adaptive.next_lesson(0);
    for (uint32_t s = 0; s < samples; ++s) {
        size_t pixel = 0;
        for (int y = crop.y0; y < crop.y1; ++y) {
            for (int x = crop.x0; x < crop.x1; ++x, ++pixel) {
                const uint32_t paths = adaptive.paths(x, y);
                double sum = 0.0;
                for (uint32_t i = 0; i < paths; ++i) {
                    const float found = value(x, y, generator);
                    adaptive.record(x, y, found, rays);
                    sum += double{found};
                }
                if (sums != nullptr) (*sums)[pixel] += sum / paths;
            }
        }
        if (lesson != s + 1) continue;
        adaptive.learn(*lesson - last_lesson);
        last_lesson = *lesson;
        lesson = adaptive.next_lesson(last_lesson);
    }
}

float normal(std::mt19937& generator) {
    return std::normal_distribution<float>()(generator);
}

/// A quarter of the crop.
bool is_noisy(int x, int y) {
    return x < (crop.x0 + crop.x1) / 2 && y < (crop.y0 + crop.y1) / 2;
}

}  // namespace

TEST_CASE("adaptive sampling: paths in proportion to the deviation") {
    AdaptiveSampling adaptive(crop);
    CHECK(adaptive.mean_paths() == 1.0);
    run_samples(adaptive, 64, [](int x, int y, std::mt19937& generator) {
        return 10.0F + (is_noisy(x, y) ? 4.0F : 0.1F) * normal(generator);
    });
    // As many as may be spent, on the quarter that has the noise: five there, one elsewhere.
    CHECK(adaptive.mean_paths() == doctest::Approx(2.0).epsilon(0.15));
    CHECK(adaptive.paths(crop.x0 + 4, crop.y0 + 4) >= 4);
    CHECK(adaptive.paths(crop.x0 + 4, crop.y0 + 4) <= 6);
    CHECK(adaptive.paths(crop.x1 - 3, crop.y1 - 3) == 1);
    // Outside of the crop nothing is known.
    CHECK(adaptive.paths(crop.x0 - 1, crop.y0) == 1);
    CHECK(adaptive.first_path(crop.x1, crop.y0, 17) == 17);
}

TEST_CASE("adaptive sampling: rays count, and the radiance around") {
    // The same deviation over the square root of the radiance.
    const auto value = [](int x, int y, std::mt19937& generator) {
        return is_noisy(x, y) ? 16.0F + 4.0F * normal(generator) : 1.0F + normal(generator);
    };
    AdaptiveSampling adaptive(crop);
    run_samples(adaptive, 64, value);
    const uint32_t bright = adaptive.paths(crop.x0 + 4, crop.y0 + 4), dim = adaptive.paths(crop.x1 - 3, crop.y1 - 3);
    CHECK(std::max(bright, dim) - std::min(bright, dim) <= 1);
}

TEST_CASE("adaptive sampling: dots that come anywhere, and what light paths make, are worth no paths") {
    const auto dots = [](int, int, std::mt19937& generator) {
        return std::uniform_real_distribution<float>()(generator) < 2e-3F ? 1000.0F : 1.0F;
    };
    AdaptiveSampling adaptive(crop);
    run_samples(adaptive, 64, dots);
    CHECK(adaptive.mean_paths() < 1.3);

    // Noise in a quarter of the picture, but splats that bring a hundred times as much.
    AdaptiveSampling splatted(crop);
    std::mt19937 generator(3);
    run_samples(splatted, 64, [&](int x, int y, std::mt19937& values) {
        const int tile_x = crop.x0 / tile_size * tile_size, tile_y = crop.y0 / tile_size * tile_size;
        splatted.record_splat(tile_x, tile_y, x, y, 40.0F);
        splatted.record_light_rays(tile_x, tile_y, 1);
        return 10.0F + (is_noisy(x, y) ? 4.0F : 0.1F) * normal(values);
    });
    CHECK(splatted.mean_paths() < 1.2);
}

TEST_CASE("adaptive sampling: every path of a pixel has its own number") {
    AdaptiveSampling adaptive(crop);
    adaptive.start_with(crop.x0, crop.y0, 7);
    std::set<uint32_t> numbers;
    std::mt19937 generator(5);
    uint32_t paths = 0;
    for (uint32_t s = 0; s < 64; ++s) {
        const uint32_t first = adaptive.first_path(crop.x0, crop.y0, s);
        for (uint32_t i = 0; i < adaptive.paths(crop.x0, crop.y0); ++i, ++paths) {
            CHECK(numbers.insert(first + i).second);
            adaptive.record(crop.x0, crop.y0, 1.0F + normal(generator) * static_cast<float>(s % 7), 2);
        }
        for (int x = crop.x0 + 1; x < crop.x1; ++x) adaptive.record(x, crop.y0, 1.0F + 0.1F * normal(generator), 2);
        if (adaptive.next_lesson(s) == s + 1) adaptive.learn(s + 1 < 2 ? s + 1 : (s + 1) / 2);
    }
    CHECK(*numbers.rbegin() + 1 == paths);  // And none is left out.
    CHECK(paths > 64);
}

TEST_CASE("adaptive sampling: what a sample tells changes no pixel's expectation") {
    // Skewed, so that what happens to be dark also seems to deviate less: weights by paths would darken the picture.
    const auto skewed = [](int, int, std::mt19937& generator) {
        return std::uniform_real_distribution<float>()(generator) < 0.1F ? 10.0F : 0.0F;
    };
    constexpr int renders = 400;
    constexpr uint32_t samples = 16;
    std::vector<double> sums(static_cast<size_t>(crop.width()) * static_cast<size_t>(crop.height()));
    double spent = 0.0;
    for (int i = 0; i < renders; ++i) {
        AdaptiveSampling adaptive(crop);
        run_samples(adaptive, samples, skewed, static_cast<uint32_t>(i), 2, &sums);
        spent += adaptive.mean_paths();
    }
    double sum = 0.0;
    for (const double s : sums) sum += s;
    const double count = renders * samples * static_cast<double>(sums.size());
    // A sample's variance is 9 at most.
    CHECK(std::abs(sum / count - 1.0) < 4.0 * 3.0 / std::sqrt(count));
    CHECK(spent / renders > 1.01);
}

TEST_CASE("adaptive sampling: extremes") {
    for (const float value :
         {0.0F, 1e-30F, 1e30F, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
        AdaptiveSampling adaptive(crop);
        adaptive.start_with(crop.x0, crop.y0, 1024);
        run_samples(adaptive, 64, [&](int x, int y, std::mt19937& generator) {
            const bool here = x == 9 && y == 9;
            return here ? value * (1.0F + normal(generator)) : 1.0F + 0.1F * normal(generator);
        });
        INFO("value ", value);
        CHECK(adaptive.mean_paths() >= 1.0);
        CHECK(adaptive.mean_paths() <= 2.6);
        for (int y = crop.y0; y < crop.y1; ++y) {
            for (int x = crop.x0; x < crop.x1; ++x) CHECK(adaptive.paths(x, y) <= 1024);
        }
    }
    // Nothing to see, and a single pixel.
    AdaptiveSampling black(crop);
    run_samples(black, 64, [](int, int, std::mt19937&) { return 0.0F; });
    CHECK(black.mean_paths() == 1.0);
    AdaptiveSampling single({7, 7, 8, 8});
    for (uint32_t s = 0; s < 64; ++s) {
        for (uint32_t i = 0; i < single.paths(7, 7); ++i) single.record(7, 7, static_cast<float>(i + s % 3), 1);
        if (single.next_lesson(s) == s + 1) single.learn(s + 1 < 2 ? s + 1 : (s + 1) / 2);
    }
    CHECK(single.mean_paths() <= 3.0);
}

TEST_CASE("adaptive sampling: state and back") {
    const auto value = [](int x, int y, std::mt19937& generator) {
        return 10.0F + (is_noisy(x, y) ? 4.0F : 0.1F) * normal(generator);
    };
    AdaptiveSampling first(crop), second(crop);
    run_samples(first, 24, value);
    second.restore(first.state());
    CHECK(second.state() == first.state());
    CHECK(second.paths(crop.x0 + 2, crop.y0 + 2) == first.paths(crop.x0 + 2, crop.y0 + 2));
    first.learn(8);
    second.learn(8);
    CHECK(second.state() == first.state());
}

TEST_CASE("adaptive sampling: pictures of path tracer and guided agree with plain path tracing") {
    const testing::CausticScene caustic = testing::ring_caustic(0.1F);
    const testing::CheckedPicture plain = render_path(caustic, {.spp = 16384});
    const testing::PreparedScene prepared(caustic.scene, caustic.camera, 16, 16);
    RenderContext context = prepared.context;
    context.max_depth = 4;
    context.sampler = SamplerKind::independent;
    context.seed = 9;
    const PathIntegrator adaptive(context, {0, 0, 16, 16});
    const testing::Picture picture = testing::render(adaptive, context, 16, 16, 8192);
    testing::check_same_mean(picture, plain, "adaptive path tracing");
    REQUIRE(adaptive.statistics().has_value());
    CHECK(adaptive.statistics()->measures[0].second > 1.04);
    for (const bool is_adaptive : {false, true}) {
        for (const uint32_t light_path_per : {0U, 4U}) {
            GuidedSettings settings;
            settings.cached_points = 200;
            settings.light_path_per = light_path_per;
            settings.adaptive = is_adaptive;
            const testing::CheckedPicture guided = render_guided(caustic, {.spp = 8192}, settings);
            testing::check_clean(guided);
            testing::check_same_mean(guided, plain, is_adaptive ? "adaptive guided" : "guided");
        }
    }
}

// The learned guide fraction: its sums, known optima, wrong guides, and renders that learn.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "core/exact_float_sums.h"
#include "guiding/odds_moments.h"
#include "integrators/driver.h"
#include "integrators/guided/fraction_learner.h"
#include "tests/guided_renders.h"

using namespace nephroid;

namespace {

/// Directions are numbers in [0, 1): the BSDF draws them evenly, the guide from [0, 1 / height) only. What they bring
/// is `inside` there and `outside` elsewhere.
struct TwoDensities {
    float height;
    float inside, outside;

    float guide_pdf(float x) const { return x * height < 1.0F ? height : 0.0F; }
    float light(float x) const { return x * height < 1.0F ? inside : outside; }
    float pdf(float x, float fraction) const { return fraction * guide_pdf(x) + 1.0F - fraction; }

    double second_moment(double fraction) const {
        const double share = 1.0 / double{height};
        return squared(double{inside}) * share / (fraction * double{height} + 1.0 - fraction) +
               squared(double{outside}) * (1.0 - share) / (1.0 - fraction);
    }
    double best_fraction() const {
        double best = double{least_guide_fraction};
        for (double b = best; b <= double{largest_guide_fraction}; b += 1e-3) {
            if (second_moment(b) < second_moment(best)) best = b;
        }
        return best;
    }

    static double squared(double x) { return x * x; }

    /// Calls record(bin, w) for samples drawn with `fraction`.
    template <class Record>
    void sample(float fraction, int count, uint32_t seed, const Record& record) const {
        std::mt19937 generator(seed);
        std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
        for (int i = 0; i < count; ++i) {
            const float choice = uniform(generator), u = uniform(generator);
            const float x = choice < fraction ? u / height : u;
            const float p = pdf(x, fraction), contribution = light(x) / p;
            record(odds_bin(guide_pdf(x), 1.0F), contribution * contribution * p / (guide_pdf(x) + 1.0F));
        }
    }
};

/// Points of a row, each with one lobe; all of one fraction.
SlopeCache row_of_points(size_t count, float fraction) {
    SlopeCache cache;
    std::vector<CachedSlopeLobe<float>> lobes(count);
    for (size_t i = 0; i < count; ++i) {
        CachedPoint point;
        point.position = Vec3(0.1F * static_cast<float>(i), 0.0F, 0.0F);
        point.reach = 0.4F;
        point.first_lobe = static_cast<uint32_t>(i);
        point.lobe_count = 1;
        point.fraction = fraction;
        cache.points.push_back(point);
    }
    cache.lobes = LineArray<CachedSlopeLobe>(lobes);
    cache.lookup = CachedPointLookup(cache.points);
    return cache;
}

GuidedSettings learning_settings(uint32_t light_path_per) {
    GuidedSettings settings;
    settings.cached_points = 200;
    settings.bounces = 1;
    settings.light_path_per = light_path_per;
    return settings;
}

constexpr int size = 32;

Film new_film() {
    AovSelection aovs;
    aovs.variance = true;
    return {size, size, {0, 0, size, size}, aovs, true};
}

struct Run {
    int threads = 2;
    std::string checkpoint = {};
};

/// A render of some lessons by a new integrator.
struct LearnedRender {
    LearnedRender(const testing::CausticScene& caustic, uint32_t light_path_per, const Run& run) : film(new_film()) {
        const testing::PreparedScene prepared(caustic.scene, caustic.camera, size, size);
        const GuidedIntegrator integrator(prepared.context, find_casters(caustic.scene),
                                          {size, size, {0, 0, size, size}}, learning_settings(light_path_per));
        REQUIRE(integrator.learner() != nullptr);
        DriverSettings settings;
        settings.spp = 21;
        settings.threads = run.threads;
        settings.process_start = std::chrono::steady_clock::now();
        settings.checkpoint = run.checkpoint;
        settings.resume = !run.checkpoint.empty();
        Progress progress(Verbosity::quiet);
        const RenderResult result = run_render(integrator, film, settings, progress);
        is_done = result.passes.back().spp >= 21.0;
        learned = integrator.learner()->state();
    }
    Film film;
    bool is_done = false;
    std::vector<uint8_t> learned;
};

}  // namespace

TEST_CASE("exact sums of floats: any order, any magnitude") {
    std::mt19937 generator(1);
    std::uniform_real_distribution<float> exponent(-140.0F, 99.0F);
    std::vector<float> values;
    long double expected = 0.0L;
    for (int i = 0; i < 1000; ++i) {
        values.push_back(std::exp2(exponent(generator)));
        expected += static_cast<long double>(values.back());
    }
    ExactFloatSums forwards, backwards;
    forwards.resize(2);
    backwards.resize(2);
    for (size_t i = 0; i < values.size(); ++i) {
        forwards.add(1, values[i]);
        backwards.add(1, values[values.size() - 1 - i]);
    }
    CHECK(forwards.sums() == backwards.sums());
    CHECK(forwards.sum(0) == 0.0);
    CHECK(forwards.sum(1) == doctest::Approx(static_cast<double>(expected)).epsilon(1e-14));
    // Each magnitude alone: both digits of a value, subnormal numbers, the largest.
    for (const float value : {0x1p-149F, 0x1.8p-130F, 0x1.fffffep-20F, 1.0F, 0x1.234568p31F, 0x1.fffffep99F}) {
        ExactFloatSums sums;
        sums.resize(1);
        for (int i = 0; i < 3; ++i) sums.add(0, value);
        CHECK(sums.sum(0) == 3.0 * double{value});
    }
    ExactFloatSums refused;
    refused.resize(1);
    refused.add(0, -1.0F);
    refused.add(0, std::nanf(""));
    CHECK(refused.sum(0) == 0.0);
    refused.add(0, std::numeric_limits<float>::infinity());
    CHECK(refused.sum(0) == double{ExactFloatSums::largest_value});
}

TEST_CASE("odds moments: the fraction of least variance, from samples of another") {
    // The guide's light matters much, somewhat, little; the last one is all outside of it.
    for (const TwoDensities problem :
         {TwoDensities{32.0F, 100.0F, 0.3F}, TwoDensities{32.0F, 32.0F, 1.0F}, TwoDensities{8.0F, 4.0F, 1.0F},
          TwoDensities{128.0F, 30.0F, 1.0F}, TwoDensities{32.0F, 0.01F, 1.0F}}) {
        for (const float used : {0.2F, 0.5F, 0.9F}) {
            OddsMoments moments{};
            constexpr int count = 200000;
            problem.sample(used, count, 7, [&](size_t bin, float w) { moments[bin] += double{w}; });
            const double best = problem.best_fraction();
            CHECK(double{least_variance_fraction(moments, 0.5F)} == doctest::Approx(best).epsilon(0.03));
            CHECK(second_moment(moments, best) / count == doctest::Approx(problem.second_moment(best)).epsilon(0.05));
        }
    }
    CHECK(least_variance_fraction({}, 0.3F) == 0.3F);
}

TEST_CASE("odds bins: by the ratio alone, whatever the densities") {
    CHECK(odds_bin(0.0F, 1.0F) == 0);
    CHECK(odds_bin(1.0F, 0.0F) == odds_bins - 1);
    CHECK(odds_bin(1e20F, 1e-20F) == odds_bins - 1);
    CHECK(odds_bin(1.0F, 1.0F) == odds_bins / 2);
    CHECK(odds_bin(0.99F, 1.0F) == odds_bins / 2 - 1);
    CHECK(odds_bin(4.0e9F, 1e9F) == odds_bins / 2 + 1);
}

TEST_CASE("learned fractions: the known optimum at each end of a row, whatever was expected; no single dot decides") {
    const TwoDensities good{32.0F, 32.0F, 0.3F}, bad{32.0F, 1.0F, 2.0F};
    constexpr uint32_t count = 1000, half = count / 2;
    const auto problem_at = [&](size_t i) { return i < half ? good : bad; };
    // Nothing expected, and the opposite of what comes.
    for (const double wrong : {0.0, 1.0}) {
        SlopeCache cache = row_of_points(count, 0.5F);
        std::vector<OddsMoments> expected(count);
        for (size_t i = 0; i < count; ++i) expected[i][i < half ? 0 : odds_bins - 1] = wrong;
        FractionLearner learner(cache, expected);
        for (uint32_t i = 0; i < count; ++i) {
            problem_at(i).sample(cache.points[i].fraction, 500, i,
                                 [&](size_t bin, float w) { learner.record(i, static_cast<uint32_t>(bin), w); });
        }
        // One sample of the other kind of light, brighter than all others together: without a limit it would decide.
        learner.record(200, 0, 1e8F);
        learner.record(800, odds_bins - 1, 1e8F);
        learner.learn(1);
        CHECK(learner.lessons() == 1);
        for (const size_t i : {0UL, 100UL, 200UL, 300UL, 700UL, 800UL, 900UL, 999UL}) {
            INFO("point ", i, ", expected ", wrong);
            const double difference = double{cache.points[i].fraction} - problem_at(i).best_fraction();
            CHECK(std::abs(difference) < (i == 800 ? 0.3 : 0.15));
        }
    }
}

TEST_CASE("learned fractions fall where lobes are wrong") {
    // Turned by many widths, and not moved back by Newton's method.
    const testing::CacheChange turned{{}, [](SlopeCache& cache) {
                                          for (size_t i = 0; i < cache.lobes.size(); ++i) {
                                              CachedSlopeLobe<float> lobe = cache.lobes.get(i);
                                              lobe.y = lobe.y + Triple<float>{0.0F, 0.5F, 0.0F};
                                              cache.lobes.set(i, lobe);
                                          }
                                          for (CachedPoint& point : cache.points) point.fraction = 0.9F;
                                      }};
    for (const uint32_t light_path_per : {0U, 16U}) {
        GuidedSettings settings = learning_settings(light_path_per);
        settings.slope_warp = SlopeWarp::none;
        const testing::CheckedPicture picture =
            render_guided(testing::sphere_caustic(0.05F), {.spp = 256}, settings, turned);
        MESSAGE("mean fraction before " << picture.fraction_before << ", after " << picture.fraction_after);
        CHECK(picture.fraction_after < 0.5 * picture.fraction_before);
    }
}

TEST_CASE("learning: the same bits for any number of threads") {
    const testing::CausticScene caustic = testing::ring_caustic(0.02F);
    for (const uint32_t light_path_per : {0U, 16U}) {
        const LearnedRender one(caustic, light_path_per, {.threads = 1}),
            three(caustic, light_path_per, {.threads = 3});
        CHECK(one.film.beauty() == three.film.beauty());
        CHECK(one.film.variance() == three.film.variance());
        CHECK(one.learned == three.learned);
    }
}

TEST_CASE("learning: interrupted after every pass and resumed, the same bits") {
    const testing::CausticScene caustic = testing::ring_caustic(0.02F);
    const std::string checkpoint = (std::filesystem::temp_directory_path() / "nephroid_test_fraction.state").string();
    for (const uint32_t light_path_per : {0U, 16U}) {
        const LearnedRender whole(caustic, light_path_per, {});
        std::filesystem::remove(checkpoint);
        for (int run = 0;; ++run) {
            REQUIRE(run < 30);
            interrupt_requested = true;
            const LearnedRender part(caustic, light_path_per, {.checkpoint = checkpoint});
            interrupt_requested = false;
            if (!part.is_done) continue;
            CHECK(run > 2);
            CHECK(part.film.beauty() == whole.film.beauty());
            CHECK(part.film.variance() == whole.film.variance());
            CHECK(part.learned == whole.learned);
            break;
        }
    }
    std::filesystem::remove(checkpoint);
}

TEST_CASE("learning: what was learned for another cache is left alone") {
    SlopeCache many = row_of_points(40, 0.5F), few = row_of_points(10, 0.25F);
    FractionLearner before(many, {}), after(few, {});
    for (uint32_t i = 0; i < 40; ++i) before.record(i, 0, 1.0F);
    before.learn(1);
    after.restore(before.state());
    CHECK(after.lessons() == 0);
    for (const CachedPoint& point : few.points) CHECK(point.fraction == 0.25F);
    for (uint32_t i = 0; i < 10; ++i) after.record(i, odds_bins - 1, 1.0F);
    after.learn(1);
    CHECK(few.points[9].fraction > 0.25F);
}

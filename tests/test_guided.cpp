// The guided integrator: the mean must not depend on what the cache holds. Against path tracing, against quadrature of
// the caustic, and with caches that are wrong on purpose.
#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "integrators/guided/guided_integrator.h"
#include "integrators/path/path_integrator.h"
#include "integrators/path/path_worker.h"
#include "tests/caustic_scenes.h"
#include "tests/statistics.h"
#include "tests/test_scenes.h"

using namespace nephroid;
using testing::CausticScene;

namespace {

using SgCache = LobeCache<SgLobe>;

/// A path tracer with a guide that the test owns.
class GuidedBy final : public Integrator {
  public:
    GuidedBy(const RenderContext& context, const DirectionalGuide& guide) : context_(context), guide_(guide) {}
    std::string name() const override { return "guided by a test"; }
    std::unique_ptr<IntegratorWorker> make_worker() const override {
        return std::make_unique<PathWorker>(context_, &guide_);
    }

  private:
    const RenderContext& context_;
    const DirectionalGuide& guide_;
};

struct Render {
    int size = 16;
    uint32_t spp = 1024;
    uint32_t max_depth = 4;
    uint32_t seed = 0;
};

testing::Picture render_path(const CausticScene& caustic, const Render& options) {
    testing::PreparedScene prepared(caustic.scene, caustic.camera, options.size, options.size);
    prepared.context.max_depth = options.max_depth;
    prepared.context.sampler = SamplerKind::independent;
    prepared.context.seed = options.seed;
    return testing::render(PathIntegrator(prepared.context), prepared.context, options.size, options.size, options.spp);
}

using CacheChange = std::function<void(SgCache&)>;

testing::Picture render_guided(const CausticScene& caustic, const Render& options, const GuidedSettings& settings,
                               const CacheChange& change = {}) {
    testing::PreparedScene prepared(caustic.scene, caustic.camera, options.size, options.size);
    prepared.context.max_depth = options.max_depth;
    prepared.context.sampler = SamplerKind::independent;
    prepared.context.seed = options.seed + 1000;
    const GuidedIntegrator integrator(prepared.context, find_casters(caustic.scene),
                                      {options.size, options.size, {0, 0, options.size, options.size}}, settings);
    REQUIRE(integrator.guide() != nullptr);
    if (!change) return testing::render(integrator, prepared.context, options.size, options.size, options.spp);
    SgCache cache = integrator.cache();
    change(cache);
    const CachedGuide<SgMixture> guide(cache, settings.mixture, settings.guide_fraction);
    return testing::render(GuidedBy(prepared.context, guide), prepared.context, options.size, options.size,
                           options.spp);
}

/// Sums over 4 x 4 blocks and all channels, compared with the Sidak correction.
void check_same_mean(const testing::Picture& a, const testing::Picture& b, const std::string& name) {
    constexpr int block = 4;
    const int blocks = a.width / block;
    const double limit = testing::critical_z(testing::sidak(0.002, blocks * blocks));
    double worst = 0.0;
    for (int by = 0; by < blocks; ++by) {
        for (int bx = 0; bx < blocks; ++bx) {
            double sum_a = 0.0, sum_b = 0.0, variance = 0.0;
            for (int y = by * block; y < (by + 1) * block; ++y) {
                for (int x = bx * block; x < (bx + 1) * block; ++x) {
                    const size_t i = static_cast<size_t>(y * a.width + x) * 3 + 1;
                    sum_a += a.rgb[i];
                    sum_b += b.rgb[i];
                    variance += double{a.variance[i]} + double{b.variance[i]};
                }
            }
            const double z = (sum_a - sum_b) / (std::sqrt(variance) + 1e-6 * sum_b + 1e-12);
            worst = std::max(worst, std::abs(z));
            INFO(name, ": block ", bx, ",", by, ": ", sum_a, " against ", sum_b, ", z ", z);
            CHECK(std::abs(z) < limit);
        }
    }
    MESSAGE(name << ": largest |z| of " << blocks * blocks << " blocks " << worst << ", limit " << limit);
}

GuidedSettings small_cache(int bounces) {
    GuidedSettings settings;
    settings.cached_points = 400;
    settings.bounces = bounces;
    settings.selection = Selection::local_minima;
    return settings;
}

void rotate_lobes(SgCache& cache) {
    for (SgLobe& lobe : cache.lobes) {
        lobe.reflector += Vec3(0.02F, -0.01F, 0.015F);
        lobe.image_slope = -lobe.image_slope;
    }
}

void scramble_weights(SgCache& cache) {
    std::mt19937 generator(3);
    for (const CachedPoint& point : cache.points) {
        float total = 0.0F;
        for (uint32_t i = 0; i < point.lobe_count; ++i) {
            float& weight = cache.lobes[point.first_lobe + i].weight;
            weight = std::uniform_real_distribution<float>(0.01F, 1.0F)(generator);
            total += weight;
        }
        for (uint32_t i = 0; i < point.lobe_count; ++i) cache.lobes[point.first_lobe + i].weight /= total;
    }
}

/// Every second lobe; what is left does not even sum to one.
void delete_half(SgCache& cache) {
    for (size_t i = 0; i < cache.lobes.size(); i += 2) cache.lobes[i].weight = 0.0F;
}

}  // namespace

// Rougher reflectors than guiding is for: a path tracer finds their caustics often enough for its own variance estimate
// to be trusted. At alpha 0.05 and 2048 samples it is not (z-scores of 6 and 7 against a mean that was right).
constexpr float alpha_for_path = 0.1F;
constexpr uint32_t spp_for_path = 16384;

TEST_CASE("guided and path tracing have the same mean, block by block") {
    for (const CausticScene& caustic : testing::all_caustic_scenes(alpha_for_path)) {
        const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
        check_same_mean(render_guided(caustic, {.spp = 2048}, small_cache(caustic.reflections)), path, caustic.name);
    }
}

TEST_CASE("wrong caches do not move the mean") {
    for (const CausticScene& caustic :
         {testing::ring_caustic(alpha_for_path), testing::two_mirror_caustic(alpha_for_path)}) {
        const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
        const GuidedSettings settings = small_cache(caustic.reflections);
        const Render options{.spp = 2048};
        check_same_mean(render_guided(caustic, options, settings, rotate_lobes), path, caustic.name + ", rotated");
        check_same_mean(render_guided(caustic, options, settings, scramble_weights), path,
                        caustic.name + ", scrambled");
        check_same_mean(render_guided(caustic, options, settings, delete_half), path, caustic.name + ", half deleted");
    }
}

TEST_CASE("every ablation has the same mean") {
    const CausticScene caustic = testing::bumpy_plane_caustic(alpha_for_path);
    const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
    const Render options{.spp = 1024};
    GuidedSettings settings = small_cache(1);
    settings.mixture.warp = SgWarp::none;
    check_same_mean(render_guided(caustic, options, settings), path, "warp=none");
    settings = small_cache(1);
    settings.newton = false;
    check_same_mean(render_guided(caustic, options, settings), path, "newton=off");
    settings = small_cache(1);
    settings.selection = Selection::every_triangle;
    settings.cached_points = 50;
    check_same_mean(render_guided(caustic, options, settings), path, "selection=triangles");
    settings = small_cache(1);
    settings.guide_fraction = 0.9F;
    check_same_mean(render_guided(caustic, options, settings), path, "guide_fraction=0.9");
    settings = small_cache(1);
    settings.epsilon = 0.5;
    settings.merge_distance = 2.0;
    check_same_mean(render_guided(caustic, options, settings), path, "epsilon=0.5, merge_distance=2");
}

TEST_CASE("sphere lights: the mixture's density enters next event estimation's weight") {
    CausticScene caustic = testing::sphere_caustic(alpha_for_path);
    caustic.scene.lights[0].kind = LightKind::sphere;
    caustic.scene.lights[0].radius = 0.012F;
    const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
    check_same_mean(render_guided(caustic, {.spp = 2048}, small_cache(1)), path, "sphere light");
}

TEST_CASE("caustics agree with quadrature over the reflector") {
    for (const float alpha : {0.005F, 0.02F, 0.1F}) {
        for (const CausticScene& caustic :
             {testing::sphere_caustic(alpha), testing::bumpy_plane_caustic(alpha), testing::ring_caustic(alpha)}) {
            for (const Vec3& x : caustic.floor_points) {
                // A picture of one point: direct light and one reflection.
                CausticScene close = caustic;
                close.camera = testing::look_at(x + Vec3(0.05F, 1.5F, 0.1F), x, 1e-4F);
                Render options;
                options.size = 4;
                options.spp = 16384;
                options.max_depth = 2;
                GuidedSettings settings = small_cache(1);
                settings.cached_points = 16;
                const testing::Picture picture = render_guided(close, options, settings);
                double mean = 0.0, variance = 0.0;
                for (size_t i = 0; i < 16; ++i) {
                    mean += picture.rgb[3 * i + 1] / 16.0;
                    variance += picture.variance[3 * i + 1] / 256.0;
                }
                const double expected = testing::floor_radiance(caustic, x);
                const double z = (mean - expected) / (std::sqrt(variance) + 2e-3 * expected);
                INFO(caustic.name, ", alpha ", alpha, ": ", mean, " against ", expected, ", deviation ",
                     std::sqrt(variance), ", z ", z);
                CHECK(std::abs(z) < 4.0);
                CHECK(std::sqrt(variance) < 0.03 * expected);
            }
        }
    }
}

TEST_CASE("without a caster or a small light guided is path tracing, bit for bit") {
    CausticScene caustic = testing::sphere_caustic(0.5F);
    testing::PreparedScene prepared(caustic.scene, caustic.camera, 16, 16);
    const GuidedIntegrator integrator(prepared.context, find_casters(caustic.scene), {16, 16, {0, 0, 16, 16}},
                                      GuidedSettings());
    CHECK(integrator.guide() == nullptr);
    const testing::Picture guided = testing::render(integrator, prepared.context, 16, 16, 8);
    const testing::Picture path = testing::render(PathIntegrator(prepared.context), prepared.context, 16, 16, 8);
    CHECK(guided.rgb == path.rgb);
}

TEST_CASE("guided pictures do not depend on the number of threads") {
    const CausticScene caustic = testing::two_mirror_caustic(0.02F);
    std::vector<std::vector<float>> pictures;
    for (const int threads : {1, 2, 5}) {
        testing::PreparedScene prepared(caustic.scene, caustic.camera, 32, 32);
        const GuidedIntegrator integrator(prepared.context, find_casters(caustic.scene), {32, 32, {0, 0, 32, 32}},
                                          small_cache(2));
        pictures.push_back(testing::render(integrator, prepared.context, 32, 32, 8, threads).rgb);
    }
    CHECK(pictures[0] == pictures[1]);
    CHECK(pictures[0] == pictures[2]);
}

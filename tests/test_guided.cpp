// The guided integrator: the mean must not depend on what the cache holds. Against path tracing, against quadrature of
// the caustic, and with caches that are wrong on purpose.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <span>
#include <utility>

#include "integrators/guided/guided_integrator.h"
#include "integrators/path/path_integrator.h"
#include "tests/guided_renders.h"
#include "tests/test_scenes.h"

using namespace nephroid;
using testing::CacheChange;
using testing::CausticScene;

namespace {

GuidedSettings small_cache(LobeKind lobe, int bounces) {
    GuidedSettings settings = lobe == LobeKind::slope ? GuidedSettings() : paper_settings();
    settings.cached_points = 200;
    settings.bounces = bounces;
    settings.light_path_per = 0;  // Camera paths alone: light paths would hide what is wrong with them.
    settings.selection = Selection::local_minima;  // Thousands of lobes a point otherwise, at the test's alpha.
    return settings;
}

testing::CheckedPicture render_with_guide(const CausticScene& caustic, const testing::RenderSize& size,
                                          const GuidedSettings& settings, const CacheChange& change = {}) {
    const testing::CheckedPicture picture = render_guided(caustic, size, settings, change);
    REQUIRE(picture.guided);
    testing::check_clean(picture);
    return picture;
}

EnvironmentMap even_environment(float radiance) {
    EnvironmentMap map;
    map.image.width = 2;
    map.image.height = 1;
    map.image.channels = 3;
    map.image.storage = Image::Storage::float32;
    map.image.floats.assign(6, radiance);
    return map;
}

std::string name_of(LobeKind lobe) {
    return lobe == LobeKind::slope ? ", slope lobes" : ", spherical Gaussians";
}

/// Turns every lobe by several of its widths.
const CacheChange rotated{[](SgCache& cache) {
                              for (SgLobe& lobe : cache.lobes) {
                                  lobe.reflector += Vec3(0.02F, -0.01F, 0.015F);
                                  lobe.image_slope = -lobe.image_slope;
                              }
                          },
                          [](SlopeCache& cache) {
                              for (size_t i = 0; i < cache.lobes.size(); ++i) {
                                  CachedSlopeLobe<float> lobe = cache.lobes.get(i);
                                  lobe.y = lobe.y + Triple<float>{0.02F, -0.01F, 0.015F};
                                  std::swap(lobe.j11, lobe.j21);
                                  lobe.j12 *= 3.0F;
                                  cache.lobes.set(i, lobe);
                              }
                          }};

/// Gives all lobes arbitrary weights.
const CacheChange scrambled{[](SgCache& cache) {
                                std::mt19937 generator(3);
                                std::uniform_real_distribution<float> uniform(0.01F, 1.0F);
                                for (const CachedPoint& point : cache.points) {
                                    const auto lobes =
                                        std::span(cache.lobes).subspan(point.first_lobe, point.lobe_count);
                                    float total = 0.0F;
                                    for (SgLobe& lobe : lobes) total += lobe.weight = uniform(generator);
                                    for (SgLobe& lobe : lobes) lobe.weight /= total;
                                }
                            },
                            [](SlopeCache& cache) {
                                std::mt19937 generator(3);
                                for (size_t i = 0; i < cache.lobes.size(); ++i) {
                                    CachedSlopeLobe<float> lobe = cache.lobes.get(i);
                                    lobe.weight = std::uniform_real_distribution<float>(0.01F, 1.0F)(generator);
                                    cache.lobes.set(i, lobe);
                                }
                            }};

/// Leaves out every second lobe; the paper's weights then do not even sum to one.
const CacheChange half_deleted{[](SgCache& cache) {
                                   for (size_t i = 0; i < cache.lobes.size(); i += 2) cache.lobes[i].weight = 0.0F;
                               },
                               [](SlopeCache& cache) {
                                   for (size_t i = 0; i < cache.lobes.size(); i += 2) {
                                       CachedSlopeLobe<float> lobe = cache.lobes.get(i);
                                       lobe.weight = 0.0F;
                                       cache.lobes.set(i, lobe);
                                   }
                               }};

}  // namespace

// Rougher reflectors than guiding is for: a path tracer finds their caustics often enough for its own variance estimate
// to be trusted. At alpha 0.05 and 2048 samples it is not (z-scores of 6 and 7 against a mean that was right).
constexpr float alpha_for_path = 0.1F;
constexpr uint32_t spp_for_path = 8192;

constexpr std::array<LobeKind, 2> both_lobes{LobeKind::slope, LobeKind::spherical_gaussian};

TEST_CASE("guided and path tracing have the same mean, block by block") {
    for (const CausticScene& caustic : testing::all_caustic_scenes(alpha_for_path)) {
        const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
        for (const LobeKind lobe : both_lobes) {
            check_same_mean(render_with_guide(caustic, {.spp = 1024}, small_cache(lobe, caustic.reflections)), path,
                            caustic.name + name_of(lobe));
        }
        // With light paths beside the guide, and with so many that a wrong guide hardly matters.
        GuidedSettings settings = small_cache(LobeKind::slope, caustic.reflections);
        settings.light_path_per = 16;
        check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path, caustic.name + ", light paths");
        settings.light_path_per = 1;
        check_same_mean(render_with_guide(caustic, {.spp = 512}, settings, rotated), path,
                        caustic.name + ", light paths, rotated");
    }
}

TEST_CASE("wrong caches do not move the mean") {
    for (const CausticScene& caustic :
         {testing::ring_caustic(alpha_for_path), testing::two_mirror_caustic(alpha_for_path)}) {
        const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
        for (const LobeKind lobe : both_lobes) {
            const GuidedSettings settings = small_cache(lobe, caustic.reflections);
            const testing::RenderSize options{.spp = 2048};
            const std::string name = caustic.name + name_of(lobe);
            check_same_mean(render_with_guide(caustic, options, settings, rotated), path, name + ", rotated");
            check_same_mean(render_with_guide(caustic, options, settings, scrambled), path, name + ", scrambled");
            check_same_mean(render_with_guide(caustic, options, settings, half_deleted), path, name + ", half deleted");
        }
    }
}

TEST_CASE("every ablation has the same mean") {
    // Coarse: the paper's lobes are one or more for each triangle.
    const CausticScene caustic = testing::bumpy_plane_caustic(alpha_for_path, 12);
    const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
    const auto check = [&](const std::string& name, LobeKind lobe, const auto& change) {
        GuidedSettings settings = small_cache(lobe, 1);
        settings.cached_points = 100;
        change(settings);
        check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path, name + name_of(lobe));
    };
    const LobeKind sg = LobeKind::spherical_gaussian, slope = LobeKind::slope;
    check("warp=none", sg, [](GuidedSettings& s) { s.sg_warp = SgWarp::none; });
    check("warp=none", slope, [](GuidedSettings& s) { s.slope_warp = SlopeWarp::none; });
    check("warp=implicit", slope, [](GuidedSettings& s) { s.slope_warp = SlopeWarp::implicit; });
    check("newton=off", sg, [](GuidedSettings& s) {
        s.newton = false;
        s.cached_points = 50;
    });
    check("newton=off", slope, [](GuidedSettings& s) { s.newton = false; });
    check("guide_fraction=0.9", sg, [](GuidedSettings& s) { s.guide_fraction = 0.9F; });
    check("guide_fraction=0.99", slope, [](GuidedSettings& s) { s.guide_fraction = 0.99F; });
    check("selection=triangles", sg, [](GuidedSettings& s) {
        s.selection = Selection::every_triangle;
        s.cached_points = 50;
    });
    check("epsilon=0.5, merge_distance=2", sg, [](GuidedSettings& s) {
        s.acceptance.epsilon = 0.5;
        s.merge_distance = 2.0;
    });
    check("slope_limit=2", slope, [](GuidedSettings& s) { s.acceptance.alpha_multiple = 2.0; });
    check("photons=0", slope, [](GuidedSettings& s) { s.photons = 0.0; });
}

TEST_CASE("glossy receivers: products of lobes and BSDF do not move the mean") {
    for (const float metallic : {0.0F, 1.0F}) {
        for (CausticScene caustic :
             {testing::ring_caustic(alpha_for_path), testing::two_mirror_caustic(alpha_for_path)}) {
            Material& floor = caustic.scene.materials[0];
            floor.metallic = metallic;
            floor.roughness = 0.3F;  // Alpha .09: narrow enough for products.
            floor.specular = 1.0F;
            const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
            const std::string name = caustic.name + (metallic > 0.0F ? ", metal floor" : ", coated floor");
            GuidedSettings settings = small_cache(LobeKind::slope, 2);
            check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path, name);
            check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings, rotated), path, name + ", rotated");
            settings.light_path_per = 1;
            check_same_mean(render_with_guide(caustic, {.spp = 512}, settings, scrambled), path,
                            name + ", scrambled, light paths");
        }
    }
}

TEST_CASE("wrong lobes over metal, many samples: rows that are as good as parallel") {
    CausticScene caustic = testing::two_mirror_caustic(alpha_for_path);
    caustic.scene.materials[0].metallic = 1.0F;
    caustic.scene.materials[0].roughness = 0.45F;  // Alpha 0.2: no caster.
    const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
    GuidedSettings settings = small_cache(LobeKind::slope, 2);
    settings.guide_fraction = 0.5F;
    check_same_mean(render_with_guide(caustic, {.spp = 8192}, settings, rotated), path, "rotated");
}

TEST_CASE("lobes of paths of two reflections have the same mean, searched or from photons") {
    const CausticScene caustic = testing::two_mirror_caustic(alpha_for_path);
    const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
    GuidedSettings settings = small_cache(LobeKind::slope, 2);
    check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path, "photons");
    settings.long_paths = LongPaths::search;
    check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path, "search");
}

TEST_CASE("where there is no time to search, lobes from photons alone have the same mean") {
    for (const CausticScene& caustic : testing::all_caustic_scenes(alpha_for_path)) {
        GuidedSettings settings = small_cache(LobeKind::slope, caustic.reflections);
        settings.search_seconds = 1e-9;
        check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings),
                        render_path(caustic, {.spp = spp_for_path}), caustic.name);
    }
}

TEST_CASE("sphere lights: the mixture's density enters next event estimation's weight") {
    for (const float radius : {0.012F, 0.4F}) {
        CausticScene caustic = testing::sphere_caustic(alpha_for_path);
        caustic.scene.lights[0].kind = LightKind::sphere;
        caustic.scene.lights[0].radius = radius;
        const std::string name = "sphere light of " + std::to_string(radius);
        const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
        for (const LobeKind lobe : both_lobes) {
            check_same_mean(render_with_guide(caustic, {.spp = 1024}, small_cache(lobe, 1)), path,
                            name + name_of(lobe));
        }
        GuidedSettings settings = small_cache(LobeKind::slope, 1);
        settings.light_path_per = 2;
        check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path, name + ", light paths");
    }
}

TEST_CASE("light paths of sphere, spot and directional lights beside guided ones have the same mean") {
    for (const LightKind kind : {LightKind::sphere, LightKind::spot, LightKind::directional}) {
        CausticScene caustic = testing::sphere_caustic(alpha_for_path);
        PunctualLight& light = caustic.scene.lights[0];
        light.kind = kind;
        light.radius = kind == LightKind::sphere ? 0.012F : 0.0F;
        light.direction = glm::normalize(Vec3(0.0F, 0.5F, 0.0F) - light.position);
        light.cos_inner = 0.98F;
        light.cos_outer = 0.9F;
        // One that no light path leaves, too. At a spot light's rim, path tracing takes long to know its own variance.
        caustic.scene.environment = even_environment(0.02F);
        const testing::Picture path = render_path(caustic, {.spp = 4 * spp_for_path});
        GuidedSettings settings = small_cache(LobeKind::slope, 1);
        settings.light_path_per = 2;
        check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path,
                        "light kind " + std::to_string(static_cast<int>(kind)));
    }
}

TEST_CASE("a caster that emits is left to the BSDF and to light sampling") {
    CausticScene caustic = testing::sphere_caustic(alpha_for_path);
    caustic.scene.materials[1].emission = Rgb(0.1F);
    const testing::Picture path = render_path(caustic, {.spp = spp_for_path});
    for (const uint32_t light_path_per : {0U, 2U}) {
        GuidedSettings settings = small_cache(LobeKind::slope, 1);
        settings.light_path_per = light_path_per;
        check_same_mean(render_with_guide(caustic, {.spp = 1024}, settings), path,
                        "emitting caster, a light path per " + std::to_string(light_path_per));
    }
}

TEST_CASE("a perfect mirror's caustic of a point light comes by light paths") {
    const CausticScene caustic = testing::sphere_caustic(1e-5F);
    GuidedSettings settings = small_cache(LobeKind::slope, 1);
    settings.light_path_per = std::nullopt;
    const testing::CheckedPicture guided = render_guided(caustic, {.spp = 512}, settings);
    testing::check_clean(guided);
    check_same_mean(guided, render_bdpt(caustic, {.spp = 512}), "mirror");
}

TEST_CASE("caustics agree with quadrature over the reflector") {
    for (const float alpha : {0.005F, 0.02F, 0.1F}) {
        for (const CausticScene& caustic :
             {testing::sphere_caustic(alpha), testing::bumpy_plane_caustic(alpha), testing::ring_caustic(alpha)}) {
            for (const Vec3& x : caustic.floor_points) {
                for (const LobeKind lobe : both_lobes) {
                    GuidedSettings settings = small_cache(lobe, 1);
                    settings.cached_points = 16;
                    const bool slope = lobe == LobeKind::slope;
                    testing::check_caustic_at(caustic, x, settings, slope ? 128 : 512,
                                              "alpha " + std::to_string(alpha) + name_of(lobe), slope ? 0.01 : 0.03);
                }
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
                                          small_cache(LobeKind::slope, 2));
        pictures.push_back(testing::render(integrator, prepared.context, 32, 32, 8, threads).rgb);
    }
    CHECK(pictures[0] == pictures[1]);
    CHECK(pictures[0] == pictures[2]);
}

// Photons carry the caustic's light, know what paths along them bring, and give lobes that cover them.
#include <doctest/doctest.h>

#include <cmath>
#include <random>
#include <tuple>

#include "core/casters.h"
#include "guiding/slope_path.h"
#include "integrators/guided/caustic_photons.h"
#include "integrators/guided/lobe_weight.h"
#include "integrators/guided/photon_coverage.h"
#include "integrators/guided/photon_lobes.h"
#include "integrators/guided/slope_cache.h"
#include "tests/caustic_scenes.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

struct TracedPhotons {
    explicit TracedPhotons(const testing::CausticScene& caustic, uint32_t count, uint32_t most_reflections)
        : prepared(caustic.scene, caustic.camera, 8, 8) {
        paths = prepare_paths(prepared.context, find_casters(caustic.scene), GuidedSettings());
        photons = trace_caustic_photons(prepared.context, paths, count, most_reflections);
    }
    testing::PreparedScene prepared;
    GuidedPaths paths;
    std::vector<CausticPhoton> photons;
};

/// For 400 points of a picture of 64 x 64 pixels.
MadeSlopeCache make_cache(const testing::CausticScene& caustic, const GuidedSettings& settings,
                          GuidedStatistics& statistics) {
    testing::PreparedScene prepared(caustic.scene, caustic.camera, 64, 64);
    GuidedPaths found =
        find_guided_paths(prepared.context, find_casters(caustic.scene),
                          choose_receivers(prepared.context, {64, 64, {0, 0, 64, 64}}, 400), settings, statistics);
    return make_slope_cache(prepared.context, found, {}, settings, statistics);
}

LandedPhoton from_to(const Vec3& x, const Vec3& y) {
    const float distance = glm::length(y - x);
    return {x, (y - x) / distance, distance, 1.0F};
}

}  // namespace

TEST_CASE("photons on the floor add up to the caustic's irradiance") {
    for (const testing::CausticScene& caustic : {testing::sphere_caustic(0.05F), testing::bumpy_plane_caustic(0.05F)}) {
        const TracedPhotons traced(caustic, 1U << 21, 1);
        for (const Vec3& centre : caustic.floor_points) {
            constexpr float half = 0.07F;
            double power = 0.0, squares = 0.0;
            for (const CausticPhoton& photon : traced.photons) {
                const Vec3 off = photon.at.position - centre;
                if (std::abs(off.x) > half || std::abs(off.z) > half || std::abs(off.y) > 1e-3F) continue;
                power += double{photon.power};
                squares += double{photon.power} * double{photon.power};
            }
            constexpr double area = 4.0 * double{half} * double{half};
            double expected = 0.0;
            for (int i = 0; i < 25; ++i) {
                const Vec3 x =
                    centre + Vec3(0.028F * static_cast<float>(i % 5 - 2), 0.0F, 0.028F * static_cast<float>(i / 5 - 2));
                expected += testing::floor_radiance_parts(caustic, x).reflected / 25.0;
            }
            // The floor's albedo is .6. Metal and light are grey.
            const double irradiance = expected * 3.14159265 / 0.6, error = std::sqrt(squares) / area;
            INFO(caustic.name, ": ", power / area, " +- ", error, " against ", irradiance);
            CHECK(error < 0.05 * irradiance);
            CHECK(std::abs(power / area - irradiance) < 4.0 * error + 0.02 * irradiance);
        }
    }
}

TEST_CASE("a photon of one reflection knows the radiance along its way back") {
    const testing::CausticScene caustic = testing::sphere_caustic(0.05F);
    const TracedPhotons traced(caustic, 4096, 1);
    REQUIRE(traced.photons.size() > 500);
    for (const CausticPhoton& photon : traced.photons) {
        const float radiance =
            reflected_radiance(traced.prepared.context, photon.at, traced.paths.lights[0], photon.wi);
        // At a silhouette the way back may miss.
        if (radiance > 0.0F) CHECK(photon.radiance == doctest::Approx(radiance).epsilon(0.05));
    }
}

TEST_CASE("photons of two reflections land") {
    const TracedPhotons traced(testing::two_mirror_caustic(0.05F), 1U << 16, 3);
    size_t long_ones = 0;
    for (const CausticPhoton& photon : traced.photons) {
        CHECK(std::isfinite(photon.power));
        CHECK(photon.radiance > 0.0F);
        long_ones += photon.reflections > 1 ? 1 : 0;
    }
    CHECK(long_ones > 100);
}

TEST_CASE("points that are added where photons are covered worst leave fewer bright dots, round by round") {
    const testing::CausticScene caustic = testing::bumpy_plane_caustic(0.002F);
    std::vector<double> excess;
    for (const uint32_t refinements : {0U, 1U, 3U}) {
        GuidedSettings settings;
        settings.bounces = 1;
        settings.refinements = refinements;
        GuidedStatistics statistics;
        const MadeSlopeCache made = make_cache(caustic, settings, statistics);
        CHECK((statistics.added_points > 0) == (refinements > 0));
        const auto coverage = measure_coverage(made.cache, {}, made.photons);
        excess.push_back(poorly_covered(made.cache, made.photons, coverage, 1).excess);
    }
    INFO(excess[0], ", ", excess[1], ", ", excess[2]);
    CHECK(excess[1] < 0.7 * excess[0]);
    CHECK(excess[2] < 0.7 * excess[1]);
}

TEST_CASE("photon lobes have the spread of what they are fitted to") {
    std::mt19937 generator(3);
    std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
    for (const float scale : {1e-4F, 1.0F, 1e5F}) {
        // GGX's profile about the z axis, .01 and .03 wide.
        std::vector<LandedPhoton> photons;
        for (int i = 0; i < 400; ++i) {
            const float u = uniform(generator), turn = 6.2831853F * uniform(generator);
            const float radius = std::sqrt(u / (1.0F - u));
            photons.push_back(from_to(
                Vec3(0.0F), scale * Vec3(0.01F * radius * std::cos(turn), 0.03F * radius * std::sin(turn), 1.0F)));
        }
        const auto lobes = fit_photon_lobes(Vec3(0.0F), Vec3(0.0F, 0.0F, 1.0F), photons, 5.0F, 1e-4F * scale);
        REQUIRE(!lobes.empty());
        float weight = 0.0F;
        const CachedSlopeLobe<float>* heaviest = &lobes[0];
        for (const auto& lobe : lobes) {
            weight += lobe.weight;
            if (lobe.weight > heaviest->weight) heaviest = &lobe;
        }
        CHECK(weight == doctest::Approx(5.0F));
        const SlopeLobe<float> lobe = unmoved(*heaviest, Vec3(0.0F));
        CHECK(lobe.axis.z > 0.999F);
        // Clusters may share the tails: the area that the lobe covers, within a factor.
        const float area = 1.0F / lobe.determinant();
        CHECK(area > 0.2F * 3e-4F);
        CHECK(area < 3.0F * 3e-4F);
    }
}

TEST_CASE("photon lobes follow the receiver") {
    // A lamp far behind a mirror at x = 1, spread by .003: light comes from the same direction everywhere. A lamp at
    // that mirror: from the same point.
    std::mt19937 generator(5);
    std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
    std::normal_distribution<float> spread(0.0F, 0.003F);
    for (const float scale : {1e-4F, 1.0F, 1e5F}) {
        for (const bool far : {true, false}) {
            std::vector<LandedPhoton> photons;
            for (int i = 0; i < 60; ++i) {
                const Vec3 x(0.1F * uniform(generator), 0.1F * uniform(generator), 0.0F);
                const Vec3 source = far ? Vec3(100.0F, 0.0F, 60.0F) : Vec3(1.0F, 0.0F, 0.6F);
                const Vec3 towards = source - x;
                const Vec3 y =
                    x + towards / towards.x * (1.0F - x.x) + Vec3(0.0F, spread(generator), spread(generator));
                photons.push_back(from_to(scale * x, scale * y));
            }
            const auto lobes = fit_photon_lobes(Vec3(0.0F), Vec3(0.0F, 0.0F, 1.0F), photons, 1.0F, 0.2F * scale);
            REQUIRE(!lobes.empty());
            const Vec3 shifted(0.04F, -0.06F, 0.0F);
            const Vec3 expected = glm::normalize((far ? Vec3(100.0F, 0.0F, 60.0F) : Vec3(1.0F, 0.0F, 0.6F)) - shifted);
            float density = 0.0F;
            for (const CachedSlopeLobe<float>& cached : lobes) {
                const SlopeLobe<float> lobe = warped(cached, to_triple(scale * shifted), {}, SlopeWarp::newton);
                density += cached.weight * inv_pi * lobe.determinant() * relative_density(lobe, to_triple(expected));
            }
            // Ten times as wide as the light is; shifts unaccounted for would leave about 20.
            INFO("scale ", scale, ", far ", far, ", density ", density);
            CHECK(density > 400.0F);
        }
    }
}

TEST_CASE("photon lobes of degenerate photons") {
    const Vec3 x(1.0F, 2.0F, 3.0F), up(0.0F, 1.0F, 0.0F);
    const LandedPhoton one = from_to(x, x + up);
    const LandedPhoton nowhere{x, up, 0.0F, 1.0F};
    CHECK(fit_photon_lobes(x, up, std::vector<LandedPhoton>(), 1.0F, 0.1F).empty());
    CHECK(fit_photon_lobes(x, up, std::vector<LandedPhoton>(3, one), 1.0F, 0.1F).empty());
    CHECK(fit_photon_lobes(x, up, std::vector<LandedPhoton>(9, nowhere), 1.0F, 0.1F).empty());
    std::vector<LandedPhoton> line, row, behind(9, from_to(x, x - up));
    for (int i = 0; i < 20; ++i) {
        const Vec3 along(0.001F * static_cast<float>(i), 0.0F, 0.0F);
        line.push_back(from_to(x, x + up + along));
        row.push_back(from_to(x + along, x + up));
    }
    behind.push_back(one);
    for (const auto& photons : {std::vector<LandedPhoton>(9, one), line, row, behind}) {
        for (const auto& cached : fit_photon_lobes(x, up, photons, 1.0F, 0.01F)) {
            const SlopeLobe<float> lobe = unmoved(cached, x);
            CHECK(std::isfinite(lobe.determinant()));
            CHECK(lobe.determinant() > 0.0F);
            CHECK(cached.weight > 0.0F);
            CHECK(std::isfinite(cached.move1.x + cached.move1.y + cached.move2.x + cached.move2.y));
        }
    }
}

TEST_CASE("more long photons bring the same light") {
    const testing::CausticScene caustic = testing::ring_caustic(0.1F);
    constexpr uint32_t count = 1U << 19;
    const TracedPhotons even(caustic, count, 3);
    const auto long_power = [](const std::vector<CausticPhoton>& photons) {
        double sum = 0.0, squares = 0.0;
        size_t number = 0;
        for (const CausticPhoton& photon : photons) {
            if (photon.reflections < 2) continue;
            sum += double{photon.power};
            squares += double{photon.power} * double{photon.power};
            ++number;
        }
        return std::tuple(sum, squares, number);
    };
    std::vector<CausticPhoton> photons = even.photons;
    std::vector<uint32_t> useful;
    for (uint32_t i = 0; i < photons.size(); ++i) {
        // Those of a corner alone: starts are most uneven.
        if (photons[i].reflections > 1 && photons[i].at.position.x > 0.3F) useful.push_back(i);
    }
    REQUIRE(!useful.empty());
    const double enough = 2.0 * static_cast<double>(useful.size());
    add_long_photons(even.prepared.context, even.paths, useful, count, 3, enough, 4 * count, photons);
    const auto [before, squares_before, number_before] = long_power(even.photons);
    const auto [after, squares_after, number_after] = long_power(photons);
    INFO(before, " of ", number_before, ", ", after, " of ", number_after);
    CHECK(static_cast<double>(number_after - number_before) > 0.5 * enough);
    CHECK(std::abs(after - before) < 4.0 * std::sqrt(squares_before + squares_after));
    CHECK(std::sqrt(squares_after) < 0.05 * after);
    for (size_t i = even.photons.size(); i < photons.size(); ++i) CHECK(photons[i].reflections > 1);
}

TEST_CASE("the second moment of long paths is their own, in squared means of all light") {
    SlopeCache cache;
    cache.points.resize(1);
    cache.points[0].reach = 2.0F * reach_in_footprints;  // Of 4 m^2.
    std::vector<CausticPhoton> photons(3);
    photons[0].reflections = 1;
    photons[0].power = 7.0F;
    photons[0].radiance = 100.0F;
    photons[1].reflections = 2;
    photons[1].power = 1.0F;
    photons[1].radiance = 3.0F;
    photons[2].reflections = 3;
    photons[2].power = 5.0F;  // No point serves it.
    std::vector<PhotonCoverage> coverage(3);
    coverage[0] = {0, 0.0F, inv_pi};
    coverage[1] = {0, 0.0F, inv_pi};
    // A sample of the long photon is worth 3 / (half of the BSDF's 1 / pi) = 6 pi, in means of (7 + 1) / 4 by shares of
    // 1 / 8.
    CHECK(second_moment_of_long_paths(cache, photons, coverage) == doctest::Approx(6.0 * 3.14159265 / 2.0 / 8.0));
    coverage[1].guide_pdf = 3.0F * inv_pi;
    CHECK(second_moment_of_long_paths(cache, photons, coverage) == doctest::Approx(1.5 * 3.14159265 / 2.0 / 8.0));
    coverage[0].bsdf_pdf = coverage[1].bsdf_pdf = 0.0F;
    CHECK(second_moment_of_long_paths(cache, photons, coverage) == 0.0);
    CHECK(second_moment_of_long_paths(cache, {}, {}) == 0.0);
}

TEST_CASE("where long paths bring next to nothing, nothing is made for them") {
    const auto make = [](const testing::CausticScene& caustic, uint32_t bounces) {
        GuidedSettings settings;
        settings.bounces = bounces;
        GuidedStatistics statistics;
        const MadeSlopeCache made = make_cache(caustic, settings, statistics);
        return std::tuple(made.photons.size(), made.cache.lobes.size(), made.cache.leads_on);
    };
    const testing::CausticScene plane = testing::bumpy_plane_caustic(0.05F);
    CHECK(make(plane, 2) == make(plane, 1));
    CHECK(!std::get<bool>(make(plane, 2)));
    const testing::CausticScene ring = testing::ring_caustic(0.05F);
    CHECK(std::get<0>(make(ring, 2)) > std::get<0>(make(ring, 1)));
    CHECK(std::get<bool>(make(ring, 2)));
}

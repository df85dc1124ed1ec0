// Highlights: film positions have the density that is divided by, and pictures the right mean.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <random>
#include <span>

#include "guiding/film_guide.h"
#include "tests/guided_renders.h"
#include "tests/statistics.h"

using namespace nephroid;

namespace {

Camera camera_at(const Vec3& position, const Vec3& target, float yfov) {
    Camera camera;
    camera.yfov = yfov;
    camera.to_world = glm::inverse(glm::lookAt(position, target, Vec3(0.0F, 1.0F, 0.0F)));
    return camera;
}

/// A lobe of the given half axes, in pixels, that is seen at a film position.
FilmLobe lobe_at(const CameraRays& rays, const Vec2& film, float first, float second, float irradiance) {
    const Vec3 axis = to_vec3(rays.direction(film.x, film.y));
    const float pixel = glm::length(to_vec3(rays.direction(film.x + 1.0F, film.y)) - axis);
    const Frame<float> frame = make_frame(to_triple(axis));
    const SlopeLobe<float> lobe{to_triple(axis), frame.s * (1.0F / (first * pixel)),
                                frame.t * (1.0F / (second * pixel))};
    return {lobe, irradiance, 1.0F};
}

bool is_inside(const FilmGuide::Pixel& pixel, const Vec2& film) {
    return std::floor(film.x) == static_cast<float>(pixel.x) && std::floor(film.y) == static_cast<float>(pixel.y);
}

void check_density(const CameraRays& rays, const FilmGuide& guide, const FilmGuide::Pixel& pixel, const Vec3& focus) {
    const CameraProjection projection(rays);
    const auto sample = [&](Vec2 u, float u_choice) -> testing::DirectionDraw {
        const Vec2 film = guide.sample(pixel, u_choice, u.x, u.y);
        return {to_vec3(rays.direction(film.x, film.y)), is_inside(pixel, film)};
    };
    const auto pdf = [&](const Vec3& direction) -> double {
        const CameraView<float> view = projection.view_along(to_triple(direction));
        const Vec2 film(view.x, view.y);
        if (!(view.depth > 0.0F) || !is_inside(pixel, film)) return 0.0;
        return double{guide.pdf(pixel, film)} * double{view.pixel_density};
    };
    const testing::ChiSquareResult result = testing::chi_square_directions(sample, pdf, focus, 1e-6);
    INFO("pixel ", pixel.x, ", ", pixel.y, ": ", result.worst_bin);
    CHECK(result.p_value > testing::sidak(0.01, 8));
    CHECK(result.integral == doctest::Approx(result.sampled_share).epsilon(0.01));
}

}  // namespace

TEST_CASE("film positions follow their density") {
    const CameraRays rays = make_camera_rays(camera_at({0.0F, 1.0F, 4.0F}, Vec3(0.0F), 0.6F), 64, 48);
    SUBCASE("inside a pixel") {
        const FilmLobe lobe = lobe_at(rays, {20.3F, 31.6F}, 0.01F, 0.02F, 1e-3F);
        const FilmGuide guide(rays, std::span(&lobe, 1));
        REQUIRE(guide.pixels().size() == 1);
        CHECK(guide.pixels()[0].x == 20);
        CHECK(guide.pixels()[0].y == 31);
        check_density(rays, guide, guide.pixels()[0], to_vec3(lobe.lobe.axis));
    }
    SUBCASE("two lobes") {
        const std::array<FilmLobe, 2> lobes{lobe_at(rays, {20.7F, 31.6F}, 0.03F, 0.03F, 1e-3F),
                                            lobe_at(rays, {20.5F, 31.2F}, 0.005F, 0.01F, 3e-3F)};
        const FilmGuide guide(rays, lobes);
        REQUIRE(guide.pixels().size() == 1);
        check_density(rays, guide, guide.pixels()[0], to_vec3(lobes[1].lobe.axis));
    }
}

TEST_CASE("a lobe across pixels measures each pixel's area") {
    const CameraRays rays = make_camera_rays(camera_at({0.0F, 1.0F, 4.0F}, Vec3(0.0F), 0.6F), 64, 48);
    const FilmLobe lobe = lobe_at(rays, {20.02F, 31.6F}, 0.05F, 0.05F, 1e-3F);
    const FilmGuide guide(rays, std::span(&lobe, 1));
    CHECK(guide.pixels().size() == 2);
    std::mt19937 generator(1);
    std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
    for (const FilmGuide::Pixel& pixel : guide.pixels()) {
        constexpr int draws = 200000;
        // The area, and the first moment along x: as far as the positions inside are right too.
        double sum = 0.0, squares = 0.0, x_sum = 0.0, x_squares = 0.0;
        for (int i = 0; i < draws; ++i) {
            const float choice = uniform(generator), u = uniform(generator), v = uniform(generator);
            const FilmGuide::Position position = guide.sample_inside(pixel, choice, u, v, uniform(generator));
            if (!(position.weight > 0.0F)) continue;
            CHECK(is_inside(pixel, position.film));
            const auto weight = double{position.weight};
            sum += weight;
            squares += weight * weight;
            const double x = weight * (double{position.film.x} - pixel.x);
            x_sum += x;
            x_squares += x * x;
        }
        const double mean = sum / draws, error = std::sqrt((squares / draws - mean * mean) / draws);
        INFO("pixel ", pixel.x, ", ", pixel.y, ": ", mean, " +- ", error, ", x ", x_sum / draws);
        CHECK(std::abs(mean - 1.0) < 4.0 * error);
        const double x_mean = x_sum / draws;
        CHECK(std::abs(x_mean - 0.5) < 4.0 * std::sqrt((x_squares / draws - x_mean * x_mean) / draws));
    }
}

TEST_CASE("wide highlights and those behind the camera are left alone") {
    const CameraRays rays = make_camera_rays(camera_at({0.0F, 1.0F, 4.0F}, Vec3(0.0F), 0.6F), 64, 48);
    const FilmLobe wide = lobe_at(rays, {20.3F, 31.6F}, 6.0F, 6.0F, 1e-3F);
    CHECK(FilmGuide(rays, std::span(&wide, 1)).empty());
    FilmLobe behind = lobe_at(rays, {20.3F, 31.6F}, 0.01F, 0.01F, 1e-3F);
    behind.lobe.axis = -behind.lobe.axis;
    CHECK(FilmGuide(rays, std::span(&behind, 1)).empty());
    CHECK(FilmGuide().empty());
}

TEST_CASE("further positions go where one of them deviates most") {
    const CameraRays rays = make_camera_rays(camera_at({0.0F, 1.0F, 4.0F}, Vec3(0.0F), 0.6F), 64, 48);
    const FilmLobe lobes[] = {lobe_at(rays, {20.5F, 31.5F}, 0.01F, 0.01F, 1e-3F),
                              lobe_at(rays, {40.5F, 12.5F}, 0.01F, 0.01F, 1e-3F)};
    FilmGuide guide(rays, lobes);
    REQUIRE(guide.pixels().size() == 2);
    CHECK(guide.pixels()[0].positions == 1);
    const std::array<float, 2> deviations{3.0F, 1.0F};
    guide.add_positions(100.0, deviations);
    CHECK(guide.pixels()[0].positions == 76);
    CHECK(guide.pixels()[1].positions == 26);
    guide.add_positions(1e9, deviations);
    CHECK(guide.pixels()[0].positions == 1024);
    guide.add_positions(0.0, deviations);
    CHECK(guide.pixels()[0].positions == 1);
    guide.add_positions(100.0, std::array<float, 2>{});
    CHECK(guide.pixels()[0].positions == 1);
}

TEST_CASE("a guided highlight has the brightness that path tracing finds") {
    testing::CausticScene caustic = testing::sphere_caustic(0.1F);
    caustic.camera = camera_at({1.5F, 2.5F, 2.5F}, {0.0F, 0.5F, 0.0F}, 0.9F);
    testing::RenderSize size;
    size.max_depth = 2;
    GuidedSettings settings;
    settings.cached_points = 200;
    size.spp = 2048;
    const testing::CheckedPicture guided = testing::render_guided(caustic, size, settings);
    size.spp = 32768;
    const testing::CheckedPicture path = testing::render_path(caustic, size);
    testing::check_clean(guided);
    testing::check_same_mean(guided, path, "highlight");
    const auto brightest = [](const testing::Picture& picture) {
        return std::max_element(picture.rgb.begin(), picture.rgb.end()) - picture.rgb.begin();
    };
    const auto pixel = static_cast<size_t>(brightest(path));
    CHECK(brightest(guided) == brightest(path));
    // One pixel outshines all others: the variance of one sample of it.
    const size_t green = pixel - pixel % 3 + 1;
    CHECK(2048.0F * guided.variance[green] < 0.01F * 32768.0F * path.variance[green]);
}

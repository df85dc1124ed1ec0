// The guided integrator, rendered whole, where its input is extreme: roughness, scale, grazing light, broken meshes.
#include <doctest/doctest.h>

#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "core/mesh_attributes.h"
#include "tests/guided_renders.h"

using namespace nephroid;
using testing::CausticScene;
using testing::CheckedPicture;
using testing::RenderSize;

namespace {

constexpr std::array<float, 6> all_alphas{1e-4F, 1e-3F, 1e-2F, 0.05F, 0.1F, 0.2F};
constexpr std::array<float, 4> extreme_scales{1e-4F, 1e-2F, 1e2F, 1e5F};

/// For one point of the floor.
GuidedSettings settings_at_a_point(GuidedSettings settings = GuidedSettings()) {
    settings.bounces = 1;
    settings.cached_points = 16;
    return settings;
}

GuidedSettings settings_for_a_picture(int bounces) {
    GuidedSettings settings;
    settings.bounces = bounces;
    settings.cached_points = 150;
    return settings;
}

std::string described(const std::string& what, float value) {
    char text[64];
    std::snprintf(text, sizeof text, "%.30s %g", what.c_str(), double{value});
    return text;
}

std::vector<CausticScene> quadrature_scenes(float alpha) {
    return {testing::sphere_caustic(alpha), testing::bumpy_plane_caustic(alpha, 16), testing::ring_caustic(alpha)};
}

/// A small picture of everything that the camera sees, metal included, with long paths.
CheckedPicture render_whole(const CausticScene& caustic, const GuidedSettings& settings) {
    const RenderSize size{.width = 24, .height = 16, .spp = 32, .max_depth = 6};
    const CheckedPicture picture = testing::render_guided(caustic, size, settings);
    testing::check_clean(picture);
    return picture;
}

Mesh& metal_mesh(CausticScene& caustic) {
    return caustic.scene.meshes.back();
}

/// Triangles of no area: corners that coincide, and three on a line.
void add_degenerate_triangles(Mesh& mesh) {
    const size_t count = mesh.triangles.size();
    for (size_t i = 0; i < count; i += 7) {
        const auto [a, b, c] = mesh.triangles[i];
        const auto middle = static_cast<uint32_t>(mesh.positions.size());
        mesh.positions.push_back(0.5F * (mesh.positions[a] + mesh.positions[b]));
        mesh.normals.push_back(glm::normalize(mesh.normals[a] + mesh.normals[b]));
        for (const Triangle& triangle : {Triangle{a, a, a}, {a, a, b}, {a, b, b}, {a, middle, b}, {b, middle, a}}) {
            mesh.triangles.push_back(triangle);
        }
    }
    mesh.positions.reserve(mesh.positions.size() + 1);
}

/// Splits triangles at a point this share of their height above an edge: one of the three parts is a sliver.
void add_slivers(Mesh& mesh, float height) {
    const size_t count = mesh.triangles.size();
    for (size_t i = 0; i < count; i += 3) {
        const auto [a, b, c] = mesh.triangles[i];
        const auto split = static_cast<uint32_t>(mesh.positions.size());
        const auto at = [&, a = a, b = b, c = c](const std::vector<Vec3>& values) {
            return 0.5F * (1.0F - height) * (values[a] + values[b]) + height * values[c];
        };
        const Vec3 position = at(mesh.positions), normal = glm::normalize(at(mesh.normals));
        mesh.positions.push_back(position);
        mesh.normals.push_back(normal);
        mesh.triangles[i] = {a, b, split};
        mesh.triangles.push_back({b, c, split});
        mesh.triangles.push_back({c, a, split});
    }
    mesh.positions.reserve(mesh.positions.size() + 1);
}

}  // namespace

TEST_CASE("guided: caustics of any roughness agree with quadrature") {
    for (const float alpha : all_alphas) {
        // Too rough for a caster: path traced, which takes more samples.
        const bool guided = alpha <= max_caster_alpha;
        for (const CausticScene& caustic : quadrature_scenes(alpha)) {
            for (const Vec3& x : caustic.floor_points) {
                testing::check_caustic_at(caustic, x, settings_at_a_point(), guided ? 128 : 2048,
                                          described("alpha", alpha));
                if (!guided) break;
            }
        }
    }
}

TEST_CASE("guided: caustics of any scale agree with quadrature") {
    for (const float alpha : {1e-4F, 0.005F}) {
        for (const float scale : extreme_scales) {
            for (const CausticScene& at_one : quadrature_scenes(alpha)) {
                const CausticScene caustic = testing::scaled(at_one, scale);
                testing::check_caustic_at(caustic, caustic.floor_points.front(), settings_at_a_point(), 128,
                                          described("alpha", alpha));
            }
        }
    }
}

TEST_CASE("guided, preset=paper: caustics of any roughness and scale agree with quadrature") {
    const auto check = [](const CausticScene& caustic, float alpha, uint32_t spp) {
        testing::check_caustic_at(caustic, caustic.floor_points.front(), settings_at_a_point(paper_settings()), spp,
                                  described("paper, alpha", alpha));
    };
    check(testing::sphere_caustic(1e-4F), 1e-4F, 512);
    for (const float alpha : {1e-4F, 1e-2F, 0.1F}) {
        check(testing::bumpy_plane_caustic(alpha, 16), alpha, alpha > 0.05F ? 128 : 768);
    }
    for (const float scale : {1e-4F, 1e5F}) check(testing::scaled(testing::ring_caustic(0.01F), scale), 0.01F, 256);
}

TEST_CASE("guided: every pixel is finite and not negative, whatever the roughness and the scale") {
    for (const float alpha : all_alphas) {
        for (const CausticScene& caustic : testing::all_caustic_scenes(alpha)) {
            INFO(caustic.name, ", alpha ", alpha);
            const bool guided = render_whole(caustic, settings_for_a_picture(caustic.reflections)).guided;
            CHECK((guided || alpha > max_caster_alpha));
        }
    }
    for (const float scale : extreme_scales) {
        for (const CausticScene& caustic : testing::all_caustic_scenes(scale < 1.0F ? 1e-4F : 5e-3F)) {
            INFO(caustic.name, ", scale ", scale);
            CHECK(render_whole(testing::scaled(caustic, scale), settings_for_a_picture(2)).guided);
        }
    }
    GuidedSettings paper = paper_settings();
    paper.cached_points = 50;
    paper.bounces = 1;
    for (const float scale : {1e-4F, 1.0F, 1e5F}) {
        const float alpha = scale > 1.0F ? 5e-3F : 1e-4F;
        INFO("paper, scale ", scale);
        CHECK(render_whole(testing::scaled(testing::mirror_view_caustic(alpha), scale), paper).guided);
        CHECK(render_whole(testing::scaled(testing::ring_caustic(alpha), scale), paper).guided);
    }
}

TEST_CASE("guided: pictures of two reflections do not depend on the scale") {
    for (const float alpha : {1e-4F, 0.005F}) {
        const auto render = [alpha](float scale, uint32_t seed) {
            CausticScene caustic = testing::scaled(testing::two_mirror_caustic(alpha), scale);
            const Vec3 x = scale * Vec3(-0.1F, 0.0F, 0.05F);
            // Below the upper mirror, which would be in the way.
            caustic.camera = testing::look_at(x + scale * Vec3(-0.1F, 0.8F, 0.2F), x, 0.3F);
            const CheckedPicture picture =
                testing::render_guided(caustic, {.spp = 128, .max_depth = 3, .seed = seed}, settings_for_a_picture(2));
            testing::check_clean(picture);
            return picture;
        };
        const CheckedPicture at_one = render(1.0F, 1);
        for (const float scale : extreme_scales) {
            testing::check_same_mean(render(scale, 2), at_one, described("scale", scale));
        }
    }
}

TEST_CASE("guided: triangles without area and slivers among the casters' do not matter") {
    for (const float alpha : {1e-4F, 0.01F}) {
        for (CausticScene caustic : quadrature_scenes(alpha)) {
            add_slivers(metal_mesh(caustic), 1e-4F);
            add_slivers(metal_mesh(caustic), 1e-7F);
            add_degenerate_triangles(metal_mesh(caustic));
            testing::check_caustic_at(caustic, caustic.floor_points.front(), settings_at_a_point(), 128,
                                      described("degenerate, alpha", alpha));
            CHECK(render_whole(caustic, settings_for_a_picture(2)).guided);
        }
    }
}

TEST_CASE("guided: normals that are zero, missing, turned over or across") {
    const auto damage = [](Mesh& mesh, int kind) {
        for (size_t i = 0; i < mesh.normals.size(); i += 3) {
            if (kind == 0) mesh.normals[i] = Vec3(0.0F);
            if (kind == 1) mesh.normals[i] = -mesh.normals[i];
            if (kind == 2) mesh.normals[i] = glm::cross(mesh.normals[i], Vec3(0.36F, 0.48F, 0.8F));
        }
        if (kind == 3) mesh.normals.clear();
        // As the loader does.
        CHECK((normalize_normals(mesh) > 0) == (kind == 0));
    };
    for (const float alpha : {1e-4F, 0.05F}) {
        for (const int kind : {0, 1, 2, 3}) {
            for (CausticScene caustic : quadrature_scenes(alpha)) {
                damage(metal_mesh(caustic), kind);
                INFO(caustic.name, ", alpha ", alpha, ", kind ", kind);
                // Few points: where normals turn over, every triangle has paths of its own.
                GuidedSettings settings = settings_for_a_picture(1);
                settings.cached_points = 10;
                render_whole(caustic, settings);
            }
        }
    }
}

TEST_CASE("guided: grazing light") {
    for (const float alpha : {1e-4F, 0.01F}) {
        for (const float distance : {0.05F, 0.0F, -0.05F}) {
            CausticScene caustic = testing::bumpy_plane_caustic(alpha, 16);
            caustic.scene.lights[0].position = Vec3(0.8F - distance, 2.0F, 0.0F);
            INFO("alpha ", alpha, ", distance ", distance);
            render_whole(caustic, settings_for_a_picture(2));
        }
    }
    // Almost along the wall, whose waves are steeper than the light's angle: half of them are dark.
    for (const float alpha : {1e-3F, 0.02F}) {
        CausticScene caustic = testing::bumpy_plane_caustic(alpha, 16);
        caustic.scene.lights[0].position = Vec3(0.75F, 2.0F, 0.0F);
        for (const float x : {0.64F, 0.67F, 0.73F}) {
            testing::check_caustic_at(caustic, Vec3(x, 0.0F, 0.02F), settings_at_a_point(), 256,
                                      described("grazing, alpha", alpha));
        }
    }
}

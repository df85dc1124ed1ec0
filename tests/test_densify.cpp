// Densification: finer triangles on the same surface.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "pathcut/densify.h"
#include "tests/gltf_builder.h"

using namespace nephroid;
using namespace nephroid::test;

namespace {

constexpr float pi_f = 3.14159265F;

/// A scene of one object, with everything that a mesh can carry.
Scene scene_of(Mesh mesh, float densify) {
    Scene scene;
    scene.file = "test.glb";
    scene.materials.emplace_back();
    scene.meshes.push_back(std::move(mesh));
    Object object;
    object.name = "thing";
    object.densify = densify;
    scene.objects.push_back(object);
    return scene;
}

/// A closed unit sphere with a seam of double vertices, poles of triangles without area, and all attributes.
Mesh sphere_mesh(uint32_t columns, uint32_t rows) {
    Mesh mesh;
    for (uint32_t j = 0; j <= rows; ++j) {
        for (uint32_t i = 0; i <= columns; ++i) {
            const float phi = 2.0F * pi_f * static_cast<float>(i % columns) / static_cast<float>(columns);
            const float theta = pi_f * static_cast<float>(j) / static_cast<float>(rows);
            const float sine = j == 0 || j == rows ? 0.0F : std::sin(theta);
            const Vec3 n(sine * std::cos(phi), sine * std::sin(phi), -std::cos(theta));
            mesh.positions.push_back(n);
            mesh.normals.push_back(n);
            mesh.uvs[0].emplace_back(static_cast<float>(i), static_cast<float>(j));
            mesh.tangents.emplace_back(-std::sin(phi), std::cos(phi), 0.0F, -1.0F);
            mesh.colors.emplace_back(n.z, n.x, n.y, 1.0F);
        }
    }
    for (uint32_t j = 0; j < rows; ++j) {
        for (uint32_t i = 0; i < columns; ++i) {
            const uint32_t a = j * (columns + 1) + i, b = a + 1, c = a + columns + 1, d = c + 1;
            if (j > 0) mesh.triangles.push_back({a, b, d});
            if (j + 1 < rows) mesh.triangles.push_back({a, d, c});
        }
    }
    return mesh;
}

double longest_edge(const Mesh& mesh, const Mat4& to_world = Mat4(1.0F)) {
    double longest = 0.0;
    const glm::dmat3 linear{Mat3(to_world)};
    for (const Triangle& t : mesh.triangles) {
        for (size_t k = 0; k < 3; ++k) {
            const Vec3d edge = Vec3d(mesh.positions[t[k]]) - Vec3d(mesh.positions[t[(k + 1) % 3]]);
            longest = std::max(longest, glm::length(linear * edge));
        }
    }
    return longest;
}

Vec3d area_vector(const Mesh& mesh, const Triangle& t) {
    const Vec3d origin(mesh.positions[t[0]]);
    return 0.5 * glm::cross(Vec3d(mesh.positions[t[1]]) - origin, Vec3d(mesh.positions[t[2]]) - origin);
}

double area_of(const Mesh& mesh) {
    double area = 0.0;
    for (const Triangle& t : mesh.triangles) area += glm::length(area_vector(mesh, t));
    return area;
}

double volume_of(const Mesh& mesh) {
    double volume = 0.0;
    for (const Triangle& t : mesh.triangles) {
        volume += glm::dot(area_vector(mesh, t), Vec3d(mesh.positions[t[0]])) / 3.0;
    }
    return volume;
}

using Point = std::array<float, 3>;

Point point_of(const Mesh& mesh, uint32_t vertex) {
    const Vec3& p = mesh.positions[vertex];
    return {p.x + 0.0F, p.y + 0.0F, p.z + 0.0F};  // No negative zeros.
}

/// Edges by the positions of their ends, with the number of triangles that walk along them one way minus the other, and
/// in all. Triangles of fewer than three positions do not count.
std::map<std::pair<Point, Point>, std::array<int, 2>> edges_of(const Mesh& mesh) {
    std::map<std::pair<Point, Point>, std::array<int, 2>> edges;
    for (const Triangle& t : mesh.triangles) {
        const std::array points{point_of(mesh, t[0]), point_of(mesh, t[1]), point_of(mesh, t[2])};
        if (points[0] == points[1] || points[1] == points[2] || points[2] == points[0]) continue;
        for (size_t k = 0; k < 3; ++k) {
            const Point &from = points[k], &to = points[(k + 1) % 3];
            std::array<int, 2>& entry = edges[{std::min(from, to), std::max(from, to)}];
            entry[0] += from < to ? 1 : -1;
            ++entry[1];
        }
    }
    return edges;
}

void check_closed(const Mesh& mesh) {
    size_t open = 0;
    for (const auto& [ends, count] : edges_of(mesh)) open += count != std::array{0, 2};
    CHECK(open == 0);
}

void check_sizes(const Mesh& mesh) {
    const size_t count = mesh.positions.size();
    for (const size_t size :
         {mesh.normals.size(), mesh.uvs[0].size(), mesh.uvs[1].size(), mesh.tangents.size(), mesh.colors.size()}) {
        CHECK((size == 0 || size == count));
    }
    CHECK(mesh.positions.capacity() > count);
    CHECK(std::all_of(mesh.triangles.begin(), mesh.triangles.end(),
                      [&](const Triangle& t) { return *std::max_element(t.begin(), t.end()) < count; }));
}

std::string error_of(Scene scene) {
    try {
        densify_objects(scene);
    } catch (const Error& error) {
        CHECK(error.code() == ExitCode::invalid_input);
        return error.what();
    }
    return "";
}

Mesh single_triangle() {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    return mesh;
}

}  // namespace

TEST_CASE("a closed sphere with seams stays closed, and its surface the same") {
    for (const float target : {0.5F, 0.2F, 0.03F}) {
        const Mesh coarse = sphere_mesh(12, 7);
        Scene scene = scene_of(coarse, target);
        densify_objects(scene);
        const Mesh& fine = scene.meshes[0];
        CHECK(longest_edge(fine) <= target);
        CHECK(fine.coarse_triangles == coarse.triangles.size());
        CHECK(area_of(fine) == doctest::Approx(area_of(coarse)).epsilon(1e-6));
        CHECK(volume_of(fine) == doctest::Approx(volume_of(coarse)).epsilon(1e-6));
        check_sizes(fine);
        check_closed(fine);
        CHECK(std::equal(coarse.positions.begin(), coarse.positions.end(), fine.positions.begin()));
        CHECK(std::equal(coarse.uvs[0].begin(), coarse.uvs[0].end(), fine.uvs[0].begin()));
        for (const Vec3& normal : fine.normals) CHECK(glm::length(normal) == doctest::Approx(1.0F));
        for (const Vec4& tangent : fine.tangents) {
            CHECK(glm::length(Vec3(tangent)) == doctest::Approx(1.0F));
            CHECK(tangent.w == -1.0F);
        }
        // Not far above what the area needs at least.
        const double least = area_of(fine) / (0.433 * target * target);
        MESSAGE("edges of " << target << " m: " << fine.triangles.size() << " triangles, " << least << " at least");
        CHECK(static_cast<double>(fine.triangles.size()) < 6.0 * least + 500.0);
    }
}

TEST_CASE("attributes at new vertices are those of the coarse triangle") {
    Mesh mesh = single_triangle();
    mesh.normals = {{0, 0, 1}, {0.6F, 0, 0.8F}, {0, -0.8F, 0.6F}};
    mesh.uvs[0] = {{0, 0}, {4, 0}, {0, 8}};
    mesh.uvs[1] = {{1, 1}, {2, 1}, {1, 3}};
    mesh.colors = {{1, 0, 0, 1}, {0, 1, 0, 0.5F}, {0, 0, 1, 0}};
    mesh.tangents = {{1, 0, 0, 1}, {0.8F, 0, -0.6F, 1}, {1, 0, 0, 1}};
    const Mesh coarse = mesh;
    Scene scene = scene_of(std::move(mesh), 0.11F);
    densify_objects(scene);
    const Mesh& fine = scene.meshes[0];
    REQUIRE(fine.triangles.size() > 100);
    check_sizes(fine);
    for (size_t i = 0; i < fine.positions.size(); ++i) {
        const float b1 = fine.positions[i].x, b2 = fine.positions[i].y, b0 = 1.0F - b1 - b2;
        const auto mix = [&](const auto& values) { return values[0] * b0 + values[1] * b1 + values[2] * b2; };
        check_vec(fine.normals[i], glm::normalize(mix(coarse.normals)));
        check_vec(Vec3(fine.tangents[i]), glm::normalize(Vec3(mix(coarse.tangents))));
        CHECK(fine.tangents[i].w == 1.0F);
        check_vec(Vec3(fine.uvs[0][i], 0.0F), Vec3(mix(coarse.uvs[0]), 0.0F));
        check_vec(Vec3(fine.uvs[1][i], 0.0F), Vec3(mix(coarse.uvs[1]), 0.0F));
        check_vec(Vec3(fine.colors[i]), Vec3(mix(coarse.colors)));
        CHECK(fine.colors[i].w == doctest::Approx(mix(coarse.colors).w));
    }
}

TEST_CASE("opposite attributes give unit vectors all the same") {
    Mesh mesh = single_triangle();
    mesh.normals = {{0, 0, 1}, {0, 0, -1}, {0, 0, 1}};
    mesh.tangents = {{1, 0, 0, 1}, {-1, 0, 0, 1}, {1, 0, 0, -1}};
    Scene scene = scene_of(std::move(mesh), 0.2F);
    densify_objects(scene);
    for (const Vec3& normal : scene.meshes[0].normals) CHECK(glm::length(normal) == doctest::Approx(1.0F));
    for (const Vec4& tangent : scene.meshes[0].tangents) {
        CHECK(glm::length(Vec3(tangent)) == doctest::Approx(1.0F));
        CHECK(std::abs(tangent.w) == 1.0F);
    }
}

TEST_CASE("a soup of triangles keeps meeting along its edges, however many meet there and whichever way they wind") {
    // Each triangle has vertices of its own; four random fans share the same edges.
    std::mt19937 generator(1);
    std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
    Mesh mesh;
    const auto add = [&mesh](const Vec3& a, const Vec3& b, const Vec3& c) {
        const auto first = static_cast<uint32_t>(mesh.positions.size());
        mesh.positions.insert(mesh.positions.end(), {a, b, c});
        mesh.triangles.push_back({first, first + 1, first + 2});
    };
    for (int edge = 0; edge < 20; ++edge) {
        const Vec3 a(uniform(generator), uniform(generator), uniform(generator));
        const Vec3 b(uniform(generator), uniform(generator), uniform(generator));
        for (int k = 0; k < 5; ++k) {
            const Vec3 c(uniform(generator), uniform(generator), uniform(generator));
            k % 2 == 0 ? add(a, b, c) : add(c, b, a);
        }
    }
    const auto before = edges_of(mesh);
    const double area = area_of(mesh);
    Scene scene = scene_of(std::move(mesh), 0.07F);
    densify_objects(scene);
    CHECK(longest_edge(scene.meshes[0]) <= 0.07F);
    CHECK(area_of(scene.meshes[0]) == doctest::Approx(area).epsilon(1e-5));
    // Every piece of a shared edge is shared by as many as the edge was; all others are inside of a triangle, or
    // border.
    size_t pieces_of_five = 0, others = 0;
    double length_of_five = 0.0, length_before = 0.0;
    const auto length = [](const std::pair<Point, Point>& e) {
        return std::hypot(e.first[0] - e.second[0], e.first[1] - e.second[1], e.first[2] - e.second[2]);
    };
    for (const auto& [ends, count] : edges_of(scene.meshes[0])) {
        pieces_of_five += count[1] == 5;
        others += count[1] != 5 && count[1] != 2 && count[1] != 1;
        if (count[1] == 5) length_of_five += length(ends);
    }
    for (const auto& [ends, count] : before) {
        if (count[1] == 5) length_before += length(ends);
    }
    CHECK(pieces_of_five > 100);
    CHECK(others == 0);
    CHECK(length_of_five == doctest::Approx(length_before).epsilon(1e-5));
}

TEST_CASE("splinters and triangles without area take far fewer triangles than fat ones of their length") {
    Mesh mesh;
    size_t most = 20000;  // A fat triangle of 1000 edge lengths takes about a million.
    SUBCASE("a needle") {
        mesh.positions = {{0, 0, 0}, {0.001F, 0, 0}, {0, 100, 0}};
        most = 2100;
    }
    SUBCASE("a doubled corner") {
        mesh.positions = {{0, 0, 0}, {0, 0, 0}, {0, 100, 0}};
        most = 2100;
    }
    SUBCASE("a flat cap") {
        mesh.positions = {{0, 0, 0}, {30, 0.001F, 0}, {100, 0, 0}};
    }
    SUBCASE("three on a line") {
        mesh.positions = {{0, 0, 0}, {0, 33, 0}, {0, 100, 0}};
    }
    mesh.triangles = {{0, 1, 2}};
    Scene scene = scene_of(std::move(mesh), 0.1F);
    densify_objects(scene);
    CHECK(longest_edge(scene.meshes[0]) <= 0.1F);
    MESSAGE(scene.meshes[0].triangles.size() << " triangles for 1000 edge lengths");
    CHECK(scene.meshes[0].triangles.size() < most);
}

TEST_CASE("edge lengths are those in world space") {
    Scene scene = scene_of(single_triangle(), 0.5F);
    Mat4& to_world = scene.objects[0].to_world;
    SUBCASE("enlarged, moved, sheared") {
        to_world = Mat4(10.0F, 0, 0, 0, 3.0F, -2.0F, 0, 0, 0, 0, 1.0F, 0, 5.0F, 6.0F, 7.0F, 1.0F);
        densify_objects(scene);
        CHECK(longest_edge(scene.meshes[0], to_world) <= 0.5);
        CHECK(scene.meshes[0].triangles.size() > 100);
    }
    SUBCASE("made small: nothing to do") {
        to_world = Mat4(0.1F, 0, 0, 0, 0, 0.1F, 0, 0, 0, 0, 0.1F, 0, 0, 0, 0, 1.0F);
        densify_objects(scene);
        CHECK(scene.meshes[0].triangles.size() == 1);
        CHECK(scene.meshes[0].coarse_triangles == 0);
    }
    SUBCASE("extremes of scale") {
        for (const float scale : {1e-4F, 1e5F}) {
            Scene other = scene_of(single_triangle(), 0.1F * scale);
            for (Vec3& p : other.meshes[0].positions) p *= scale;
            densify_objects(other);
            CHECK(longest_edge(other.meshes[0]) <= 0.1 * scale);
            CHECK(area_of(other.meshes[0]) == doctest::Approx(0.5 * scale * scale).epsilon(1e-6));
        }
    }
}

TEST_CASE("objects that share a mesh keep sharing it; the strictest wish along each edge counts") {
    Scene scene = scene_of(single_triangle(), 0.0F);
    Object wide = scene.objects[0], high = scene.objects[0];
    wide.densify = high.densify = 0.5F;
    wide.to_world[0][0] = 8.0F;
    high.to_world[1][1] = 8.0F;
    scene.objects.push_back(wide);
    scene.objects.push_back(high);
    densify_objects(scene);
    REQUIRE(scene.meshes.size() == 1);
    for (const Object& object : scene.objects) CHECK(object.mesh == 0);
    CHECK(longest_edge(scene.meshes[0], wide.to_world) <= 0.5);
    CHECK(longest_edge(scene.meshes[0], high.to_world) <= 0.5);
}

TEST_CASE("no wish, no change") {
    const Mesh coarse = sphere_mesh(12, 7);
    Scene scene = scene_of(coarse, 0.0F);
    densify_objects(scene);
    CHECK(scene.meshes[0].triangles == coarse.triangles);
    CHECK(scene.meshes[0].positions == coarse.positions);
    CHECK(scene.meshes[0].normals == coarse.normals);
    CHECK(scene.meshes[0].coarse_triangles == 0);
}

TEST_CASE("edges that float cannot divide and positions that are no numbers end the splitting") {
    Mesh mesh = single_triangle();
    SUBCASE("far from the origin") {
        for (Vec3& p : mesh.positions) p = p * 64.0F + Vec3(1e8F, 0.0F, 0.0F);  // 8 m between floats.
    }
    SUBCASE("no numbers") {
        mesh.positions[1].x = std::numeric_limits<float>::quiet_NaN();
        mesh.positions[2].y = std::numeric_limits<float>::infinity();
    }
    Scene scene = scene_of(std::move(mesh), 0.5F);
    densify_objects(scene);
    CHECK(scene.meshes[0].triangles.size() < 100000);
}

TEST_CASE("absurd wishes are refused at once, naming the object") {
    CHECK(error_of(scene_of(single_triangle(), 1e-6F)) ==
          "test.glb: object thing: extras.densify = 1e-06 m adds more than 50 million triangles; choose a longer edge "
          "length");
    Scene scene = scene_of(single_triangle(), 1e-9F);
    scene.objects.push_back(scene.objects[0]);
    scene.objects[1].name = "other";
    scene.objects[1].densify = 1.0F;
    check_contains(error_of(scene), "object thing");
}

TEST_CASE("extras.densify is read, inherited and overridden") {
    GltfBuilder builder = triangle_builder();
    builder.json["nodes"][0]["extras"] = {{"densify", 0.25}};
    builder.add_node({{"mesh", 0}});
    builder.add_node({{"mesh", 0}, {"extras", {{"densify", 2}}}});
    builder.add_node({{"children", {0, 1}}, {"extras", {{"densify", 0.5}}}});
    Scene scene = load(builder);
    REQUIRE(scene.objects.size() == 3);
    std::vector<float> lengths;
    for (const Object& object : scene.objects) lengths.push_back(object.densify);
    std::sort(lengths.begin(), lengths.end());
    CHECK(lengths == std::vector{0.25F, 0.5F, 2.0F});
    densify_objects(scene);
    CHECK(longest_edge(scene.meshes.at(0)) <= 0.25);

    CHECK(load(triangle_builder()).objects.at(0).densify == 0.0F);
}

TEST_CASE("extras.densify that is no length is refused") {
    GltfBuilder builder = triangle_builder();
    for (const Json& value :
         {Json(0), Json(-0.1), Json("0.1"), Json(true), Json::array({0.1}), Json(1e-60), Json(1e30)}) {
        builder.json["nodes"][0]["extras"] = {{"densify", value}};
        INFO(value.dump());
        check_contains(load_error(builder), "node 0: extras.densify must be an edge length in metres");
    }
}

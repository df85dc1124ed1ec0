// Shadow rays along specular paths, against an exhaustive search in double precision and in scenes of known visibility.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include "core/rounding.h"
#include "pathcut/visibility.h"
#include "tests/pathcut_chains.h"
#include "tests/test_scenes.h"

using namespace nephroid;
using testing::Generator;
using testing::quad;
using testing::uniform;

namespace {

using Corners = std::array<Vec3d, 3>;

/// All triangles of a scene in world space, in double precision.
struct TriangleSoup {
    std::vector<Corners> triangles;
    std::vector<Vec3> transform_errors;  ///< Per triangle.

    explicit TriangleSoup(const Scene& scene) {
        for (const Object& object : scene.objects) {
            const glm::dmat4 to_world(object.to_world);
            for (const Triangle& t : scene.meshes[static_cast<size_t>(object.mesh)].triangles) {
                Corners corners;
                Vec3 error(0.0F);
                for (size_t k = 0; k < 3; ++k) {
                    const Vec3 p = scene.meshes[static_cast<size_t>(object.mesh)].positions[t[k]];
                    corners[k] = Vec3d(to_world * glm::dvec4(Vec3d(p), 1.0));
                    if (object.to_world == Mat4(1.0F)) continue;
                    for (int column = 0; column < 4; ++column) {
                        const float factor = column < 3 ? std::abs(p[column]) : 1.0F;
                        error += glm::abs(Vec3(object.to_world[column])) * factor;
                    }
                }
                triangles.push_back(corners);
                transform_errors.push_back(rounding_bound(8) * error);
            }
        }
    }
};

enum class Crossing : uint8_t { none, unclear, through };

/// How the open segment from a to b meets a triangle: `through` well inside of both, `unclear` close to either's edge.
Crossing crossing(const Corners& t, const Vec3d& a, const Vec3d& b) {
    const Vec3d e1 = t[1] - t[0], e2 = t[2] - t[0], d = b - a;
    const Vec3d p = glm::cross(d, e2);
    const double determinant = glm::dot(e1, p);
    const double u = glm::dot(a - t[0], p) / determinant;
    const Vec3d q = glm::cross(a - t[0], e1);
    const double v = glm::dot(d, q) / determinant, s = glm::dot(e2, q) / determinant;
    if (!std::isfinite(u + v + s)) return Crossing::none;
    const double inside = std::min({u, v, 1.0 - u - v}), between = std::min(s, 1.0 - s);
    if (inside < -1e-3 || between <= 1e-12) return Crossing::none;
    return inside > 1e-3 && between > 1e-2 ? Crossing::through : Crossing::unclear;
}

struct PathPoint {
    SurfacePoint surface;
    size_t triangle;
};

/// A point in a triangle, on one of its edges or at a corner.
PathPoint random_point(Generator& generator, const TriangleSoup& soup, size_t triangle) {
    const Corners& t = soup.triangles[triangle];
    std::array<double, 3> weights{uniform(generator, 0.01, 1.0), uniform(generator, 0.01, 1.0),
                                  uniform(generator, 0.01, 1.0)};
    const int place = static_cast<int>(uniform(generator, 0.0, 6.0));
    const auto corner = static_cast<size_t>(uniform(generator, 0.0, 3.0));
    if (place == 0) weights[corner] = 0.0;
    if (place == 1) weights[corner] = weights[(corner + 1) % 3] = 0.0;
    const double sum = weights[0] + weights[1] + weights[2];
    const Vec3d position = (t[0] * weights[0] + t[1] * weights[1] + t[2] * weights[2]) / sum;
    const Vec3 normal(glm::normalize(glm::cross(t[1] - t[0], t[2] - t[0])));
    const double extent = std::max({glm::length(t[0] - t[1]), glm::length(t[1] - t[2]), glm::length(t[2] - t[0])});
    return {surface_point(position, normal, extent, soup.transform_errors[triangle]), triangle};
}

/// Whether a point touches a triangle, its own or one that shares the edge or corner, measured by its size.
bool touches(const Corners& t, const Vec3d& p) {
    const Vec3d normal = glm::cross(t[1] - t[0], t[2] - t[0]);
    const double length = glm::length(normal), size = std::sqrt(length);
    if (std::abs(glm::dot(normal, p - t[0])) > 1e-6 * length * size) return false;
    double inside = 1.0;
    for (size_t k = 0; k < 3; ++k) {
        const Vec3d across = glm::cross(t[(k + 1) % 3] - t[k], p - t[k]);
        inside = std::min(inside, glm::dot(across, normal) / (length * length));
    }
    return inside > -1e-6;
}

/// The truth for one segment: none, unclear or through. Triangles that an end touches do not count, but a segment that
/// runs behind some of them and before others, or along one, is unclear.
Crossing segment_truth(const TriangleSoup& soup, const Vec3d& a, const Vec3d& b, bool b_is_surface) {
    Crossing truth = Crossing::none;
    int signs_a = 0, signs_b = 0;
    const Vec3d direction = glm::normalize(b - a);
    for (const Corners& t : soup.triangles) {
        const bool at_a = touches(t, a), at_b = b_is_surface && touches(t, b);
        if (at_a || at_b) {
            const Vec3d normal = glm::normalize(glm::cross(t[1] - t[0], t[2] - t[0]));
            const double cosine = glm::dot(normal, direction);
            (at_a ? signs_a : signs_b) |= std::abs(cosine) < 1e-3 ? 3 : cosine > 0.0 ? 1 : 2;
            continue;
        }
        truth = std::max(truth, crossing(t, a, b));
    }
    return signs_a == 3 || signs_b == 3 ? std::max(truth, Crossing::unclear) : truth;
}

struct Comparison {
    int clear = 0;
    int blocked = 0;
    int falsely_blocked = 0;
    int falsely_clear = 0;
    int wrong_segment = 0;
};

/// Random paths of one to three vertices through the scene's triangles; the last two triangles are the receivers'.
Comparison compare_with_truth(const Scene& scene, const Vec3d& centre, double scale, int paths) {
    const Accelerator accelerator(scene, 1);
    const TriangleSoup soup(scene);
    Generator generator(17);
    Comparison result;
    const size_t mirrors = soup.triangles.size() - 2;
    for (int n = 0; n < paths; ++n) {
        const auto length = static_cast<size_t>(uniform(generator, 1.0, 4.0));
        std::vector<PathPoint> points{random_point(generator, soup, mirrors + static_cast<size_t>(n % 2))};
        for (size_t i = 0; i < length; ++i) {
            const auto triangle = static_cast<size_t>(uniform(generator, 0.0, static_cast<double>(mirrors)));
            points.push_back(random_point(generator, soup, triangle));
        }
        const Vec3d light = centre + testing::random_point(generator, 3.0 * scale);

        // Up to the first segment, seen from the light, whose state is known for sure.
        std::vector<Crossing> truths;
        for (size_t i = 0; i <= length; ++i) {
            const Vec3d a = points[i].surface.position;
            truths.push_back(i == length ? segment_truth(soup, a, light, false)
                                         : segment_truth(soup, a, points[i + 1].surface.position, true));
        }
        Vec3 normal = points[0].surface.geometric_normal;
        if (glm::dot(Vec3d(normal), points[1].surface.position - points[0].surface.position) < 0.0) normal = -normal;
        points[0].surface.geometric_normal = normal;
        std::vector<SurfacePoint> vertices;
        for (size_t i = 1; i <= length; ++i) vertices.push_back(points[i].surface);
        const int blocked = first_blocked_segment(accelerator, {points[0].surface, vertices, {light}, 0.0});

        int expected = static_cast<int>(length);
        while (expected >= 0 && truths[static_cast<size_t>(expected)] == Crossing::none) --expected;
        if (expected >= 0 && truths[static_cast<size_t>(expected)] == Crossing::unclear) {
            result.wrong_segment += blocked > expected ? 1 : 0;
            continue;
        }
        (expected < 0 ? result.clear : result.blocked) += 1;
        if (blocked == expected) continue;
        (expected < 0 ? result.falsely_blocked : blocked < 0 ? result.falsely_clear : result.wrong_segment) += 1;
    }
    return result;
}

/// A coarse bowl and ball side by side over two triangles of floor, which come last.
Scene bowl_and_ball(const Vec3& centre, float scale) {
    Scene scene;
    scene.materials = {testing::metal(Rgb(1.0F), 0.01F), testing::lambert(Rgb(0.5F))};
    Mesh bowl = testing::sphere(centre, 1.2F * scale, 8, 0, true);
    std::erase_if(bowl.triangles, [&](const Triangle& t) {
        return bowl.positions[t[0]].y > centre.y || bowl.positions[t[1]].y > centre.y;
    });
    testing::add_mesh(scene, bowl);
    testing::add_mesh(scene, testing::sphere(centre + scale * Vec3(0.3F, 0.9F, -0.2F), 0.5F * scale, 6, 0));
    const Vec3 along = scale * Vec3(5, 0.4F, 0.3F), across = scale * Vec3(0.2F, 0.1F, 6);
    testing::add_mesh(scene, quad(centre - 0.5F * (along + across) - scale * Vec3(0, 0.3F, 0), across, along, 1));
    return scene;
}

/// A mirror at the origin that faces +y, with receiver and light on both sides of it.
struct SimplePath {
    SurfacePoint receiver = surface_point({-1, 1, 0}, {0, -1, 0}, 1.0);
    std::vector<SurfacePoint> vertices{surface_point({0, 0, 0}, {0, 1, 0}, 1.0)};
    PathEnd light{{1, 1, 0}};
    double light_radius = 0.0;

    SpecularPathView view() const { return {receiver, vertices, light, light_radius}; }
};

Scene simple_scene() {
    Scene scene;
    scene.materials = {testing::metal(Rgb(1.0F), 0.01F)};
    testing::add_mesh(scene, quad({-0.5F, 0, -0.5F}, {0, 0, 1}, {1, 0, 0}, 0));
    testing::add_mesh(scene, quad({-1.5F, 1, -0.5F}, {1, 0, 0}, {0, 0, 1}, 0));
    return scene;
}

PunctualLight sphere_light(const Vec3& centre, float radius) {
    PunctualLight light = testing::point_light(centre, Rgb(1.0F));
    light.kind = LightKind::sphere;
    light.radius = radius;
    return light;
}

int blocked_segment(const Scene& scene, const SpecularPathView& path) {
    const Accelerator accelerator(scene, 1);
    return first_blocked_segment(accelerator, path);
}

}  // namespace

TEST_CASE("visibility agrees with double precision in a bowl with a ball, at scales 1e-4 to 1e5") {
    for (const float scale : {1e-4F, 1e-2F, 1.0F, 1e2F, 1e5F}) {
        for (const float offset : {0.0F, 10.0F, 1e3F}) {
            const Vec3 centre = Vec3(1.0F, 0.3F, -0.7F) * offset * scale;
            const Scene scene = bowl_and_ball(centre, scale);
            const Comparison result = compare_with_truth(scene, Vec3d(centre), static_cast<double>(scale), 4000);
            INFO("scale ", scale, " offset ", offset, ": ", result.clear, " clear, ", result.blocked, " blocked");
            CHECK(result.clear > 100);
            CHECK(result.blocked > 1000);
            CHECK(result.falsely_blocked == 0);
            CHECK(result.falsely_clear == 0);
            CHECK(result.wrong_segment == 0);
        }
    }
}

TEST_CASE("visibility agrees with double precision 1e5 from the origin, and of instances") {
    const Vec3 far(1e5F, -3e4F, 7e4F);
    const Comparison translated = compare_with_truth(bowl_and_ball(far, 50.0F), Vec3d(far), 50.0, 4000);
    CHECK(translated.clear > 100);
    CHECK(translated.falsely_blocked + translated.falsely_clear + translated.wrong_segment == 0);

    // Instances whose transform takes away what their own coordinates are far from the origin.
    Scene instanced = bowl_and_ball(Vec3(300, 200, -100), 1.0F);
    const Mat4 turned = glm::rotate(glm::translate(Mat4(1.0F), Vec3(20, -7, 11)), 0.7F, Vec3(0.3F, 1, 0.2F));
    const Mat4 placed = glm::translate(glm::scale(turned, Vec3(-1.3F, 0.9F, 1.1F)), Vec3(-300, -200, 100));
    for (Object& object : instanced.objects) object.to_world = placed;
    const Comparison moved = compare_with_truth(instanced, Vec3d(20, -7, 11), 1.0, 4000);
    CHECK(moved.clear > 100);
    CHECK(moved.falsely_blocked + moved.falsely_clear + moved.wrong_segment == 0);
}

TEST_CASE("closed sphere: the near outer side reflects, the far inner side is hidden") {
    for (const float scale : {1e-4F, 1.0F, 1e5F}) {
        for (const Vec3 centre : {Vec3(0.0F), Vec3(1e3F, 2e2F, -5e2F)}) {
            Scene scene;
            scene.materials = {testing::metal(Rgb(1.0F), 0.01F)};
            testing::add_mesh(scene, testing::sphere(scale * centre, scale, 32, 0));
            const Accelerator accelerator(scene, 1);
            const Mesh& mesh = scene.meshes[0];
            const Vec3d unit(scale), middle(scale * centre);
            const SurfacePoint receiver =
                surface_point(middle + unit * Vec3d(3, 0.5, -1), Vec3(-1, 0, 0), static_cast<double>(scale));
            const PathEnd light{middle + unit * Vec3d(3, 0.7, 1)};
            int near = 0, far = 0;
            for (const Triangle& t : mesh.triangles) {
                const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
                const Vec3d p = 0.5 * a + 0.3 * b + 0.2 * c;
                const Vec3d normal = glm::normalize(glm::cross(b - a, c - a));
                const std::array<SurfacePoint, 1> vertices{
                    surface_point(p, Vec3(normal), static_cast<double>(scale) * 0.2)};
                const double cosine = std::min(glm::dot(normal, glm::normalize(receiver.position - p)),
                                               glm::dot(normal, glm::normalize(light.point - p)));
                const double other = std::max(glm::dot(normal, glm::normalize(receiver.position - p)),
                                              glm::dot(normal, glm::normalize(light.point - p)));
                const bool visible = is_visible(accelerator, {receiver, vertices, light, 0.0});
                if (cosine > 0.05) {
                    ++near;
                    CHECK(visible);
                } else if (other < -0.2) {
                    ++far;
                    CHECK_FALSE(visible);
                }
            }
            CHECK(near > 500);
            CHECK(far > 500);
        }
    }
}

TEST_CASE("solutions on the crease of a concave mirror are visible") {
    Generator generator(5);
    for (const double angle : {5.0, 60.0, 90.0, 120.0}) {
        const double half = (180.0 - angle) * M_PI / 360.0;
        // The valley runs along z; its sides rise at `half` from the plane x = 0, their normals are `angle` apart.
        for (int n = 0; n < 200; ++n) {
            const Vec3d shift = testing::random_point(generator, 100.0);
            const double turn = uniform(generator, 0.0, 6.0);
            const auto placed = [&](const Vec3d& p) {
                const Vec3d turned(p.x * std::cos(turn) - p.y * std::sin(turn),
                                   p.x * std::sin(turn) + p.y * std::cos(turn), p.z);
                return turned + shift;
            };
            const Vec3 foot(placed({0, 0, -1})), along = Vec3(placed({0, 0, 1})) - foot;
            const Vec3 left = Vec3(placed({-std::sin(half), std::cos(half), -1})) - foot;
            const Vec3 right = Vec3(placed({std::sin(half), std::cos(half), -1})) - foot;
            Scene scene;
            scene.materials = {testing::metal(Rgb(1.0F), 0.01F)};
            testing::add_mesh(scene, quad(foot, along, left, 0));
            testing::add_mesh(scene, quad(foot, along, right, 0));
            const Vec3 normal = glm::normalize(n % 2 == 0 ? glm::cross(along, left) : glm::cross(along, right));
            const Vec3d p = Vec3d(foot) + Vec3d(along) * uniform(generator, 0.1, 0.9);
            const std::array<SurfacePoint, 1> vertices{surface_point(p, normal, 2.3)};
            const SurfacePoint receiver = surface_point(placed({0.1 * std::sin(half), 3, 0.4}), Vec3(0.0F), 1.0);
            SurfacePoint facing = receiver;
            facing.geometric_normal = glm::normalize(Vec3(p - receiver.position));
            const PathEnd light{placed({-0.3 * std::sin(half), 2, -0.2})};
            INFO("angle ", angle);
            CHECK(blocked_segment(scene, {facing, vertices, light, 0.0}) == no_segment);
        }
    }
}

TEST_CASE("a thin blocker is seen in whichever segment it stands") {
    SimplePath path;
    path.vertices = {surface_point({0, 0, 0}, {0, 1, 0}, 1.0), surface_point({1, 1, 0}, {0, -1, 0}, 1.0),
                     surface_point({2, 0, 0}, {0, 1, 0}, 1.0)};
    path.light = {{3, 1, 0}};
    Scene scene = simple_scene();
    testing::add_mesh(scene, quad({0.5F, 1, -0.5F}, {1, 0, 0}, {0, 0, 1}, 0));
    testing::add_mesh(scene, quad({1.5F, 0, -0.5F}, {0, 0, 1}, {1, 0, 0}, 0));
    CHECK(blocked_segment(scene, path.view()) == no_segment);
    for (int segment = 0; segment < 4; ++segment) {
        for (const float height : {1e-4F, 0.3F, 0.7F, 0.9999F}) {
            const float x = static_cast<float>(segment) - (segment % 2 == 0 ? height : 1.0F - height);
            Scene blocked = scene;
            testing::add_mesh(blocked, quad({x - 1e-5F, height, -1e-5F}, {2e-5F, 0, 0}, {0, 0, 2e-5F}, 0));
            INFO("segment ", segment, " height ", height);
            CHECK(blocked_segment(blocked, path.view()) == segment);
        }
    }
    // Of several, the one next to the light is reported.
    testing::add_mesh(scene, quad({-1, 0.5F, -1}, {5, 0, 0}, {0, 0, 2}, 0));
    CHECK(blocked_segment(scene, path.view()) == 3);
}

TEST_CASE("sphere lights do not block their own paths, but those of others") {
    for (const float distance : {1e-2F, 1.0F, 1e4F}) {
        for (const float share : {1e-4F, 1e-2F, 0.5F}) {
            Scene scene = simple_scene();
            const Vec3 centre = distance * glm::normalize(Vec3(1, 1, 0.3F));
            const float radius = share * distance;
            scene.lights.push_back(sphere_light(centre, radius));
            SimplePath path;
            path.light = {Vec3d(centre)};
            path.light_radius = static_cast<double>(radius);
            if (radius < 1.0F) CHECK(blocked_segment(scene, path.view()) == no_segment);
            path.light = {Vec3d(1.7F * centre)};
            path.light_radius = 0.0;
            if (radius < 1.0F) CHECK(blocked_segment(scene, path.view()) == 1);
        }
    }
    // A vertex inside of the light has nothing before it.
    SimplePath path;
    path.light = {{0.01, 0.01, 0}};
    path.light_radius = 0.1;
    Scene scene = simple_scene();
    CHECK(blocked_segment(scene, path.view()) == no_segment);
    // What stands closely before the light is seen.
    path.light = {{1, 1, 0}};
    scene.lights.push_back(sphere_light({1, 1, 0}, 0.1F));
    testing::add_mesh(scene, quad({0.9F, 0.9F, -0.1F}, {0, 0, 0.2F}, {0.1F, -0.1F, 0}, 0));
    testing::add_mesh(scene, quad({0.9F, 0.9F, -0.1F}, {0, 0, 0.2F}, {-0.1F, 0.1F, 0}, 0));
    CHECK(blocked_segment(scene, path.view()) == 1);
}

TEST_CASE("lights at infinity: only what lies in their direction is in the way") {
    SimplePath path;
    path.light = {{0.6, 0.8, 0.0}, true};
    Scene scene = simple_scene();
    CHECK(blocked_segment(scene, path.view()) == no_segment);
    testing::add_mesh(scene, quad({5e4F, 8e4F, -1e4F}, {2e4F, 0, 0}, {0, 0, 2e4F}, 0));
    CHECK(blocked_segment(scene, path.view()) == 1);
    path.light.point = {0.0, 0.0, 0.0};
    CHECK(blocked_segment(scene, path.view()) == 1);
}

TEST_CASE("large tilted triangles through a small scene do not block their own points") {
    Generator generator(3);
    for (int n = 0; n < 300; ++n) {
        const Vec3 normal = glm::normalize(Vec3(testing::random_point(generator, 1.0)));
        const Vec3 a = 2e4F * glm::normalize(glm::cross(normal, Vec3(0.3F, 1, 0.2F)));
        const Vec3 b = glm::cross(normal, a);
        Scene scene;
        scene.materials = {testing::metal(Rgb(1.0F), 0.01F)};
        testing::add_mesh(scene, quad(-0.37F * a - 0.51F * b, a, b, 0));
        const Mesh& mesh = scene.meshes[0];
        const Corners corners{Vec3d(mesh.positions[0]), Vec3d(mesh.positions[1]), Vec3d(mesh.positions[2])};
        const Vec3d exact = glm::normalize(glm::cross(corners[1] - corners[0], corners[2] - corners[0]));
        // The plane's point next to the world's origin is well inside the first or the second triangle.
        const Vec3d p = exact * glm::dot(exact, corners[0]);
        const std::array<SurfacePoint, 1> vertices{surface_point(p, Vec3(exact), 3e4)};
        const Vec3d tangent(glm::normalize(a));
        SurfacePoint receiver = surface_point(p + exact * 0.5 + tangent, Vec3(-tangent), 0.1);
        CHECK(blocked_segment(scene, {receiver, vertices, {p + exact * 0.6 - tangent}, 0.0}) == no_segment);
    }
}

TEST_CASE("small triangles at the far end of long grazing segments do not block them") {
    Generator generator(4);
    for (int n = 0; n < 300; ++n) {
        const Vec3d normal = glm::normalize(testing::random_point(generator, 1.0));
        const Vec3d a = glm::normalize(glm::cross(normal, Vec3d(0.3, 1, 0.2))), b = glm::cross(normal, a);
        Scene scene;
        scene.materials = {testing::metal(Rgb(1.0F), 0.01F)};
        testing::add_mesh(scene, quad(Vec3(-0.4 * a - 0.3 * b), Vec3(a), Vec3(b), 0));
        const Mesh& mesh = scene.meshes[0];
        const Vec3d p =
            0.4 * Vec3d(mesh.positions[0]) + 0.3 * Vec3d(mesh.positions[1]) + 0.3 * Vec3d(mesh.positions[2]);
        const std::array<SurfacePoint, 1> vertices{surface_point(p, Vec3(normal), 1.5)};
        const double slope = uniform(generator, 0.01, 0.3), turn = uniform(generator, 0.0, 6.0);
        const Vec3d direction = glm::normalize(a * std::cos(turn) + b * std::sin(turn) + normal * slope);
        const SurfacePoint receiver = surface_point(p + 1e5 * direction, Vec3(-direction), 1.0);
        CHECK(blocked_segment(scene, {receiver, vertices, {p + normal}, 0.0}) == no_segment);
    }
}

TEST_CASE("paths that end behind the receiver, and broken ones, are blocked") {
    const Scene scene = simple_scene();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    SimplePath path;
    CHECK(blocked_segment(scene, path.view()) == no_segment);
    path.receiver.geometric_normal = {0, 1, 0};
    CHECK(blocked_segment(scene, path.view()) == 0);

    for (const double broken : {nan, testing::no_limit, 1e30}) {
        SimplePath bad_light, bad_receiver, bad_vertex, bad_radius;
        bad_light.light.point.y = broken;
        bad_receiver.receiver.position.x = -broken;
        bad_vertex.vertices[0].position.z = broken;
        bad_radius.light_radius = broken;
        for (const SimplePath& bad : {bad_light, bad_receiver, bad_vertex, bad_radius}) {
            CHECK(blocked_segment(scene, bad.view()) == 1);
        }
    }

    // Coincident points have nothing between them.
    SimplePath doubled;
    doubled.vertices.push_back(doubled.vertices[0]);
    CHECK(blocked_segment(scene, doubled.view()) == no_segment);
    // Without a vertex the path is a shadow ray.
    SimplePath direct;
    direct.vertices.clear();
    direct.light = {{-0.8, 0.4, 0}};
    CHECK(blocked_segment(scene, direct.view()) == no_segment);
    direct.light = {{0.1, -1, 0}};
    CHECK(blocked_segment(scene, direct.view()) == 0);
}

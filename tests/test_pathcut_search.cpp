// The path-cut search against brute force over all tuples of triangles: nothing that the solver accepts may be missed.
#include <doctest/doctest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "pathcut/path_cut_search.h"
#include "tests/pathcut_chains.h"
#include "tests/reflector_shapes.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

constexpr double pi_double = 3.14159265358979323846;

struct RandomScene {
    std::vector<ReflectorTriangle> reflectors;
    std::vector<Vec3> receivers;
    PathLight light;
    std::string description;
};

Shape random_shape(Generator& generator, const Vec3d& centre) {
    switch (std::uniform_int_distribution<int>(0, 5)(generator)) {
        case 0:
            return sphere_shape(centre, uniform(generator, 0.3, 0.6));
        case 1:
            return torus_shape(centre, 0.5, uniform(generator, 0.1, 0.3));
        case 2:
            return cylinder_shape(centre, uniform(generator, 0.3, 0.7), uniform(generator, 0.3, 1.0), 0.0,
                                  uniform(generator, 2.0, 2.0 * pi_double));
        case 3:
            return bumpy_cylinder_shape(centre, 0.5, 1.0, 0.0, uniform(generator, 2.0, 6.0), 0.05, 5.0);
        case 4:
            return bumpy_plane_shape(centre, 0.7, uniform(generator, 0.01, 0.06), uniform(generator, 1.0, 3.0));
        default:
            return bowl_shape(centre, 0.7, uniform(generator, 0.6, 1.6));
    }
}

PathLight random_light(Generator& generator) {
    PathLight light;
    light.point = Vec3(random_point(generator, 1.0) * 2.0 + Vec3d(0.0, 2.0, 0.0));
    switch (std::uniform_int_distribution<int>(0, 3)(generator)) {
        case 0:
            break;
        case 1:
            light.axis = glm::normalize(-light.point);
            light.cos_cone = static_cast<float>(std::cos(uniform(generator, 0.1, 0.6)));
            break;
        case 2:
            light.point = glm::normalize(light.point);
            light.at_infinity = true;
            break;
        default:
            light.radius = static_cast<float>(uniform(generator, 0.001, 0.02));
            break;
    }
    return light;
}

/// One or two reflectors of about `triangles` triangles, moved to `offset` and scaled.
RandomScene make_random_scene(Generator& generator, int triangles, size_t receivers, double scale,
                              const Vec3d& offset) {
    RandomScene scene;
    // From 0.001 to 0.1, the larger ones more often: they have the more tuples to miss.
    const auto alpha = static_cast<float>(std::pow(10.0, -3.0 + 2.0 * std::sqrt(uniform(generator, 0.0, 1.0))));
    const int objects = std::uniform_int_distribution<int>(1, 2)(generator);
    for (int i = 0; i < objects; ++i) {
        const Shape shape = random_shape(generator, random_point(generator, 0.5));
        add_shape(scene.reflectors, shape, triangles / objects, uniform(generator, 0.5, 3.0), alpha);
    }
    scene.light = random_light(generator);
    for (size_t i = 0; i < receivers; ++i) scene.receivers.emplace_back(random_point(generator, 1.5));
    const auto place = [&](Vec3& p) { p = Vec3(Vec3d(p) * scale + offset); };
    for (ReflectorTriangle& t : scene.reflectors) {
        for (Vec3& p : t.positions) place(p);
    }
    for (Vec3& p : scene.receivers) place(p);
    if (!scene.light.at_infinity) place(scene.light.point);
    scene.light.radius *= static_cast<float>(scale);
    scene.description = "alpha " + std::to_string(alpha) + ", " + std::to_string(scene.reflectors.size()) +
                        " triangles, light radius " + std::to_string(scene.light.radius) +
                        (scene.light.at_infinity ? ", at infinity" : "") +
                        (scene.light.shines_everywhere() ? "" : ", spot");
    return scene;
}

/// Receiver (as given) and triangles of a path.
using Tuple = std::array<uint32_t, 3>;
/// Where a path meets the reflectors, and how exactly positions are known: a part of the smallest triangle.
struct Place {
    std::array<Vec3d, 2> points{};
    double tolerance = 0.0;
};
using Paths = std::map<Tuple, Place>;

double coincidence(const ReflectorTree& reflectors, const std::array<uint32_t, 2>& triangles) {
    return 1e-3 * std::min(reflectors.patch(triangles[0]).size, reflectors.patch(triangles[1]).size);
}

Paths search(const ReflectorTree& reflectors, const RandomScene& scene, int bounces, Selection selection,
             SearchStatistics& statistics) {
    SearchOptions options;
    options.bounces = bounces;
    options.selection = selection;
    options.merge_distance = -1.0;
    const RepresentativePaths paths = find_representative_paths(reflectors, build_receiver_tree(scene.receivers),
                                                                std::span(&scene.light, 1), options);
    statistics += paths.statistics;
    Paths found;
    for (uint32_t receiver = 0; receiver < scene.receivers.size(); ++receiver) {
        for (const RepresentativePath& path : paths.of_receiver(receiver)) {
            if (path.length != bounces) continue;
            Tuple tuple{receiver, 0, 0};
            Place place;
            for (size_t i = 0; i < path.length; ++i) {
                const ReflectorVertex& vertex = paths.vertices_of(path)[i];
                tuple[i + 1] = vertex.triangle;
                place.points[i] = evaluate(reflectors.patch(vertex.triangle), Vec2d(vertex.b1, vertex.b2)).position;
            }
            found[tuple] = place;
        }
    }
    return found;
}

Paths brute_force_from(const ReflectorTree& reflectors, const RandomScene& scene, uint32_t receiver, int bounces,
                       Selection selection) {
    SolverOptions thorough;
    thorough.rejection_margin = INFINITY;
    Paths accepted;
    const auto count = static_cast<uint32_t>(reflectors.size());
    for (uint32_t a = 0; a < count; ++a) {
        for (uint32_t b = 0; b < (bounces == 2 ? count : 1); ++b) {
            if (bounces == 2 && a == b) continue;
            const std::array<uint32_t, 2> triangles{a, b};
            const TupleSolution solution =
                solve_tuple(reflectors, std::span(triangles).first(static_cast<size_t>(bounces)),
                            scene.receivers[receiver], scene.light, selection, thorough);
            if (!solution.accepted) continue;
            Place& place = accepted[{receiver, a, b}];
            place.tolerance = coincidence(reflectors, triangles);
            for (size_t i = 0; i < static_cast<size_t>(bounces); ++i) {
                place.points[i] = solution.path.vertices[i].position;
            }
        }
    }
    return accepted;
}

Paths brute_force(const ReflectorTree& reflectors, const RandomScene& scene, int bounces, Selection selection) {
    std::vector<Paths> by_receiver(scene.receivers.size());
    tbb::parallel_for(size_t{0}, by_receiver.size(), [&](size_t i) {
        by_receiver[i] = brute_force_from(reflectors, scene, static_cast<uint32_t>(i), bounces, selection);
    });
    Paths accepted;
    for (Paths& paths : by_receiver) accepted.merge(paths);
    return accepted;
}

/// Whether a path that runs through corners or edges was found in another triangle there.
bool found_elsewhere(const Paths& found, uint32_t receiver, const Place& place) {
    for (auto i = found.lower_bound({receiver, 0, 0}); i != found.end() && i->first[0] == receiver; ++i) {
        const auto& points = i->second.points;
        if (glm::length(points[0] - place.points[0]) <= place.tolerance &&
            glm::length(points[1] - place.points[1]) <= place.tolerance) {
            return true;
        }
    }
    return false;
}

struct Recall {
    size_t accepted = 0;
    size_t missed = 0;
    SearchStatistics statistics;
};

void compare(Generator& generator, int scenes, int triangles, size_t receivers, int bounces, Selection selection,
             Recall& recall, double scale = 1.0, const Vec3d& offset = Vec3d(0.0)) {
    for (int i = 0; i < scenes; ++i) {
        const RandomScene scene = make_random_scene(generator, triangles, receivers, scale, offset);
        const ReflectorTree reflectors = build_reflector_tree(scene.reflectors, {});
        const Paths found = search(reflectors, scene, bounces, selection, recall.statistics);
        const Paths accepted = brute_force(reflectors, scene, bounces, selection);
        recall.accepted += accepted.size();
        for (const auto& [tuple, place] : accepted) {
            if (found.contains(tuple)) continue;
            if (selection == Selection::local_minima && found_elsewhere(found, tuple[0], place)) continue;
            ++recall.missed;
            MESSAGE("scene " << i << " (" << scene.description << "): missed receiver " << tuple[0] << ", triangles "
                             << tuple[1] << " " << tuple[2]);
        }
        // And nothing is found that brute force does not accept.
        const auto is_extra = [&](const auto& path) { return !accepted.contains(path.first); };
        CHECK_MESSAGE(std::none_of(found.begin(), found.end(), is_extra), "scene " << i);
    }
}

void report(const Recall& recall, const char* what) {
    const SearchStatistics& s = recall.statistics;
    MESSAGE(std::string(what) << ": " << recall.accepted << " accepted tuples, " << recall.missed << " missed; "
                              << s.leaf_cuts << " leaf cuts, " << s.solves << " solves, " << s.exact << " exact, "
                              << s.relaxed << " relaxed");
}

// Sanitizers make brute force ten times slower; they look for other errors than misses.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr int scale_down = 20;
#else
constexpr int scale_down = 1;
#endif
/// What must be accepted for a recall to mean something; a few scenes are too few to say.
constexpr size_t at_least(size_t count) {
    return scale_down == 1 ? count : 0;
}

}  // namespace

TEST_CASE("every accepted triangle is found, one reflection") {
    Generator generator(1);
    Recall recall;
    compare(generator, 200 / scale_down, 800, 28, 1, Selection::every_triangle, recall);
    report(recall, "one reflection, every triangle");
    CHECK(recall.missed == 0);
    CHECK(recall.accepted > at_least(100000));
}

TEST_CASE("every local minimum is found, one reflection") {
    Generator generator(2);
    Recall recall;
    compare(generator, 100 / scale_down, 500, 10, 1, Selection::local_minima, recall);
    report(recall, "one reflection, local minima");
    CHECK(recall.missed == 0);
    CHECK(recall.accepted > at_least(2000));
}

TEST_CASE("every accepted pair of triangles is found, two reflections") {
    Generator generator(3);
    Recall recall;
    compare(generator, 60 / scale_down, 70, 2, 2, Selection::every_triangle, recall);
    report(recall, "two reflections, every pair");
    CHECK(recall.missed == 0);
    CHECK(recall.accepted > at_least(3000));
}

TEST_CASE("recall does not depend on scale, nor on the distance from the origin") {
    for (const auto& [scale, offset] :
         {std::pair(1e-4, Vec3d(0.0)), std::pair(1e5, Vec3d(0.0)), std::pair(1.0, Vec3d(3000.0, -2000.0, 1000.0))}) {
        Generator generator(5);
        Recall recall;
        compare(generator, std::max(1, 20 / scale_down), 300, 5, 1, Selection::every_triangle, recall, scale, offset);
        report(recall, "scaled or moved");
        CHECK(recall.missed == 0);
        CHECK(recall.accepted > at_least(1000));
    }
}

TEST_CASE("two reflections by beams find nearly all exact paths") {
    Generator generator(4);
    Recall exact, relaxed;
    for (int i = 0; i < std::max(2, 24 / scale_down); ++i) {
        const RandomScene scene = make_random_scene(generator, 1000, 2, 1.0, Vec3d(0.0));
        const ReflectorTree reflectors = build_reflector_tree(scene.reflectors, {});
        const Paths found = search(reflectors, scene, 2, Selection::local_minima, exact.statistics);
        // The search of all tuples misses nothing, as the tests above show, and is the faster brute force.
        for (auto [tuple, place] : search(reflectors, scene, 2, Selection::every_triangle, relaxed.statistics)) {
            const std::array<uint32_t, 2> triangles{tuple[1], tuple[2]};
            const TupleSolution solution =
                solve_tuple(reflectors, triangles, scene.receivers[tuple[0]], scene.light, Selection::local_minima);
            if (!solution.accepted) continue;
            Recall& recall = solution.path.status == SolveStatus::exact ? exact : relaxed;
            ++recall.accepted;
            place.tolerance = coincidence(reflectors, triangles);
            if (!found.contains(tuple) && !found_elsewhere(found, tuple[0], place)) ++recall.missed;
        }
    }
    report(exact, "two reflections by beams, exact");
    report(relaxed, "two reflections by beams, relaxed");
    // Coarse meshes: triangles of a tenth of the object. What is missed are hops shorter than a triangle.
    CHECK(static_cast<double>(exact.missed) <= 0.05 * static_cast<double>(exact.accepted));
}

// Time, work and memory of the path-cut search on scenes of known shape; JSON on standard output.
//
// pathcut_benchmark [--case NAME] [--repeat N] [--threads N] [--receivers N]
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "pathcut/cut_test.h"
#include "pathcut/direction_bounds.h"
#include "pathcut/path_cut_search.h"
#include "tests/reflector_shapes.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Case {
    std::string name;
    std::function<void(std::vector<ReflectorTriangle>&, int count, float alpha)> reflectors;
    Vec3 light;
    Vec3 receivers_low, receivers_high;  ///< A box (or a rectangle) in which the receivers lie.
    Vec3 receiver_normal;
    int bounces;
};

std::vector<Case> cases() {
    constexpr double pi_double = 3.14159265358979323846;
    return {
        {"bumpy_plane",
         [](auto& t, int count, float alpha) {
             add_shape(t, bumpy_plane_shape(Vec3d(0.0), 1.0, 0.02, 4.0), count, 1.0, alpha);
         },
         {0.3F, 2.0F, 0.4F},
         {-1.0F, 1.0F, -1.0F},
         {1.0F, 1.0F, 1.0F},
         {0.0F, -1.0F, 0.0F},
         1},
        {"sphere",
         [](auto& t, int count, float alpha) {
             add_shape(t, sphere_shape(Vec3d(0.0, 0.5, 0.0), 0.5), count, 2.0, alpha);
         },
         {2.0F, 2.0F, 0.0F},
         {-2.0F, 0.0F, -2.0F},
         {2.0F, 0.0F, 2.0F},
         {0.0F, 1.0F, 0.0F},
         1},
        {"ring",
         [=](auto& t, int count, float alpha) {
             add_shape(t, cylinder_shape(Vec3d(0.0, 0.0, 0.25), 1.0, 0.5, 0.0, 2.0 * pi_double), count, 12.0, alpha);
         },
         {3.0F, 0.0F, 2.0F},
         {-0.9F, -0.9F, 0.0F},
         {0.9F, 0.9F, 0.0F},
         {0.0F, 0.0F, 1.0F},
         1},
        {"two_cylinders",
         [=](auto& t, int count, float alpha) {
             add_shape(t, bumpy_cylinder_shape(Vec3d(-0.8, 0.6, 0.0), 0.5, 2.0, -pi_double, pi_double, 0.01, 8.0),
                       count / 2, 1.5, alpha);
             add_shape(t, bumpy_cylinder_shape(Vec3d(0.8, 0.6, 0.0), 0.5, 2.0, -pi_double, pi_double, 0.01, 8.0),
                       count - count / 2, 1.5, alpha);
         },
         {0.2F, 3.0F, 0.3F},
         {-2.0F, 0.0F, -2.0F},
         {2.0F, 0.0F, 2.0F},
         {0.0F, 1.0F, 0.0F},
         2},
        {"bowl",
         [=](auto& t, int count, float alpha) {
             add_shape(t, bowl_shape(Vec3d(0.0, 1.0, 0.0), 1.0, pi_double / 2.0), count, 4.0, alpha);
         },
         {0.6F, 1.5F, 0.0F},
         {-0.3F, 0.15F, -0.3F},
         {0.3F, 0.15F, 0.3F},
         {0.0F, 1.0F, 0.0F},
         2},
        {"open_cylinder",
         [=](auto& t, int count, float alpha) {
             add_shape(t, cylinder_shape(Vec3d(0.0, 0.0, 0.25), 1.0, 0.5, 0.0, 2.0 * pi_double), count, 12.0, alpha);
         },
         {0.5F, 0.0F, 1.0F},
         {-0.9F, -0.9F, 0.0F},
         {0.9F, 0.9F, 0.0F},
         {0.0F, 0.0F, 1.0F},
         2},
    };
}

std::vector<Vec3> random_receivers(const Case& c, size_t count) {
    std::mt19937 generator(7);
    std::uniform_real_distribution<float> uniform;
    std::vector<Vec3> points(count);
    for (Vec3& p : points) {
        const Vec3 u(uniform(generator), uniform(generator), uniform(generator));
        p = c.receivers_low + (c.receivers_high - c.receivers_low) * u;
    }
    return points;
}

/// The reflectors as a scene, so that rays can be traced.
Scene scene_of(const std::vector<ReflectorTriangle>& triangles) {
    Scene scene;
    Mesh mesh;
    for (const ReflectorTriangle& t : triangles) {
        const auto first = static_cast<uint32_t>(mesh.positions.size());
        mesh.triangles.push_back({first, first + 1, first + 2});
        mesh.positions.insert(mesh.positions.end(), t.positions.begin(), t.positions.end());
    }
    mesh.positions.reserve(mesh.positions.size() + 1);
    scene.materials.emplace_back();
    scene.meshes.push_back(std::move(mesh));
    scene.objects.emplace_back();
    return scene;
}

nlohmann::json run(const Case& c, int triangles, float alpha, size_t receiver_count, SearchOptions options,
                   const AcceptanceOptions& acceptance, bool visibility, int repeat) {
    std::vector<ReflectorTriangle> reflectors;
    c.reflectors(reflectors, triangles, alpha);
    const std::vector<Vec3> receivers = random_receivers(c, receiver_count);
    PathLight light;
    light.point = c.light;
    const Scene scene = scene_of(reflectors);
    const Accelerator accelerator(scene, 2);
    std::vector<SurfacePoint> receiver_points;
    for (const Vec3& p : receivers) receiver_points.push_back(surface_point(Vec3d(p), c.receiver_normal, 1.0));
    if (visibility) {
        options.accelerator = &accelerator;
        options.receiver_points = receiver_points;
    }
    nlohmann::json result;
    double best_build = 1e30, best_search = 1e30;
    for (int i = 0; i < repeat; ++i) {
        const auto start = std::chrono::steady_clock::now();
        const ReflectorTree mirrors = build_reflector_tree(reflectors, acceptance);
        const ReceiverTree points = build_receiver_tree(receivers);
        best_build = std::min(best_build, seconds_since(start));
        const auto search_start = std::chrono::steady_clock::now();
        const RepresentativePaths paths = find_representative_paths(mirrors, points, std::span(&light, 1), options);
        best_search = std::min(best_search, seconds_since(search_start));
        const SearchStatistics& s = paths.statistics;
        result = {{"case", c.name},
                  {"triangles", mirrors.size()},
                  {"alpha", alpha},
                  {"receivers", receiver_count},
                  {"bounces", options.bounces},
                  {"selection", options.selection == Selection::local_minima ? "local_minima" : "every_triangle"},
                  {"seconds_build", best_build},
                  {"seconds_search", best_search},
                  {"nodes_visited", s.nodes_visited},
                  {"leaf_cuts", s.leaf_cuts},
                  {"solves", s.solves},
                  {"iterations", s.iterations},
                  {"exact", s.exact},
                  {"relaxed", s.relaxed},
                  {"continued", s.continued},
                  {"merged", s.merged},
                  {"dropped_cuts", s.dropped_cuts},
                  {"occluded", s.occluded},
                  {"dropped_beams", s.dropped_beams},
                  {"beam_bytes", paths.beam_bytes},
                  {"paths", paths.paths.size()},
                  {"bytes", mirrors.bytes() + points.tree.bytes() + paths.bytes()}};
    }
    return result;
}

/// The boxes that interval arithmetic would bound sixteen nodes by: of positions, and of normals.
struct BoxLanes {
    IntervalVector<FloatV> positions, normals;
};

IntervalVector<FloatV> gather_boxes(const std::vector<IntervalVector<float>>& boxes, size_t first) {
    const auto lanes = [&](auto member) { return FloatV([&](auto lane) { return member(boxes[first + lane]); }); };
    return {{lanes([](const auto& b) { return b.x.lower; }), lanes([](const auto& b) { return b.x.upper; })},
            {lanes([](const auto& b) { return b.y.lower; }), lanes([](const auto& b) { return b.y.upper; })},
            {lanes([](const auto& b) { return b.z.lower; }), lanes([](const auto& b) { return b.z.upper; })}};
}

/// The half-vector test in interval arithmetic, as in the paper, with the sine of the acceptance angle.
NEPHROID_FLATTEN FloatV::mask_type boxes_reject(const BoxLanes& node, const IntervalVector<FloatV>& receiver,
                                                const IntervalVector<FloatV>& light, float sin_acceptance) {
    const IntervalVector<FloatV> wo = directions_between(node.positions, receiver);
    const IntervalVector<FloatV> wi = directions_between(node.positions, light);
    const IntervalVector<FloatV> h = half_vectors(wi, wo);
    const FloatV limit(sin_acceptance);
    const IntervalVector<FloatV> back{-node.normals.x, -node.normals.y, -node.normals.z};
    return gap_between<FloatV>(h, node.normals).min_sine > limit && gap_between<FloatV>(h, back).min_sine > limit;
}

NEPHROID_FLATTEN FloatV::mask_type cones_reject(const MirrorBound<FloatV>& node, const PointBound<FloatV>& receiver,
                                                const PathLight& light) {
    return cannot_reflect<FloatV>(node, make_leg<FloatV>(node.points, receiver), make_leg<FloatV>(node.points, light));
}

/// How many nodes of each level the two kinds of bounds reject, and in what time: for single receivers.
nlohmann::json compare_bounds(const Case& c, int triangles, float alpha) {
    std::vector<ReflectorTriangle> reflectors;
    c.reflectors(reflectors, triangles, alpha);
    const ReflectorTree mirrors = build_reflector_tree(reflectors, {});
    PathLight light;
    light.point = c.light;
    const std::vector<Vec3> receivers = random_receivers(c, 2000);
    const auto sin_acceptance = static_cast<float>(std::sin(std::atan(AcceptanceOptions{}.max_slope(double{alpha}))));
    nlohmann::json levels = nlohmann::json::array();
    for (uint32_t level = 0; level < mirrors.tree.levels.size(); ++level) {
        const size_t nodes = mirrors.tree.items_at(level), run = size_t{1} << (4 * level);
        std::vector<IntervalVector<float>> positions, normals;
        for (size_t node = 0; node < nodes; ++node) {
            IntervalVector<float> p = empty_box<float>(), n = empty_box<float>();
            for (size_t t = node * run; t < std::min((node + 1) * run, mirrors.size()); ++t) {
                for (size_t corner = 0; corner < 3; ++corner) {
                    p = hull(p, point_box(to_triple(mirrors.position(static_cast<uint32_t>(t), corner))));
                    n = hull(n, point_box(to_triple(mirrors.normal(static_cast<uint32_t>(t), corner))));
                }
            }
            positions.push_back(p);
            normals.push_back(spanned_box(n));
        }
        const size_t full = nodes / block_size;
        if (full == 0) continue;
        std::array<uint64_t, 2> rejected{};
        std::array<double, 2> seconds{};
        uint64_t tests = 0;
        const IntervalVector<FloatV> light_box = point_box(broadcast(to_triple(light.point)));
        for (size_t block = 0; block < std::min<size_t>(full, 64); ++block) {
            for (size_t first = 0; first < block_size; first += simd_width) {
                const size_t at = block * block_size + first;
                const BoxLanes boxes{gather_boxes(positions, at), gather_boxes(normals, at)};
                const MirrorBound<FloatV> cones = load(mirrors.tree.levels[level][block], first);
                auto start = std::chrono::steady_clock::now();
                for (const Vec3& r : receivers) {
                    rejected[0] += count_of(cones_reject(cones, {broadcast(to_triple(r)), FloatV(0.0F)}, light));
                }
                seconds[0] += seconds_since(start);
                start = std::chrono::steady_clock::now();
                for (const Vec3& r : receivers) {
                    rejected[1] +=
                        count_of(boxes_reject(boxes, point_box(broadcast(to_triple(r))), light_box, sin_acceptance));
                }
                seconds[1] += seconds_since(start);
                tests += receivers.size() * simd_width;
            }
        }
        const auto share = [&](size_t i) { return static_cast<double>(rejected[i]) / static_cast<double>(tests); };
        const auto nanoseconds = [&](size_t i) { return 1e9 * seconds[i] / static_cast<double>(tests); };
        levels.push_back({{"triangles_per_node", run},
                          {"cones_rejected", share(0)},
                          {"boxes_rejected", share(1)},
                          {"cones_nanoseconds", nanoseconds(0)},
                          {"boxes_nanoseconds", nanoseconds(1)}});
    }
    return {{"case", c.name}, {"alpha", alpha}, {"levels", levels}};
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Micro-benchmark of the path-cut search");
    std::string only;
    int repeat = 1, threads = 2;
    std::vector<int> triangles;
    std::vector<float> alphas{0.001F, 0.005F, 0.01F, 0.05F};
    size_t receivers = 10000;
    bool every_triangle = false, visibility = false, bounds = false;
    double alpha_multiple = 0.0, epsilon = 0.01;
    uint64_t budget = 0;
    app.add_option("--case", only, "Run this case only");
    app.add_option("--repeat", repeat, "Take the fastest of so many runs");
    app.add_option("--threads", threads, "Threads");
    app.add_option("--receivers", receivers, "Cached points");
    app.add_option("--triangles", triangles, "Triangle counts");
    app.add_option("--alpha", alphas, "Roughness values");
    app.add_option("--epsilon", epsilon, "Threshold of Eq. 1");
    app.add_option("--alpha-multiple", alpha_multiple, "Accept slopes up to so many alpha, instead of Eq. 1");
    app.add_option("--budget", budget, "Nodes per receiver; 0: no limit");
    app.add_flag("--every-triangle", every_triangle, "Keep a path for every accepted tuple");
    app.add_flag("--visibility", visibility, "Leave out dark triangles and occluded paths");
    app.add_flag("--bounds", bounds, "Compare spheres and cones with boxes instead");
    CLI11_PARSE(app, argc, argv);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
    for (const Case& c : cases()) {
        if (!only.empty() && c.name != only) continue;
        const std::vector<int> counts =
            !triangles.empty() ? triangles : std::vector<int>{c.bounces == 1 ? 30000 : 10000};
        for (const int count : counts) {
            for (const float alpha : alphas) {
                if (bounds) {
                    std::cout << compare_bounds(c, count, alpha) << std::endl;
                    continue;
                }
                SearchOptions options;
                options.bounces = c.bounces;
                options.max_nodes_per_receiver = budget;
                options.selection = every_triangle ? Selection::every_triangle : Selection::local_minima;
                std::cout << run(c, count, alpha, receivers, options, {epsilon, alpha_multiple}, visibility, repeat)
                          << std::endl;
            }
        }
    }
}

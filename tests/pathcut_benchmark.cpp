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

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Micro-benchmark of the path-cut search");
    std::string only;
    int repeat = 1, threads = 2;
    std::vector<int> triangles;
    std::vector<float> alphas{0.001F, 0.005F, 0.01F, 0.05F};
    size_t receivers = 10000;
    bool every_triangle = false, visibility = false;
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
    CLI11_PARSE(app, argc, argv);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
    for (const Case& c : cases()) {
        if (!only.empty() && c.name != only) continue;
        const std::vector<int> counts =
            !triangles.empty() ? triangles : std::vector<int>{c.bounces == 1 ? 30000 : 10000};
        for (const int count : counts) {
            for (const float alpha : alphas) {
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

// The specular paths that the path-cut search finds in a scene, as JSON on standard output: to draw, or to look at one.
//
// pathcut_paths SCENE.glb [--receivers N] [--bounces K] [--size WxH] [--camera NAME]
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "accel/surface.h"
#include "apps/command.h"
#include "core/casters.h"
#include "core/gltf.h"
#include "pathcut/densify.h"
#include "pathcut/path_cut_search.h"
#include "pathcut/receiver_sampler.h"
#include "pathcut/specular_chain.h"

namespace nephroid {

namespace {

using nlohmann::json;

struct Options {
    std::string scene;
    std::string camera;  ///< Empty: the first.
    uint32_t receivers = 10000;
    int bounces = 1;
    int width = 1024;
    int height = 768;
};

void parse_size(const std::string& text, Options& options) {
    constexpr int largest = 65536;
    int width = 0, height = 0, used = 0;
    const int count = std::sscanf(text.c_str(), "%5dx%5d%n", &width, &height, &used);
    const bool in_range = width >= 1 && height >= 1 && width <= largest && height <= largest;
    if (count != 2 || static_cast<size_t>(used) != text.size() || !in_range) {
        throw Error(ExitCode::usage,
                    "--size " + text + ": is not WIDTHxHEIGHT with 1 to 65536 pixels each; write e.g. 1024x768");
    }
    options.width = width;
    options.height = height;
}

/// Nothing where only help was asked for.
std::optional<Options> parse_options(int argc, char** argv) {
    Options options;
    std::string size;
    CLI::App app("Prints the specular paths that the path-cut search finds in a scene, as JSON.", "pathcut_paths");
    app.add_option("scene", options.scene, "glTF file, .gltf or .glb")->required();
    app.add_option("--receivers", options.receivers, "about so many points that the camera sees [10000]")
        ->check(CLI::Range(1, 10'000'000));
    app.add_option("--bounces", options.bounces, "paths of one up to K reflections [1]")
        ->check(CLI::Range(1, static_cast<int>(max_chain_length)));
    app.add_option("--size", size, "film WxH: which part of the scene the camera sees [1024x768]");
    app.add_option("--camera", options.camera, "camera by name [first]");
    if (!parse_command_line(app, argc, argv)) return std::nullopt;
    if (!size.empty()) parse_size(size, options);
    return options;
}

/// As `render` loads it, so that the paths belong to the picture.
Scene load_scene(const Options& options) {
    Scene scene = load_gltf(options.scene);
    flatten_single_use_meshes(scene);
    densify_objects(scene);
    for (const std::string& warning : scene.warnings) std::fprintf(stderr, "warning: %s\n", warning.c_str());
    return scene;
}

Camera choose_camera(const Scene& scene, const Options& options) {
    if (options.camera.empty()) {
        if (!scene.cameras.empty()) return scene.cameras.front();
        const Bounds bounds = world_bounds(scene);
        return bounds.empty() ? Camera() : framing_camera(bounds.min, bounds.max);
    }
    for (const Camera& camera : scene.cameras) {
        if (camera.name == options.camera) return camera;
    }
    throw Error(ExitCode::invalid_input,
                options.scene + ": camera '" + options.camera + "': not in the scene; see render --info for names");
}

std::vector<PathLight> small_path_lights(const Scene& scene, const CasterReport& casters) {
    std::vector<PathLight> lights;
    for (const uint32_t index : casters.small_lights) lights.push_back(make_path_light(scene.lights[index], index));
    return lights;
}

struct Search {
    std::vector<Receiver> receivers;
    std::vector<PathLight> lights;
    ReflectorTree reflectors;
    RepresentativePaths paths;
    double seconds = 0.0;  ///< Trees and search, without the receivers.
};

Search search(const Scene& scene, const Camera& camera, const Options& options) {
    const int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    const CasterReport casters = find_casters(scene);
    const Accelerator accelerator(scene, threads);
    Surfaces surfaces(scene);
    surfaces.set_casters(casters.is_caster);

    Search result;
    const ReceiverSampling sampling{
        .width = options.width,
        .height = options.height,
        .crop = {0, 0, options.width, options.height},
        .count = options.receivers,
    };
    const CameraRays rays = make_camera_rays(camera, options.width, options.height);
    result.receivers = sample_receivers(scene, accelerator, surfaces, rays, sampling);
    result.lights = small_path_lights(scene, casters);

    std::vector<Vec3> positions;
    std::vector<SurfacePoint> points;
    for (const Receiver& r : result.receivers) {
        positions.push_back(r.position);
        points.push_back({Vec3d(r.position), r.geometric_normal, r.error});
    }
    SearchOptions search_options;
    search_options.bounces = options.bounces;
    search_options.accelerator = &accelerator;
    search_options.receiver_points = points;
    const auto start = std::chrono::steady_clock::now();
    result.reflectors = build_reflector_tree(reflector_triangles(scene, casters), AcceptanceOptions());
    result.paths =
        find_representative_paths(result.reflectors, build_receiver_tree(positions), result.lights, search_options);
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
}

template <class Vector>
json to_json(const Vector& v) {
    return {v.x, v.y, v.z};
}

json describe_path(const Scene& scene, const Search& search, const RepresentativePath& path) {
    json vertices = json::array();
    json objects = json::array();
    for (const ReflectorVertex& vertex : search.paths.vertices_of(path)) {
        const Vec2d barycentrics(vertex.b1, vertex.b2);
        vertices.push_back(to_json(evaluate(search.reflectors.patch(vertex.triangle), barycentrics).position));
        objects.push_back(scene.objects[search.reflectors.ids[vertex.triangle].object].name);
    }
    const PathLight& light = search.lights[path.light];
    return {
        {"vertices", vertices},      {"objects", objects},
        {"light", light.index},      {light.at_infinity ? "light_direction" : "light_position", to_json(light.point)},
        {"length", path.length},     {"exact", path.exact},
        {"mirrored", path.mirrored}, {"residual", path.residual}};
}

json describe_receiver(const Scene& scene, const Search& search, size_t index) {
    const Receiver& receiver = search.receivers[index];
    json paths = json::array();
    for (const RepresentativePath& path : search.paths.of_receiver(index)) {
        paths.push_back(describe_path(scene, search, path));
    }
    return {{"position", to_json(receiver.position)},
            {"normal", to_json(receiver.geometric_normal)},
            {"object", scene.objects[receiver.object].name},
            {"paths", paths}};
}

json describe_statistics(const Search& search) {
    const SearchStatistics& s = search.paths.statistics;
    return {{"receivers", search.receivers.size()},
            {"triangles", search.reflectors.size()},
            {"lights", search.lights.size()},
            {"paths", search.paths.paths.size()},
            {"seconds", search.seconds},
            {"nodes_visited", s.nodes_visited},
            {"leaf_cuts", s.leaf_cuts},
            {"solves", s.solves},
            {"iterations", s.iterations},
            {"exact", s.exact},
            {"relaxed", s.relaxed},
            {"continued", s.continued},
            {"merged", s.merged},
            {"occluded", s.occluded},
            {"dropped_cuts", s.dropped_cuts},
            {"dropped_beams", s.dropped_beams},
            {"cut_short", s.cut_short}};
}

/// One receiver per line, written as it is made: the whole tree of a large search would not fit into memory.
void print_paths(const Scene& scene, const Search& search) {
    std::cout << "{\"receivers\": [";
    for (size_t i = 0; i < search.receivers.size(); ++i) {
        std::cout << (i == 0 ? "\n" : ",\n") << describe_receiver(scene, search, i);
    }
    std::cout << "\n],\n\"statistics\": " << describe_statistics(search) << "}\n";
    std::cout.flush();
    if (!std::cout) throw Error(ExitCode::output_failed, "standard output: could not be written; free space there");
}

int run(int argc, char** argv) {
    return run_command("pathcut_paths", "ask for fewer receivers", [&] {
        const std::optional<Options> options = parse_options(argc, argv);
        if (options) {
            const Scene scene = load_scene(*options);
            print_paths(scene, search(scene, choose_camera(scene, *options), *options));
        }
        return ExitCode::done;
    });
}

}  // namespace

}  // namespace nephroid

int main(int argc, char** argv) {
    return nephroid::run(argc, argv);
}

#include "integrators/guided/guided_paths.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <numeric>
#include <span>
#include <utility>

#include "core/delta_light.h"
#include "integrators/driver.h"
#include "integrators/stopwatch.h"
#include "pathcut/curvature.h"

namespace nephroid {

namespace {

/// Points and lights that tell what all will cost.
constexpr uint32_t pilot_points = 64;
constexpr size_t pilot_lights = 8;

/// Measured on a 2.6 GHz core, with all else that a search does for each solve.
constexpr double seconds_per_solve = 6e-6;

/// With a time limit, paths are searched for every so many points first, then for those half-way between, and so on.
constexpr size_t first_stride = 32;

/// Of the time until search_end: the pilot's share.
constexpr double pilot_part = 0.25;
/// Of what it leaves: the rest is for lobes and photons.
constexpr double search_part_of_time = 0.75;
/// The same for paths of one reflection, if longer ones are to be searched too.
constexpr double single_reflection_part = 0.5;

/// The surface seen from its other side: the normal turned around.
PrincipalCurvatures turned_around(const PrincipalCurvatures& surface) {
    return {
        {-surface.curvature[1], -surface.curvature[0]}, {surface.direction[1], surface.direction[0]}, -surface.normal};
}

SearchOptions search_options(const RenderContext& context, const GuidedSettings& settings) {
    SearchOptions options;
    // The last vertex of a path needs a scattering for next event estimation.
    const int longest = settings.long_paths == LongPaths::search ? settings.bounces : 1;
    options.bounces = std::clamp(longest, 1, static_cast<int>(context.max_depth) - 1);
    options.selection = settings.selection;
    options.solver.newton = settings.newton;
    options.merge_distance = settings.merge_distance;
    options.accelerator = &context.accelerator;
    options.keep_occluded = true;
    return options;
}

/// Paths of some of the receivers.
struct PathPart {
    std::vector<uint32_t> receivers;  ///< Indices, ascending.
    RepresentativePaths paths;
    bool is_complete() const { return paths.statistics.dropped_cuts == 0; }
};

/// Stops after this share of what is left of the time for the search.
std::function<bool()> stop_at(const GuidedSettings& settings, double share) {
    if (!settings.search_end) return {};
    const auto now = std::chrono::steady_clock::now();
    const auto end =
        now + std::chrono::duration_cast<std::chrono::steady_clock::duration>(share * (*settings.search_end - now));
    return [end] { return interrupt_requested || std::chrono::steady_clock::now() >= end; };
}

PathPart search_part(const GuidedPaths& found, std::vector<uint32_t> receivers, SearchOptions options) {
    std::vector<Vec3> positions;
    std::vector<SurfacePoint> points;
    for (const uint32_t i : receivers) {
        const Receiver& r = found.receivers[i];
        positions.push_back(r.position);
        points.push_back({Vec3d(r.position), r.geometric_normal, r.error});
    }
    options.receiver_points = points;
    const ReceiverTree tree = build_receiver_tree(positions);
    return {std::move(receivers), find_representative_paths(found.reflectors, tree, found.lights, options)};
}

/// Each receiver's paths, part after part.
RepresentativePaths join(std::span<const PathPart> parts, size_t receiver_count) {
    RepresentativePaths all;
    all.first_path.assign(receiver_count + 1, 0);
    for (const PathPart& part : parts) {
        for (size_t i = 0; i < part.receivers.size(); ++i) {
            all.first_path[part.receivers[i] + 1] += static_cast<uint32_t>(part.paths.of_receiver(i).size());
        }
    }
    for (size_t i = 1; i < all.first_path.size(); ++i) all.first_path[i] += all.first_path[i - 1];
    all.paths.resize(all.first_path.back());
    std::vector<uint32_t> next(all.first_path.begin(), all.first_path.end() - 1);
    for (const PathPart& part : parts) {
        const auto first_vertex = static_cast<uint32_t>(all.vertices.size());
        all.vertices.insert(all.vertices.end(), part.paths.vertices.begin(), part.paths.vertices.end());
        for (size_t i = 0; i < part.receivers.size(); ++i) {
            for (RepresentativePath path : part.paths.of_receiver(i)) {
                path.first_vertex += first_vertex;
                all.paths[next[part.receivers[i]]++] = path;
            }
        }
        all.statistics += part.paths.statistics;
        all.beam_bytes = std::max(all.beam_bytes, part.paths.beam_bytes);
    }
    return all;
}

/// Every `stride`-th receiver: as neighbours follow each other, these lie all over the picture.
std::vector<uint32_t> every_nth(size_t receivers, size_t first, size_t stride) {
    std::vector<uint32_t> indices;
    for (size_t i = first; i < receivers; i += stride) indices.push_back(static_cast<uint32_t>(i));
    return indices;
}

/// At most `most` of the lights, in their order.
std::vector<PathLight> evenly_chosen(const std::vector<PathLight>& lights, size_t most) {
    const size_t count = std::min(lights.size(), most);
    std::vector<PathLight> chosen;
    for (size_t i = 0; i < count; ++i) chosen.push_back(lights[i * lights.size() / count]);
    return chosen;
}

/// Keeps `kept` of the receivers, ascending; each stands for more surface then.
void keep_receivers(std::vector<uint32_t>& kept, std::vector<PathPart>& parts, std::vector<Receiver>& receivers) {
    std::sort(kept.begin(), kept.end());
    const float growth = std::sqrt(static_cast<float>(receivers.size()) / static_cast<float>(kept.size()));
    std::vector<uint32_t> new_index(receivers.size());
    for (size_t i = 0; i < kept.size(); ++i) {
        new_index[kept[i]] = static_cast<uint32_t>(i);
        receivers[i] = receivers[kept[i]];
        receivers[i].footprint *= growth;
    }
    receivers.resize(kept.size());
    for (PathPart& part : parts) {
        for (uint32_t& i : part.receivers) i = new_index[i];
    }
}

/// Paths of one reflection, in rounds if time is short, each as dense as all before together; receivers of the rounds
/// that time has run out for are dropped.
std::vector<PathPart> search_single_reflections(const SearchOptions& options, GuidedPaths& found) {
    std::vector<PathPart> parts;
    std::vector<uint32_t> kept;
    size_t first = 0, stride = options.should_stop ? first_stride : 1;
    for (;;) {
        PathPart part = search_part(found, every_nth(found.receivers.size(), first, stride), options);
        if (!part.is_complete()) break;
        kept.insert(kept.end(), part.receivers.begin(), part.receivers.end());
        parts.push_back(std::move(part));
        // Those half-way between all before.
        if (first > 0) stride /= 2;
        first = stride / 2;
        if (first == 0) break;
    }
    if (kept.size() < found.receivers.size()) keep_receivers(kept, parts, found.receivers);
    return parts;
}

}  // namespace

std::vector<Receiver> choose_receivers(const RenderContext& context, const GuidedView& view, uint32_t count) {
    const ReceiverSampling sampling{
        .width = view.width, .height = view.height, .crop = view.crop, .count = count, .seed = context.seed};
    return sample_receivers(context.scene, context.accelerator, context.surfaces, context.camera_rays, sampling);
}

GuidedPaths prepare_paths(const RenderContext& context, const CasterReport& casters, const GuidedSettings& settings) {
    GuidedPaths prepared;
    prepared.reflectors = build_reflector_tree(reflector_triangles(context.scene, casters), settings.acceptance);
    for (const uint32_t i : casters.small_lights) {
        prepared.lights.push_back(make_path_light(context.scene.lights[i], i));
    }
    return prepared;
}

uint32_t wanted_points(const GuidedView& view, const GuidedSettings& settings) {
    const auto pixels = static_cast<uint32_t>(view.crop.width()) * static_cast<uint32_t>(view.crop.height());
    return std::min(settings.cached_points, pixels);
}

uint32_t affordable_points(const RenderContext& context, const GuidedPaths& prepared, const GuidedView& view,
                           const GuidedSettings& settings) {
    const uint32_t wanted = wanted_points(view, settings);
    if (wanted <= pilot_points) return wanted;
    const std::vector<Receiver> pilot = choose_receivers(context, view, pilot_points);
    std::vector<Vec3> positions;
    for (const Receiver& r : pilot) positions.push_back(r.position);
    const std::vector<PathLight> lights = evenly_chosen(prepared.lights, pilot_lights);
    SearchOptions options = search_options(context, settings);
    options.bounces = 1;
    options.accelerator = nullptr;
    options.should_stop = stop_at(settings, pilot_part);
    const RepresentativePaths paths =
        find_representative_paths(prepared.reflectors, build_receiver_tree(positions), lights, options);
    if (paths.statistics.cut_short > 0) return pilot_points;
    const double all_lights = static_cast<double>(prepared.lights.size()) / static_cast<double>(lights.size());
    const double solves = all_lights * static_cast<double>(paths.statistics.solves) / pilot_points;
    const double affordable = settings.search_seconds / (seconds_per_solve * std::max(solves, 1.0));
    return static_cast<uint32_t>(std::clamp(affordable, double{pilot_points}, static_cast<double>(wanted)));
}

void search_paths(const RenderContext& context, const GuidedSettings& settings, GuidedPaths& found,
                  GuidedStatistics& statistics) {
    if (!found.is_searched) {
        found.paths.first_path.assign(found.receivers.size() + 1, 0);
        return;
    }
    Stopwatch stopwatch;
    SearchOptions options = search_options(context, settings);
    const int longest = options.bounces;
    options.bounces = 1;
    options.should_stop = stop_at(settings, longest > 1 ? single_reflection_part : search_part_of_time);
    std::vector<PathPart> parts = search_single_reflections(options, found);
    if (longest > 1) {
        options.shortest = 2;
        options.bounces = longest;
        options.should_stop = stop_at(settings, search_part_of_time);
        parts.push_back(search_part(found, every_nth(found.receivers.size(), 0, 1), options));
    }
    found.paths = join(parts, found.receivers.size());
    statistics.seconds_search = stopwatch.lap();
    statistics.search = found.paths.statistics;
    statistics.seconds_solve = found.paths.statistics.solver_seconds / tbb::this_task_arena::max_concurrency();
    statistics.paths = found.paths.paths.size();
}

void add_receivers(const RenderContext& context, const GuidedSettings& settings, std::span<const Receiver> more,
                   GuidedPaths& found, GuidedStatistics& statistics) {
    Stopwatch stopwatch;
    SearchOptions options = search_options(context, settings);
    options.bounces = 1;
    options.should_stop = stop_at(settings, 1.0);
    const size_t before = found.receivers.size();
    std::vector<PathPart> parts;
    parts.push_back({every_nth(before, 0, 1), std::move(found.paths)});
    found.receivers.insert(found.receivers.end(), more.begin(), more.end());
    std::vector<uint32_t> added(more.size());
    std::iota(added.begin(), added.end(), static_cast<uint32_t>(before));
    parts.push_back(search_part(found, std::move(added), options));
    found.paths = join(parts, found.receivers.size());
    statistics.seconds_search += stopwatch.lap();
    statistics.search = found.paths.statistics;
    statistics.paths = found.paths.paths.size();
}

GuidedPaths find_guided_paths(const RenderContext& context, const CasterReport& casters,
                              std::vector<Receiver> receivers, const GuidedSettings& settings,
                              GuidedStatistics& statistics) {
    GuidedPaths found = prepare_paths(context, casters, settings);
    found.receivers = std::move(receivers);
    search_paths(context, settings, found, statistics);
    return found;
}

bool has_long_paths(const GuidedPaths& found) {
    const auto& paths = found.paths.paths;
    return std::any_of(paths.begin(), paths.end(), [](const RepresentativePath& path) { return path.length > 1; });
}

PerVertex<GlossyVertex> glossy_vertices(const RenderContext& context, const GuidedPaths& found,
                                        const RepresentativePath& path, const Vec3d& receiver) {
    PerVertex<GlossyVertex> vertices;
    Vec3d viewer = receiver;
    const auto path_vertices = found.paths.vertices_of(path);
    for (size_t i = 0; i < path_vertices.size(); ++i) {
        const ReflectorVertex& vertex = path_vertices[i];
        const SurfacePatch patch = found.reflectors.patch(vertex.triangle);
        const Vec2d barycentrics(vertex.b1, vertex.b2);
        GlossyVertex& result = vertices[i];
        result.position = evaluate(patch, barycentrics).position;
        result.surface = principal_curvatures(patch, barycentrics);
        const Vec3d wo = glm::normalize(viewer - result.position);
        if (glm::dot(result.surface.normal, wo) < 0.0) result.surface = turned_around(result.surface);
        const TriangleId& id = found.reflectors.ids[vertex.triangle];
        result.bsdf = context.surfaces.interact(id.object, id.primitive, vertex.b1, vertex.b2, Vec3(wo)).bsdf;
        viewer = result.position;
    }
    return vertices;
}

PathEmitter emitter_at(const RenderContext& context, const PathLight& light, const Vec3d& y) {
    const Vec3 p(y);
    const auto irradiance = sample_delta_light(context.scene.lights[light.index], to_triple(p)).irradiance;
    const double angle = light.radius > 0.0F ? double{light.radius} / glm::length(Vec3d(light.point) - y) : 0.0;
    return {light.end(), angle, double{luminance(irradiance)}};
}

CachedPoint make_cached_point(const Receiver& receiver, size_t first_lobe, size_t lobe_count) {
    CachedPoint point;
    point.position = receiver.position;
    point.normal = receiver.geometric_normal;
    point.reach = reach_in_footprints * receiver.footprint;
    point.first_lobe = static_cast<uint32_t>(first_lobe);
    point.lobe_count = static_cast<uint32_t>(lobe_count);
    return point;
}

}  // namespace nephroid

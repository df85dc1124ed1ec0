#include "integrators/guided/guided_paths.h"

#include <tbb/task_arena.h>

#include <algorithm>

#include "core/delta_light.h"
#include "integrators/guided/stopwatch.h"
#include "pathcut/curvature.h"

namespace nephroid {

namespace {

/// A cached point serves shading points up to so many times the spacing of cached points away.
constexpr float reach_in_footprints = 4.0F;

/// Points that tell what all will cost.
constexpr uint32_t pilot_points = 200;

/// Measured on a 2.6 GHz core, with all else that a search does for each solve.
constexpr double seconds_per_solve = 6e-6;

/// The surface seen from its other side: the normal turned around.
PrincipalCurvatures turned_around(const PrincipalCurvatures& surface) {
    return {
        {-surface.curvature[1], -surface.curvature[0]}, {surface.direction[1], surface.direction[0]}, -surface.normal};
}

SearchOptions search_options(const RenderContext& context, const GuidedSettings& settings,
                             std::span<const SurfacePoint> receiver_points) {
    SearchOptions options;
    // The last vertex of a path needs a scattering for next event estimation.
    options.bounces = std::clamp(settings.bounces, 1, static_cast<int>(context.max_depth) - 1);
    options.selection = settings.selection;
    options.solver.newton = settings.newton;
    options.merge_distance = settings.merge_distance;
    options.accelerator = &context.accelerator;
    options.receiver_points = receiver_points;
    options.keep_occluded = true;
    return options;
}

}  // namespace

std::vector<Receiver> choose_receivers(const RenderContext& context, const GuidedView& view, uint32_t count) {
    const ReceiverSampling sampling{
        .width = view.width, .height = view.height, .crop = view.crop, .count = count, .seed = context.seed};
    return sample_receivers(context.scene, context.accelerator, context.surfaces, context.camera_rays, sampling);
}

uint32_t affordable_points(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                           const GuidedSettings& settings) {
    if (settings.cached_points <= pilot_points) return settings.cached_points;
    GuidedSettings pilot = settings;
    pilot.bounces = 1;
    GuidedStatistics statistics;
    find_guided_paths(context, casters, choose_receivers(context, view, pilot_points), pilot, statistics);
    const double solves = static_cast<double>(statistics.search.solves) / pilot_points;
    const double affordable = settings.search_seconds / (seconds_per_solve * std::max(solves, 1.0));
    return static_cast<uint32_t>(std::clamp(affordable, double{pilot_points}, static_cast<double>(settings.cached_points)));
}

GuidedPaths find_guided_paths(const RenderContext& context, const CasterReport& casters,
                              std::vector<Receiver> receivers, const GuidedSettings& settings,
                              GuidedStatistics& statistics) {
    GuidedPaths found;
    found.receivers = std::move(receivers);
    Stopwatch stopwatch;
    found.reflectors = build_reflector_tree(reflector_triangles(context.scene, casters), settings.acceptance);
    std::vector<Vec3> positions;
    std::vector<SurfacePoint> points;
    for (const Receiver& r : found.receivers) {
        positions.push_back(r.position);
        points.push_back({Vec3d(r.position), r.geometric_normal, r.error});
    }
    const ReceiverTree receiver_tree = build_receiver_tree(positions);
    statistics.seconds_hierarchy = stopwatch.lap();

    for (const uint32_t i : casters.small_lights) found.lights.push_back(make_path_light(context.scene.lights[i], i));
    found.paths = find_representative_paths(found.reflectors, receiver_tree, found.lights,
                                            search_options(context, settings, points));
    statistics.seconds_search = stopwatch.lap();
    statistics.search = found.paths.statistics;
    statistics.seconds_solve = found.paths.statistics.solver_seconds / tbb::this_task_arena::max_concurrency();
    statistics.paths = found.paths.paths.size();
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

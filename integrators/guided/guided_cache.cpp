#include "integrators/guided/guided_cache.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>

#include "core/delta_light.h"
#include "guiding/sg_path.h"
#include "pathcut/curvature.h"
#include "pathcut/receiver_sampler.h"

namespace nephroid {

namespace {

using Clock = std::chrono::steady_clock;

/// A cached point serves shading points up to so many times the spacing of cached points away.
constexpr float reach_in_footprints = 4.0F;

/// What an occluded representative path is still worth: part of its glossy region may be lit.
constexpr float occluded_weight = 0.1F;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The surface seen from its other side: the normal turned around.
PrincipalCurvatures turned_around(const PrincipalCurvatures& surface) {
    return {
        {-surface.curvature[1], -surface.curvature[0]}, {surface.direction[1], surface.direction[0]}, -surface.normal};
}

/// Makes the lobes of one receiver after the other.
class LobeMaker {
  public:
    LobeMaker(const RenderContext& context, const ReflectorTree& reflectors, const std::vector<PathLight>& lights,
              const RepresentativePaths& paths)
        : context_(context), reflectors_(reflectors), lights_(lights), paths_(paths) {}

    /// With weights that sum to one; none where no path brings light.
    std::vector<SgLobe> lobes_of(const Receiver& receiver, size_t index) const {
        std::vector<SgLobe> lobes;
        float total = 0.0F;
        for (const RepresentativePath& path : paths_.of_receiver(index)) {
            const SgLobe lobe = lobe_of(receiver, path);
            if (!(lobe.weight > 0.0F) || !std::isfinite(lobe.weight)) continue;
            lobes.push_back(lobe);
            total += lobe.weight;
        }
        if (!std::isfinite(total)) return {};
        for (SgLobe& lobe : lobes) lobe.weight /= total;
        return lobes;
    }

  private:
    SgLobe lobe_of(const Receiver& receiver, const RepresentativePath& path) const {
        const Vec3d x(receiver.position);
        PerVertex<GlossyVertex> vertices;
        Vec3d viewer = x;
        const auto found = paths_.vertices_of(path);
        for (size_t i = 0; i < found.size(); ++i) {
            vertices[i] = glossy_vertex(found[i], viewer);
            viewer = vertices[i].position;
        }
        SgLobe lobe = make_sg_lobe(x, std::span(vertices).first(found.size()), emitter(lights_[path.light], viewer));
        if (path.occluded) lobe.weight *= occluded_weight;
        return lobe;
    }

    GlossyVertex glossy_vertex(const ReflectorVertex& vertex, const Vec3d& viewer) const {
        const SurfacePatch patch = reflectors_.patch(vertex.triangle);
        const Vec2d barycentrics(vertex.b1, vertex.b2);
        GlossyVertex result;
        result.position = evaluate(patch, barycentrics).position;
        result.surface = principal_curvatures(patch, barycentrics);
        const Vec3d wo = glm::normalize(viewer - result.position);
        if (glm::dot(result.surface.normal, wo) < 0.0) result.surface = turned_around(result.surface);
        const TriangleId& id = reflectors_.ids[vertex.triangle];
        result.bsdf = context_.surfaces.interact(id.object, id.primitive, vertex.b1, vertex.b2, Vec3(wo)).bsdf;
        return result;
    }

    PathEmitter emitter(const PathLight& light, const Vec3d& y) const {
        const Vec3 p(y);
        const auto irradiance = sample_delta_light(context_.scene.lights[light.index], to_triple(p)).irradiance;
        const double angle = light.radius > 0.0F ? double{light.radius} / glm::length(Vec3d(light.point) - y) : 0.0;
        return {light.end(), angle, luminance(irradiance)};
    }

    const RenderContext& context_;
    const ReflectorTree& reflectors_;
    const std::vector<PathLight>& lights_;
    const RepresentativePaths& paths_;
};

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

/// Cached points and their lobes, receiver after receiver.
LobeCache<SgLobe> collect(const std::vector<Receiver>& receivers, const std::vector<std::vector<SgLobe>>& lobes) {
    LobeCache<SgLobe> cache;
    cache.points.reserve(receivers.size());
    for (size_t i = 0; i < receivers.size(); ++i) {
        const Receiver& receiver = receivers[i];
        cache.points.push_back({receiver.position, receiver.geometric_normal, reach_in_footprints * receiver.footprint,
                                static_cast<uint32_t>(cache.lobes.size()), static_cast<uint32_t>(lobes[i].size())});
        cache.lobes.insert(cache.lobes.end(), lobes[i].begin(), lobes[i].end());
    }
    cache.lookup = CachedPointLookup(cache.points);
    return cache;
}

}  // namespace

LobeCache<SgLobe> build_sg_cache(const RenderContext& context, const CasterReport& casters, const GuidedView& view,
                                 const GuidedSettings& settings, GuidedStatistics& statistics) {
    Clock::time_point start = Clock::now();
    const ReceiverSampling sampling{.width = view.width,
                                    .height = view.height,
                                    .crop = view.crop,
                                    .count = settings.cached_points,
                                    .seed = context.seed};
    const std::vector<Receiver> receivers =
        sample_receivers(context.scene, context.accelerator, context.surfaces, context.camera_rays, sampling);
    statistics.seconds_receivers = seconds_since(start);

    start = Clock::now();
    AcceptanceOptions acceptance;
    acceptance.epsilon = settings.epsilon;
    const ReflectorTree reflectors = build_reflector_tree(reflector_triangles(context.scene, casters), acceptance);
    std::vector<Vec3> positions;
    std::vector<SurfacePoint> points;
    for (const Receiver& r : receivers) {
        positions.push_back(r.position);
        points.push_back({Vec3d(r.position), r.geometric_normal, r.error});
    }
    const ReceiverTree receiver_tree = build_receiver_tree(positions);
    statistics.seconds_hierarchy = seconds_since(start);

    start = Clock::now();
    std::vector<PathLight> lights;
    for (const uint32_t i : casters.small_lights) lights.push_back(make_path_light(context.scene.lights[i], i));
    const RepresentativePaths paths =
        find_representative_paths(reflectors, receiver_tree, lights, search_options(context, settings, points));
    statistics.seconds_search = seconds_since(start);
    statistics.search = paths.statistics;
    statistics.paths = paths.paths.size();

    start = Clock::now();
    const LobeMaker maker(context, reflectors, lights, paths);
    std::vector<std::vector<SgLobe>> lobes(receivers.size());
    tbb::parallel_for(size_t{0}, receivers.size(), [&](size_t i) { lobes[i] = maker.lobes_of(receivers[i], i); });
    LobeCache<SgLobe> cache = collect(receivers, lobes);
    statistics.seconds_lobes = seconds_since(start);
    statistics.cached_points = cache.points.size();
    statistics.lobes = cache.lobes.size();
    statistics.bytes = cache.bytes();
    return cache;
}

}  // namespace nephroid

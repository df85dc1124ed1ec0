#include "integrators/guided/highlights.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/sampler.h"
#include "guiding/slope_path.h"
#include "integrators/guided/film_deviation.h"
#include "integrators/guided/mirrored_lamps.h"
#include "integrators/guided/slope_lobe_maker.h"

namespace nephroid {

namespace {

/// Further film positions in highlights, for each sample of each pixel of the picture.
constexpr double added_positions = 0.05;

/// Points over the footprint of a path of several reflections on its first mirror, and what they stand for in pixels:
/// where mirrors are close to each other, the light between them changes within a pixel.
constexpr uint32_t points_of_mirror = 16;
constexpr float mirror_spacing = 0.25F;

/// The pinhole's paths, of one reflection and more. Occluded ones of one are kept: where the lamp is only just hidden,
/// its glow is not.
RepresentativePaths find_pinhole_paths(const RenderContext& context, const GuidedPaths& prepared,
                                       const PixelRegion& crop, const GuidedSettings& settings) {
    const std::array<Vec3, 1> pinhole{context.camera_rays.origin_base};
    SearchOptions options;
    options.solver.newton = settings.newton;
    RepresentativePaths paths =
        find_representative_paths(prepared.reflectors, build_receiver_tree(pinhole), prepared.lights, options);
    int longest = settings.bounces;
    if (longest > 1 && settings.long_paths == LongPaths::photons) longest = max_chain_length;
    longest = std::min(longest, static_cast<int>(context.max_depth));
    for (FoundPath& found : find_mirrored_lamps(context, prepared, crop, longest, options.solver)) {
        found.path.first_vertex = static_cast<uint32_t>(paths.vertices.size());
        paths.paths.push_back(found.path);
        paths.vertices.insert(paths.vertices.end(), found.vertices.begin(), found.vertices.begin() + found.path.length);
    }
    paths.first_path = {0, static_cast<uint32_t>(paths.paths.size())};
    return paths;
}

/// The pinhole, as a receiver of what comes from y.
Receiver pinhole_towards(const CameraRays& rays, const Vec3d& y) {
    Receiver receiver;
    receiver.position = rays.origin_base;
    receiver.geometric_normal = glm::normalize(Vec3(y - Vec3d(rays.origin_base)));
    return receiver;
}

/// Of all paths that are of use.
std::vector<FilmLobe> film_lobes(const RenderContext& context, const GuidedPaths& prepared) {
    const SlopeLobeMaker maker(context, prepared);
    std::vector<FilmLobe> lobes;
    for (const RepresentativePath& path : prepared.paths.of_receiver(0)) {
        const auto vertices = prepared.paths.vertices_of(path);
        const auto position = [&](const ReflectorVertex& vertex) {
            return evaluate(prepared.reflectors.patch(vertex.triangle), Vec2d(vertex.b1, vertex.b2)).position;
        };
        const Receiver receiver = pinhole_towards(context.camera_rays, position(vertices.front()));
        const CachedSlopeLobe<float> lobe = maker.lobe_of(receiver, path);
        if (!(lobe.weight > 0.0F)) continue;
        const SlopeLobe<float> at_pinhole = unmoved(lobe, receiver.position);
        if (!is_usable(at_pinhole)) continue;
        // What a white wall in the last mirror's place would show.
        const double irradiance =
            emitter_at(context, prepared.lights[path.light], position(vertices.back())).irradiance;
        lobes.push_back({at_pinhole, lobe.weight, static_cast<float>(irradiance) * inv_pi, path.light, path.length});
    }
    return lobes;
}

/// Points of the lobe on the first mirror: its centre first, then points about evenly spread.
void add_mirrors(const RenderContext& context, const SlopeLobe<float>& lobe, std::vector<Receiver>& mirrors) {
    const CameraRays& rays = context.camera_rays;
    const CameraProjection projection(rays);
    for (uint32_t i = 0; i < points_of_mirror; ++i) {
        const auto [u, v] = sample_2d(SamplerKind::sobol, 0U, i, 0);
        const Vec3 direction = i == 0 ? to_vec3(lobe.axis) : sample_slope_lobe(lobe, 1.0F, u, v);
        const Hit hit = context.accelerator.intersect({rays.origin_base, direction});
        if (hit.object >= context.surfaces.object_count() || !context.surfaces.is_caster(hit.object)) continue;
        const SurfaceInteraction s = context.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -direction);
        const float rays_per_solid_angle = projection.view_along(to_triple(direction)).pixel_density;
        const float pixel = glm::length(s.position - rays.origin_base) / std::sqrt(rays_per_solid_angle);
        mirrors.push_back({s.position, s.error, s.geometric_normal, s.shading_normal, s.bsdf.alpha,
                           mirror_spacing * pixel, hit.object});
    }
}

}  // namespace

Highlights find_highlights(const RenderContext& context, GuidedPaths& prepared, const GuidedView& view,
                           const GuidedSettings& settings) {
    const CameraRays& rays = context.camera_rays;
    if (rays.direction_dx == Vec3(0.0F)) return {};
    prepared.paths = find_pinhole_paths(context, prepared, view.crop, settings);
    std::vector<FilmLobe> lobes = film_lobes(context, prepared);
    prepared.paths = {};
    Highlights highlights{FilmGuide(rays, lobes), {}};
    highlights.film.add_positions(added_positions * view.crop.width() * view.crop.height(),
                                  film_deviations(context, prepared.lights, highlights.film));
    std::erase_if(lobes, [](const FilmLobe& lobe) { return lobe.reflections == 1; });
    std::stable_sort(lobes.begin(), lobes.end(),
                     [](const FilmLobe& a, const FilmLobe& b) { return a.irradiance > b.irradiance; });
    for (const FilmLobe& lobe : lobes) add_mirrors(context, lobe.lobe, highlights.mirrors);
    return highlights;
}

}  // namespace nephroid

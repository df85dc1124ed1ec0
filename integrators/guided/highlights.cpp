#include "integrators/guided/highlights.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/sampler.h"
#include "guiding/slope_path.h"
#include "integrators/guided/mirrored_lamps.h"
#include "integrators/guided/slope_lobe_maker.h"

namespace nephroid {

namespace {

/// Further film positions in highlights, for each sample of each pixel of the picture.
constexpr double added_positions = 0.05;

/// Film positions that tell how much one of them deviates.
constexpr uint32_t measured_positions = 32;

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
        paths.vertices.insert(paths.vertices.end(), found.vertices.begin(),
                              found.vertices.begin() + found.path.length);
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

/// Points of the first mirrors over what the lobes cover: each lobe's centre first, then points about evenly spread.
void add_mirrors(const RenderContext& context, const SlopeLobe<float>& lobe, std::vector<Receiver>& mirrors) {
    const CameraProjection projection(context.camera_rays);
    for (uint32_t i = 0; i < points_of_mirror; ++i) {
        const auto [u, v] = sample_2d(SamplerKind::sobol, 0U, i, 0);
        const Vec3 direction = i == 0 ? to_vec3(lobe.axis) : sample_slope_lobe(lobe, 1.0F, u, v);
        const Hit hit = context.accelerator.intersect({context.camera_rays.origin_base, direction});
        if (hit.object >= context.surfaces.object_count() || !context.surfaces.is_caster(hit.object)) continue;
        const SurfaceInteraction s = context.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -direction);
        const float pixel =
            glm::length(s.position - context.camera_rays.origin_base) /
            std::sqrt(projection.view_along(to_triple(direction)).pixel_density);
        mirrors.push_back({s.position, s.error, s.geometric_normal, s.shading_normal, s.bsdf.alpha,
                           mirror_spacing * pixel, hit.object});
    }
}

/// How much the light of one position deviates in each pixel, W/(m^2 sr): measured for one reflection, where the lamps'
/// light shows it; for more, what the lobes tell.
std::vector<float> measure_deviations(const RenderContext& context, const std::vector<PathLight>& lights,
                                      const FilmGuide& film) {
    std::vector<float> deviations(film.pixels().size());
    tbb::parallel_for(size_t{0}, deviations.size(), [&](size_t p) {
        const FilmGuide::Pixel& pixel = film.pixels()[p];
        std::vector<uint32_t> shining;
        float longer = 0.0F;
        for (uint32_t i = 0; i < pixel.count; ++i) {
            const FilmLobe& lobe = film.lobe(pixel, i);
            if (lobe.reflections > 1) longer = pixel.radiance;
            if (lobe.reflections == 1 && std::find(shining.begin(), shining.end(), lobe.light) == shining.end()) {
                shining.push_back(lobe.light);
            }
        }
        float sum = 0.0F, squares = 0.0F;
        for (uint32_t i = 0; i < measured_positions && !shining.empty(); ++i) {
            const auto [u, v] = sample_2d(SamplerKind::sobol, 0U, i, 0);
            const auto [choice, pick] = sample_2d(SamplerKind::sobol, 0U, i, 1);
            const FilmGuide::Position position = film.sample_inside(pixel, choice, u, v, pick);
            if (!(position.weight > 0.0F)) continue;
            const Vec3 direction = to_vec3(context.camera_rays.direction(position.film.x, position.film.y));
            Receiver pinhole;
            pinhole.position = context.camera_rays.origin_base;
            pinhole.geometric_normal = direction;
            float radiance = 0.0F;
            for (const uint32_t light : shining) {
                radiance += reflected_radiance(context, pinhole, lights[light], direction);
            }
            sum += position.weight * radiance;
            squares += position.weight * position.weight * radiance * radiance;
        }
        const float mean = sum / measured_positions;
        deviations[p] = longer + std::sqrt(std::max(squares / measured_positions - mean * mean, 0.0F));
    });
    return deviations;
}

}  // namespace

Highlights find_highlights(const RenderContext& context, GuidedPaths& prepared, const GuidedView& view,
                           const GuidedSettings& settings) {
    const CameraRays& rays = context.camera_rays;
    if (rays.direction_dx == Vec3(0.0F)) return {};
    prepared.paths = find_pinhole_paths(context, prepared, view.crop, settings);
    const SlopeLobeMaker maker(context, prepared);
    std::vector<FilmLobe> lobes, mirrored;  // The latter: by more than one reflection.
    for (const RepresentativePath& path : prepared.paths.of_receiver(0)) {
        const auto vertices = prepared.paths.vertices_of(path);
        const auto position = [&](const ReflectorVertex& vertex) {
            return evaluate(prepared.reflectors.patch(vertex.triangle), Vec2d(vertex.b1, vertex.b2)).position;
        };
        const Receiver receiver = pinhole_towards(rays, position(vertices.front()));
        const CachedSlopeLobe<float> lobe = maker.lobe_of(receiver, path);
        if (!(lobe.weight > 0.0F)) continue;
        const SlopeLobe<float> at_pinhole = unmoved(lobe, receiver.position);
        if (!is_usable(at_pinhole)) continue;
        // What a white wall in the last mirror's place would show.
        const double irradiance =
            emitter_at(context, prepared.lights[path.light], position(vertices.back())).irradiance;
        lobes.push_back(
            {at_pinhole, lobe.weight, static_cast<float>(irradiance) * inv_pi, path.light, path.length});
        if (path.length > 1) mirrored.push_back(lobes.back());
    }
    prepared.paths = {};
    Highlights highlights{FilmGuide(rays, lobes), {}};
    const std::vector<float> deviations = measure_deviations(context, prepared.lights, highlights.film);
    highlights.film.add_positions(added_positions * view.crop.width() * view.crop.height(), deviations);
    std::stable_sort(mirrored.begin(), mirrored.end(),
                     [](const FilmLobe& a, const FilmLobe& b) { return a.irradiance > b.irradiance; });
    for (const FilmLobe& lobe : mirrored) add_mirrors(context, lobe.lobe, highlights.mirrors);
    return highlights;
}

}  // namespace nephroid

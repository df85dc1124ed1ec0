#include "integrators/guided/highlights.h"

#include <array>

#include "guiding/slope_path.h"
#include "integrators/guided/slope_lobe_maker.h"

namespace nephroid {

namespace {

/// Further film positions in highlights, for each sample of each pixel of the picture.
constexpr double added_positions = 0.05;

}  // namespace

FilmGuide find_highlights(const RenderContext& context, GuidedPaths& prepared, const GuidedView& view,
                          const GuidedSettings& settings) {
    const CameraRays& rays = context.camera_rays;
    if (rays.direction_dx == Vec3(0.0F)) return {};
    // Occluded paths are kept: where the lamp is only just hidden, its glow is not.
    SearchOptions options;
    options.solver.newton = settings.newton;
    const std::array<Vec3, 1> pinhole{rays.origin_base};
    prepared.paths =
        find_representative_paths(prepared.reflectors, build_receiver_tree(pinhole), prepared.lights, options);
    const SlopeLobeMaker maker(context, prepared);
    std::vector<FilmLobe> lobes;
    for (const RepresentativePath& path : prepared.paths.of_receiver(0)) {
        const ReflectorVertex& vertex = prepared.paths.vertices_of(path).front();
        const SurfacePatch patch = prepared.reflectors.patch(vertex.triangle);
        const Vec3d y = evaluate(patch, Vec2d(vertex.b1, vertex.b2)).position;
        Receiver receiver;
        receiver.position = rays.origin_base;
        receiver.geometric_normal = glm::normalize(Vec3(y - Vec3d(rays.origin_base)));
        const CachedSlopeLobe<float> lobe = maker.lobe_of(receiver, path);
        if (!(lobe.weight > 0.0F)) continue;
        // What a white wall in the mirror's place would show.
        const double irradiance = emitter_at(context, prepared.lights[path.light], y).irradiance;
        const SlopeLobe<float> at_pinhole = unmoved(lobe, receiver.position);
        if (!is_usable(at_pinhole)) continue;
        lobes.push_back({at_pinhole, lobe.weight, static_cast<float>(irradiance) * inv_pi});
    }
    prepared.paths = {};
    FilmGuide guide(rays, lobes);
    guide.add_positions(added_positions * view.crop.width() * view.crop.height());
    return guide;
}

}  // namespace nephroid

#include "integrators/guided/lobe_weight.h"

#include <algorithm>
#include <cmath>

#include "core/delta_light.h"
#include "core/rounding.h"
#include "guiding/slope_path.h"

namespace nephroid {

namespace {

/// Least weight of a lobe, as a share of what it would bring unoccluded.
constexpr float least_share = 0.05F;

/// Where the lobe is looked at beside its centre, in units of its width: (1 + r^2)^2 P22 is about evenly spread there.
constexpr float sample_radius = 0.83F;

float reflected_luminance(const BsdfParameters<float>& bsdf, const Vec3& normal, const Vec3& wo, const Vec3& wi) {
    const Frame<float> frame = make_frame(to_triple(normal));
    return luminance(evaluate_bsdf(bsdf, frame.to_local(to_triple(wo)), frame.to_local(to_triple(wi))).value);
}

bool is_lit(const RenderContext& context, const SurfaceInteraction& surface, const PathLight& light, const Vec3& wi) {
    const Vec3 origin = offset_ray_origin(surface.position, surface.error, surface.geometric_normal, wi);
    if (light.at_infinity) return !context.accelerator.occluded({origin, wi});
    const Vec3 to_light = light.point - origin;
    // A sphere light's own surface is not in the way.
    const float end = 1.0F - 1e-5F - light.radius / glm::length(to_light);
    return !context.accelerator.occluded({origin, to_light, end});
}

}  // namespace

float reflected_radiance(const RenderContext& context, const Receiver& receiver, const PathLight& light,
                         const Vec3& direction) {
    const Vec3 origin = offset_ray_origin(receiver.position, receiver.error, receiver.geometric_normal, direction);
    const Hit hit = context.accelerator.intersect({origin, direction});
    if (hit.object >= context.surfaces.object_count()) return 0.0F;
    const SurfaceInteraction surface = context.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -direction);
    const auto sample = sample_delta_light(context.scene.lights[light.index], to_triple(surface.position));
    const Vec3 wi = to_vec3(sample.wi);
    if (!(glm::dot(surface.geometric_normal, wi) > 0.0F)) return 0.0F;
    const float radiance =
        luminance(sample.irradiance) * reflected_luminance(surface.bsdf, surface.shading_normal, -direction, wi);
    return radiance > 0.0F && is_lit(context, surface, light, wi) ? radiance : 0.0F;
}

float LobeWeights::of(const Receiver& receiver, const RepresentativePath& path, double density,
                      const CachedSlopeLobe<float>& lobe) const {
    const auto expected = static_cast<float>(unoccluded(receiver, path, density));
    if (!(expected > 0.0F) || !std::isfinite(expected)) return 0.0F;
    if (path.length > 1) return path.occluded ? least_share * expected : expected;
    const SlopeLobe<float> at_receiver = unmoved(lobe, receiver.position);
    const float scale = at_receiver.determinant() * inv_pi;
    float sum = 0.0F;
    constexpr std::array<Vec2, 5> points{Vec2(0.0F, 0.0F), Vec2(sample_radius, 0.0F), Vec2(-sample_radius, 0.0F),
                                         Vec2(0.0F, sample_radius), Vec2(0.0F, -sample_radius)};
    for (const Vec2& m : points) {
        const Vec3 direction = direction_at_slope(at_receiver, m);
        const float pdf = scale * relative_density(at_receiver, to_triple(direction));
        if (!(pdf > 0.0F) || !std::isfinite(pdf)) continue;
        const float cosine = std::max(glm::dot(receiver.geometric_normal, direction), 0.0F);
        sum += std::min(reflected_radiance(context_, receiver, found_.lights[path.light], direction) * cosine / pdf,
                        expected);
    }
    return std::max(sum / static_cast<float>(points.size()), least_share * expected);
}

/// The path's contribution over its density, without visibility.
double LobeWeights::unoccluded(const Receiver& receiver, const RepresentativePath& path, double density) const {
    const Vec3d x(receiver.position);
    const PerVertex<GlossyVertex> vertices = glossy_vertices(context_, found_, path, x);
    const PathLight& light = found_.lights[path.light];
    const auto reflector = found_.paths.vertices_of(path);
    double contribution = emitter_at(context_, light, vertices[path.length - 1U].position).irradiance;
    for (size_t i = path.length; i-- > 0;) {
        const Vec3d& y = vertices[i].position;
        const Vec3d to_viewer = (i == 0 ? x : vertices[i - 1].position) - y;
        const double squared_distance = glm::dot(to_viewer, to_viewer);
        const Vec3d wo = to_viewer / std::sqrt(squared_distance);
        Vec3d wi = light.at_infinity ? Vec3d(light.point) : glm::normalize(Vec3d(light.point) - y);
        if (i + 1 < path.length) wi = glm::normalize(vertices[i + 1].position - y);
        const Vec3d geometric_normal = found_.reflectors.patch(reflector[i].triangle).geometric_normal;
        contribution *=
            double{reflected_luminance(vertices[i].bsdf, Vec3(vertices[i].surface.normal), Vec3(wo), Vec3(wi))};
        contribution *= std::abs(glm::dot(geometric_normal, wo)) / squared_distance;
        if (i == 0) contribution *= std::max(-glm::dot(Vec3d(receiver.geometric_normal), wo), 0.0);
    }
    return contribution / density;
}

}  // namespace nephroid

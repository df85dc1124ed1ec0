#include "core/light_emission.h"

#include <algorithm>
#include <cmath>

#include "core/delta_light.h"
#include "core/frame.h"
#include "core/rounding.h"
#include "core/warp.h"

namespace nephroid {

namespace {

Bounds emission_bounds(const Scene& scene) {
    Bounds bounds = world_bounds(scene);
    for (const PunctualLight& light : scene.lights) {
        if (light.kind != LightKind::sphere) continue;
        bounds.extend(light.position - Vec3(light.radius));
        bounds.extend(light.position + Vec3(light.radius));
    }
    return bounds;
}

/// Directions of a spot light in proportion to its fall-off ((cos - outer) / width)^2, clamped to 1: the cosine's
/// cumulative distribution is a cubic, then linear.
struct SpotProfile {
    float outer, width, flat_from;
    float ramp_mass, flat_mass;

    explicit SpotProfile(const PunctualLight& light)
        : outer(light.cos_outer), width(std::max(light.cos_inner - light.cos_outer, 1e-3F)) {
        flat_from = std::min(outer + width, 1.0F);
        const float top = (flat_from - outer) / width;
        ramp_mass = width / 3.0F * top * top * top;
        flat_mass = 1.0F - flat_from;
    }
    float mass() const { return ramp_mass + flat_mass; }

    Triple<float> sample(Vec2 u) const {
        const float target = u.x * mass();
        const float one_minus_cos =
            target < flat_mass ? target : 1.0F - outer - width * std::cbrt(3.0F * (mass() - target) / width);
        return square_to_uniform_cone(1.0F, u.y, std::max(one_minus_cos, 0.0F));
    }
};

Vec2 square_to_disc(Vec2 u) {
    float sine, cosine;
    sincos_turn(u.y, sine, cosine);
    const float radius = std::sqrt(u.x);
    return {radius * cosine, radius * sine};
}

}  // namespace

LightEmission::LightEmission(const Scene& scene, const LightSet& lights, const CasterReport& casters, EmissionAim aim)
    : scene_(scene),
      lights_(lights),
      aimed_share_(aim == EmissionAim::mostly_casters ? 0.75F : 1.0F),
      only_casters_(aim == EmissionAim::casters_only) {
    if (aim != EmissionAim::everywhere) aimed_ = AimedEmission(scene, casters);
    if (only_casters_) select_lights_that_aim();
    const Bounds bounds = emission_bounds(scene);
    if (!bounds.empty()) {
        centre_ = 0.5F * (bounds.min + bounds.max);
        // Everything lies inside the disc by a margin, so that the density is the same wherever a ray meets a surface.
        radius_ = std::max(0.501F * glm::length(bounds.max - bounds.min), 1e-6F);
    }
    disc_density_ = inv_pi / (radius_ * radius_);
    for (size_t i = 0; i < lights.triangle_count(); ++i) {
        const auto light = static_cast<uint32_t>(scene.lights.size() + i);
        const TrianglePoint point = sample_triangle_point(scene, *lights.triangle(light), {0.5F, 0.5F});
        const float sides = point.double_sided ? 2.0F : 1.0F;
        triangle_densities_.push_back(point.area > 0.0F ? lights.probability(light) * inv_pi / (point.area * sides)
                                                        : 0.0F);
    }
}

void LightEmission::select_lights_that_aim() {
    std::vector<float> weights;
    float total = 0.0F;
    for (uint32_t i = 0; i < scene_.lights.size(); ++i) {
        weights.push_back(aimed_.aims(i) ? lights_.probability(i) : 0.0F);
        total += weights.back();
    }
    if (total > 0.0F) selection_ = AliasTable(weights);
}

EmissionSample LightEmission::sample(float u_select, Vec2 u_position, Vec2 u_direction) const {
    EmissionSample sample;
    float u_choice = u_select;
    sample.light = only_casters_ ? static_cast<uint32_t>(selection_.sample(u_choice)) : lights_.select(u_choice);
    if (sample.light < scene_.lights.size()) {
        sample.delta = scene_.lights[sample.light].kind != LightKind::sphere;
        if (scene_.lights[sample.light].kind == LightKind::directional) {
            sample_directional(sample, u_choice, u_position);
        } else {
            sample_punctual(sample, u_choice, u_position, u_direction);
        }
    } else if (const TriangleLight* triangle = lights_.triangle(sample.light)) {
        sample_triangle(sample, *triangle, u_position, u_direction);
    } else {
        sample_environment(sample, u_position, u_direction);
    }
    return sample;
}

// A sphere light is a point light whose rays are spread over the sphere's disc across them.
void LightEmission::sample_punctual(EmissionSample& sample, float u_choice, Vec2 u_position, Vec2 u_direction) const {
    const PunctualLight& light = scene_.lights[sample.light];
    sample.direction = sample_direction(sample.light, u_choice, u_direction);
    const float pdf = probability(sample.light) * direction_pdf(sample.light, sample.direction);
    if (!(pdf > 0.0F)) return;
    sample.weight = light.intensity / pdf;
    sample.direct_factor = lights_.probability(sample.light);
    sample.origin = light.position;
    if (light.kind == LightKind::spot) sample.weight *= spot_falloff(light, to_triple(sample.direction));
    if (light.kind != LightKind::sphere) return;
    const Vec2 disc = square_to_disc(u_position);
    const float height = safe_sqrt(1.0F - disc.x * disc.x - disc.y * disc.y);
    const Vec3 normal = to_vec3(make_frame(to_triple(sample.direction)).to_world({disc.x, disc.y, height}));
    // Embree finds the sphere by its silhouette: clear of it by more than the rounding of centre and radius.
    const float clearance = light.radius * 1e-4F + rounding_bound(32) * max_component(glm::abs(light.position));
    sample.origin = light.position + normal * (light.radius + clearance);
}

Vec3 LightEmission::sample_direction(uint32_t light, float u_choice, Vec2 u) const {
    if (aimed_.aims(light)) {
        if (u_choice < aimed_share_) return aimed_.sample_direction(light, u_choice / aimed_share_, u);
    }
    const PunctualLight& source = scene_.lights[light];
    if (source.kind != LightKind::spot) return to_vec3(square_to_uniform_sphere(u.x, u.y));
    return to_vec3(make_frame(to_triple(source.direction)).to_world(SpotProfile(source).sample(u)));
}

float LightEmission::direction_pdf(uint32_t light, const Vec3& direction) const {
    const PunctualLight& source = scene_.lights[light];
    float pdf = 0.25F * inv_pi;
    if (source.kind == LightKind::spot) {
        pdf = 0.5F * inv_pi * spot_falloff(source, to_triple(direction)) / SpotProfile(source).mass();
    }
    if (!aimed_.aims(light)) return pdf;
    return (1.0F - aimed_share_) * pdf + aimed_share_ * aimed_.direction_pdf(light, direction);
}

Vec3 LightEmission::outside(const Vec3& point, const Vec3& direction) const {
    return point - direction * (glm::dot(point - centre_, direction) + 1.01F * radius_);
}

Vec3 LightEmission::sample_disc(const Vec3& direction, Vec2 u) const {
    const Vec2 disc = square_to_disc(u) * radius_;
    return centre_ + to_vec3(make_frame(to_triple(direction)).to_world({disc.x, disc.y, 0.0F}));
}

float LightEmission::disc_pdf(uint32_t light, const Vec3& x) const {
    if (!aimed_.aims(light)) return disc_density_;
    return (1.0F - aimed_share_) * disc_density_ + aimed_share_ * aimed_.point_pdf(light, x);
}

void LightEmission::sample_directional(EmissionSample& sample, float u_choice, Vec2 u) const {
    const PunctualLight& light = scene_.lights[sample.light];
    sample.direction = light.direction;
    const bool aimed = aimed_.aims(sample.light) && u_choice < aimed_share_;
    const Vec3 point =
        aimed ? aimed_.sample_point(sample.light, u_choice / aimed_share_, u) : sample_disc(light.direction, u);
    sample.origin = outside(point, light.direction);
    sample.weight = light.intensity / (probability(sample.light) * disc_pdf(sample.light, point));
    sample.direct_factor = lights_.probability(sample.light);
}

void LightEmission::sample_triangle(EmissionSample& sample, const TriangleLight& light, Vec2 u_position,
                                    Vec2 u_direction) const {
    const TrianglePoint point = sample_triangle_point(scene_, light, u_position);
    const float density = triangle_densities_[sample.light - scene_.lights.size()];
    if (!(density > 0.0F)) return;
    float side = 1.0F;
    if (point.double_sided) {
        side = u_direction.x < 0.5F ? 1.0F : -1.0F;
        u_direction.x = u_direction.x < 0.5F ? 2.0F * u_direction.x : 2.0F * u_direction.x - 1.0F;
    }
    const Vec3 normal = side * point.normal;
    const Triple<float> local = square_to_cosine_hemisphere(u_direction.x, u_direction.y);
    if (!(local.z > 0.0F)) return;
    sample.direction = to_vec3(make_frame(to_triple(normal)).to_world(local));
    sample.origin = offset_ray_origin(point.position, point.error, normal, sample.direction);
    sample.weight = point.radiance / density;
    sample.direct_factor = lights_.probability(sample.light) / (point.area * local.z);
}

void LightEmission::sample_environment(EmissionSample& sample, Vec2 u_position, Vec2 u_direction) const {
    Environment::Evaluation evaluation;
    sample.direction = -lights_.environment()->sample(u_direction, evaluation);
    sample.direct_factor = lights_.environment_probability() * evaluation.pdf;
    if (!(sample.direct_factor > 0.0F)) return;
    sample.origin = outside(sample_disc(sample.direction, u_position), sample.direction);
    sample.weight = evaluation.radiance / (sample.direct_factor * disc_density_);
}

float LightEmission::ray_density(uint32_t light, float direct_pdf, const Vec3& x, const Vec3& direction,
                                 float distance) const {
    if (light >= scene_.lights.size()) {
        if (only_casters_) return 0.0F;
        const size_t triangle = light - scene_.lights.size();
        return triangle < triangle_densities_.size() ? triangle_densities_[triangle] : direct_pdf * disc_density_;
    }
    const PunctualLight& source = scene_.lights[light];
    if (source.kind == LightKind::directional) return probability(light) * disc_pdf(light, x);
    const float density = probability(light) * direction_pdf(light, direction);
    const float area = source.kind == LightKind::sphere ? pi * source.radius * source.radius : distance * distance;
    return density / area;
}

float LightEmission::direct_density(const EmissionSample& sample, const Vec3& x, float distance) const {
    if (sample.delta) return sample.direct_factor;
    if (sample.light < scene_.lights.size()) return lights_.pdf_sphere(sample.light, x);
    return lights_.triangle(sample.light) != nullptr ? sample.direct_factor * distance * distance
                                                     : sample.direct_factor;
}

}  // namespace nephroid

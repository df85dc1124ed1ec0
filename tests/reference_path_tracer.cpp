#include "tests/reference_path_tracer.h"

#include "core/delta_light.h"
#include "core/rounding.h"

namespace nephroid::testing {

namespace {

/// A plain stream of independent numbers.
class Stream {
  public:
    Stream(uint32_t seed, uint32_t index) : seed_(seed), index_(index) {}
    float next() { return sample_1d(SamplerKind::independent, seed_, index_, dimension_++); }
    Vec2 next_pair() {
        const float x = next();
        return {x, next()};
    }

  private:
    uint32_t seed_, index_, dimension_ = 1000;
};

Rgb emitted(const RenderContext& context, const Hit& hit, const SurfaceInteraction& surface) {
    const Material& material = context.surfaces.material(hit.object);
    if (!material.emits() || (!surface.front && !material.double_sided)) return Rgb(0.0F);
    return emitted_radiance(context.scene, material, surface.uv);
}

/// Radiance along a ray. Lights that a ray can hit count only when hit (no next event estimation for them), delta
/// lights only by next event estimation: no weights, nothing to get wrong.
Rgb radiance(const RenderContext& context, const Ray& ray, uint32_t scatterings_left, Stream& stream) {
    const Hit hit = context.accelerator.intersect(ray);
    if (hit.object == no_hit) {
        const Environment* environment = context.lights.environment();
        return environment != nullptr ? environment->radiance(ray.direction) : Rgb(0.0F);
    }
    if (hit.object >= context.surfaces.object_count()) {
        return LightSet::sphere_radiance(context.scene.lights[hit.object - context.surfaces.object_count()]);
    }
    const Vec3 wo = -ray.direction;
    const SurfaceInteraction s = context.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, wo);
    Rgb result = emitted(context, hit, s);
    if (scatterings_left == 0) return result;

    const Frame<float> frame = make_frame(to_triple(s.shading_normal));
    const Triple<float> local_wo = frame.to_local(to_triple(wo));
    for (const PunctualLight& light : context.scene.lights) {
        if (light.kind == LightKind::sphere) continue;
        const DeltaLightSample<float> sample = sample_delta_light(light, to_triple(s.position));
        const Vec3 wi = to_vec3(sample.wi);
        if (glm::dot(s.geometric_normal, wi) <= 0.0F) continue;
        const Vec3 origin = offset_ray_origin(s.position, s.error, s.geometric_normal, wi);
        const float distance = light.kind == LightKind::directional ? std::numeric_limits<float>::infinity()
                                                                    : 0.99999F * glm::length(light.position - origin);
        if (context.accelerator.occluded({origin, wi, distance})) continue;
        result += to_vec3(evaluate_bsdf(s.bsdf, local_wo, frame.to_local(sample.wi)).value * sample.irradiance);
    }
    const float u_lobe = stream.next();
    const Vec2 u = stream.next_pair();
    const BsdfSample<float> sample = sample_bsdf(s.bsdf, local_wo, u_lobe, u.x, u.y);
    if (max_component(sample.weight) <= 0.0F) return result;
    const Vec3 wi = to_vec3(frame.to_world(sample.wi));
    if (glm::dot(s.geometric_normal, wi) <= 0.0F) return result;
    const Ray next{offset_ray_origin(s.position, s.error, s.geometric_normal, wi), wi};
    return result + to_vec3(sample.weight) * radiance(context, next, scatterings_left - 1, stream);
}

}  // namespace

Rgb reference_sample(const RenderContext& context, int x, int y, uint32_t index) {
    Stream stream(pixel_seed(static_cast<uint32_t>(x), static_cast<uint32_t>(y), context.seed + 1), index);
    const Vec2 jitter = stream.next_pair();
    const float film_x = static_cast<float>(x) + jitter.x;
    const float film_y = static_cast<float>(y) + jitter.y;
    const Ray ray{to_vec3(context.camera_rays.origin(film_x, film_y)),
                  to_vec3(context.camera_rays.direction(film_x, film_y))};
    return radiance(context, ray, context.max_depth, stream);
}

}  // namespace nephroid::testing

#include "integrators/guided/caustic_photons.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "core/delta_light.h"
#include "core/rounding.h"
#include "integrators/guided/photon_starts.h"

namespace nephroid {

namespace {

constexpr uint32_t photons_per_task = 1024;
constexpr uint32_t photon_seed = 0x3c6ef372U, long_photon_seed = 0x5be0cd19U;

/// Dimension pairs of a photon: three for its start, then two per reflection.
enum PhotonDimension : uint32_t { triangle_choice, triangle_point, first_scatter };

class PhotonTracer {
  public:
    /// Powers are those of `count` paths that share all light.
    PhotonTracer(const RenderContext& context, const GuidedPaths& prepared, const PhotonStarts& starts, uint32_t count,
                 uint32_t most_reflections, uint32_t seed)
        : context_(context),
          prepared_(prepared),
          starts_(starts),
          paths_per_light_(static_cast<float>(count) / static_cast<float>(prepared.lights.size())),
          most_reflections_(most_reflections),
          seed_(seed) {}

    void trace(uint32_t index, std::vector<CausticPhoton>& landed) const {
        const auto lights = static_cast<uint32_t>(prepared_.lights.size());
        const uint32_t light_index = prepared_.lights[index % lights].index;
        const PunctualLight& light = context_.scene.lights[light_index];
        const uint32_t seed = pixel_seed(index % lights, 0U, seed_), sample = index / lights;
        Photon photon;
        if (!start(light, seed, sample, photon)) return;
        const Vec3 first_reflection = photon.surface.position;
        Vec3 second_reflection{0.0F};
        for (uint32_t reflection = 0; reflection < most_reflections_; ++reflection) {
            if (!scatter(seed, sample, reflection, photon)) return;
            const Hit hit = context_.accelerator.intersect({photon.origin, photon.direction});
            if (hit.object >= context_.surfaces.object_count()) return;
            photon.surface = context_.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -photon.direction);
            photon.wi = -photon.direction;
            const BsdfParameters<float>& bsdf = photon.surface.bsdf;
            const bool narrow = is_narrow_metal(bsdf.metallic, bsdf.alpha, max_caster_alpha);
            if (!narrow) {
                landed.push_back(landing(photon, hit, reflection + 1));
                landed.back().light = light_index;
                landed.back().triangle = photon.triangle;
                landed.back().first_reflection = first_reflection;
                landed.back().second_reflection = second_reflection;
            }
            if (reflection == 0) second_reflection = photon.surface.position;
            if (!context_.surfaces.is_caster(hit.object)) return;
        }
    }

  private:
    struct Photon {
        uint32_t triangle = 0;       ///< Where it started.
        SurfaceInteraction surface;  ///< Where it is.
        Vec3 wi{0.0F};               ///< Unit, to where it comes from.
        Vec3 origin{0.0F}, direction{0.0F};
        Rgb power{0.0F};       ///< That arrives at the surface.
        Rgb irradiance{0.0F};  ///< From the light, across wi, at the first surface.
        Rgb radiance{0.0F};    ///< CausticPhoton::radiance of what leaves the surface.
    };

    /// At a point of the reflectors that the light shines on.
    bool start(const PunctualLight& light, uint32_t seed, uint32_t sample, Photon& photon) const {
        const uint32_t triangle = starts_.triangle(sample_1d(SamplerKind::sobol, seed, sample, triangle_choice));
        photon.triangle = triangle;
        const auto [u, v] = sample_2d(SamplerKind::sobol, seed, sample, triangle_point);
        const float root = std::sqrt(u);
        const Vec2 weights(1.0F - root, v * root);
        const Vec3 y = prepared_.reflectors.point(triangle, weights);
        const auto from_light = sample_delta_light(light, to_triple(y));
        photon.wi = to_vec3(from_light.wi);
        const TriangleId& id = prepared_.reflectors.ids[triangle];
        photon.surface = context_.surfaces.interact(id.object, id.primitive, weights.x, weights.y, photon.wi);
        const SurfaceInteraction& s = photon.surface;
        const float cosine = glm::dot(s.geometric_normal, photon.wi);
        photon.irradiance = to_vec3(from_light.irradiance);
        if (!(cosine > 0.0F) || !(max_component(photon.irradiance) > 0.0F)) return false;
        const Vec3 origin = offset_ray_origin(s.position, s.error, s.geometric_normal, photon.wi);
        const bool occluded =
            light.kind == LightKind::directional
                ? context_.accelerator.occluded({origin, photon.wi})
                : context_.accelerator.occluded({origin, light.position - origin,
                                                 1.0F - 1e-5F - light.radius / glm::length(light.position - origin)});
        photon.power = photon.irradiance * (cosine / (starts_.pdf(triangle) * paths_per_light_));
        return !occluded;
    }

    /// Samples where the photon goes on to; false where it is absorbed.
    bool scatter(uint32_t seed, uint32_t sample, uint32_t reflection, Photon& photon) const {
        const SurfaceInteraction& s = photon.surface;
        const Frame<float> frame = make_frame(to_triple(s.shading_normal));
        const Triple<float> wi = frame.to_local(to_triple(photon.wi));
        const auto [u, v] = sample_2d(SamplerKind::sobol, seed, sample, first_scatter + 2 * reflection);
        const float u_lobe = sample_1d(SamplerKind::sobol, seed, sample, first_scatter + 2 * reflection + 1);
        const BsdfSample<float> sampled = sample_bsdf(s.bsdf, wi, u_lobe, u, v);
        const Triple<float>& wo = sampled.wi;
        photon.direction = to_vec3(frame.to_world(wo));
        const float geometric = glm::dot(s.geometric_normal, photon.direction);
        if (!(geometric > 0.0F) || !(wo.z > 0.0F) || !(wi.z > 0.0F)) return false;
        // The BSDF of light is that of importance the other way around (Veach 1997, Eq. 5.19).
        const float adjoint = wi.z * geometric / (wo.z * glm::dot(s.geometric_normal, photon.wi));
        photon.power *= to_vec3(sampled.weight) * adjoint;
        if (sampled.delta) {
            if (reflection == 0) return false;  // No path that ends by next event estimation goes this way.
            photon.radiance *= to_vec3(sampled.weight);
        } else {
            const BsdfEvaluation<float> reverse = evaluate_bsdf(s.bsdf, wo, wi);
            photon.radiance = reflection == 0 ? to_vec3(reverse.value) * photon.irradiance
                                              : photon.radiance * to_vec3(reverse.value) / reverse.pdf;
        }
        photon.origin = offset_ray_origin(s.position, s.error, s.geometric_normal, photon.direction);
        return max_component(photon.power) > 0.0F;
    }

    static CausticPhoton landing(const Photon& photon, const Hit& hit, uint32_t reflections) {
        const SurfaceInteraction& s = photon.surface;
        CausticPhoton landed;
        landed.at = {s.position, s.error, s.geometric_normal, s.shading_normal, s.bsdf.alpha, 0.0F, hit.object};
        landed.wi = photon.wi;
        landed.distance = hit.t;
        landed.power = luminance(photon.power);
        landed.radiance = luminance(photon.radiance);
        landed.reflections = reflections;
        return landed;
    }

    const RenderContext& context_;
    const GuidedPaths& prepared_;
    const PhotonStarts& starts_;
    float paths_per_light_;
    uint32_t most_reflections_;
    uint32_t seed_;
};

/// What `count` paths find, but for photons of fewer than `fewest_reflections`.
std::vector<CausticPhoton> trace_all(const PhotonTracer& tracer, uint32_t count, uint32_t fewest_reflections) {
    const uint32_t tasks = (count + photons_per_task - 1) / photons_per_task;
    std::vector<std::vector<CausticPhoton>> parts(tasks);
    tbb::parallel_for(uint32_t{0}, tasks, [&](uint32_t task) {
        const uint32_t end = std::min(count, (task + 1) * photons_per_task);
        for (uint32_t i = task * photons_per_task; i < end; ++i) tracer.trace(i, parts[task]);
    });
    std::vector<CausticPhoton> landed;
    for (const auto& part : parts) landed.insert(landed.end(), part.begin(), part.end());
    std::erase_if(landed, [&](const CausticPhoton& p) {
        return p.reflections < fewest_reflections || !(p.power > 0.0F && p.radiance > 0.0F) ||
               !std::isfinite(p.power) || !std::isfinite(p.radiance);
    });
    return landed;
}

}  // namespace

std::vector<CausticPhoton> trace_caustic_photons(const RenderContext& context, const GuidedPaths& prepared,
                                                 uint32_t count, uint32_t most_reflections) {
    if (prepared.reflectors.size() == 0 || prepared.lights.empty()) return {};
    const PhotonStarts starts(prepared.reflectors);
    return trace_all({context, prepared, starts, count, most_reflections, context.seed ^ photon_seed}, count, 1);
}

void add_long_photons(const RenderContext& context, const GuidedPaths& prepared, std::span<const uint32_t> useful,
                      uint32_t count, uint32_t most_reflections, double enough, uint32_t most,
                      std::vector<CausticPhoton>& photons) {
    if (useful.empty()) return;
    std::vector<uint32_t> triangles;
    for (const uint32_t i : useful) triangles.push_back(photons[i].triangle);
    const PhotonStarts even(prepared.reflectors), starts = even.around(triangles);
    const double per_path = static_cast<double>(useful.size()) * starts.gain(triangles) / static_cast<double>(count);
    const auto more = static_cast<uint32_t>(std::min(std::ceil(enough / per_path), static_cast<double>(most)));
    const auto found =
        trace_all({context, prepared, starts, more, most_reflections, context.seed ^ long_photon_seed}, more, 2);
    // Powers are shares of one estimate so far.
    const auto share = [&](const CausticPhoton& photon, const PhotonStarts& own, uint32_t paths) {
        const auto expected = [&](const PhotonStarts& s, uint32_t n) {
            return s.pdf(photon.triangle) * static_cast<float>(n);
        };
        return expected(own, paths) / (expected(even, count) + expected(starts, more));
    };
    for (CausticPhoton& photon : photons) {
        if (photon.reflections > 1) photon.power *= share(photon, even, count);
    }
    for (const CausticPhoton& photon : found) {
        photons.push_back(photon);
        photons.back().power *= share(photon, starts, more);
    }
}

}  // namespace nephroid

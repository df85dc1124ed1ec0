#include "integrators/guided/caustic_photons.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/delta_light.h"
#include "core/rounding.h"

namespace nephroid {

namespace {

constexpr uint32_t photons_per_task = 1024;
constexpr uint32_t photon_seed = 0x3c6ef372U;

/// Dimension pairs of a photon: three for its start, then two per reflection.
enum PhotonDimension : uint32_t { triangle_choice, triangle_point, first_scatter };

class PhotonTracer {
  public:
    PhotonTracer(const RenderContext& context, const GuidedPaths& prepared, uint32_t count, uint32_t most_reflections)
        : context_(context), prepared_(prepared), count_(count), most_reflections_(most_reflections) {
        const ReflectorTree& reflectors = prepared.reflectors;
        for (uint32_t i = 0; i < reflectors.size(); ++i) {
            const Vec3 e1 = reflectors.position(i, 1) - reflectors.position(i, 0);
            const Vec3 e2 = reflectors.position(i, 2) - reflectors.position(i, 0);
            total_area_ += 0.5 * double{glm::length(glm::cross(e1, e2))};
            area_up_to_.push_back(total_area_);
        }
    }

    void trace(uint32_t index, std::vector<CausticPhoton>& landed) const {
        const auto lights = static_cast<uint32_t>(prepared_.lights.size());
        const uint32_t light_index = prepared_.lights[index % lights].index;
        const PunctualLight& light = context_.scene.lights[light_index];
        const uint32_t seed = pixel_seed(index % lights, 0U, context_.seed ^ photon_seed), sample = index / lights;
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
                landed.back().first_reflection = first_reflection;
                landed.back().second_reflection = second_reflection;
            }
            if (reflection == 0) second_reflection = photon.surface.position;
            if (!context_.surfaces.is_caster(hit.object)) return;
        }
    }

  private:
    struct Photon {
        SurfaceInteraction surface;  ///< Where it is.
        Vec3 wi{0.0F};               ///< Unit, to where it comes from.
        Vec3 origin{0.0F}, direction{0.0F};
        Rgb power{0.0F};       ///< That arrives at the surface.
        Rgb irradiance{0.0F};  ///< From the light, across wi, at the first surface.
        Rgb radiance{0.0F};    ///< CausticPhoton::radiance of what leaves the surface.
    };

    /// At a point of the reflectors that the light shines on.
    bool start(const PunctualLight& light, uint32_t seed, uint32_t sample, Photon& photon) const {
        const float choice = sample_1d(SamplerKind::sobol, seed, sample, triangle_choice);
        const auto found = std::upper_bound(area_up_to_.begin(), area_up_to_.end(), double{choice} * total_area_);
        const auto triangle = static_cast<uint32_t>(
            std::min<std::ptrdiff_t>(found - area_up_to_.begin(), static_cast<std::ptrdiff_t>(area_up_to_.size()) - 1));
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
        const auto paths = static_cast<float>(count_) / static_cast<float>(prepared_.lights.size());
        photon.power = photon.irradiance * (cosine * static_cast<float>(total_area_) / paths);
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
    uint32_t count_;
    uint32_t most_reflections_;
    std::vector<double> area_up_to_;  ///< Of all triangles up to each, m^2.
    double total_area_ = 0.0;
};

}  // namespace

std::vector<CausticPhoton> trace_caustic_photons(const RenderContext& context, const GuidedPaths& prepared,
                                                 uint32_t count, uint32_t most_reflections) {
    if (prepared.reflectors.size() == 0 || prepared.lights.empty()) return {};
    const PhotonTracer tracer(context, prepared, count, most_reflections);
    const uint32_t tasks = (count + photons_per_task - 1) / photons_per_task;
    std::vector<std::vector<CausticPhoton>> parts(tasks);
    tbb::parallel_for(uint32_t{0}, tasks, [&](uint32_t task) {
        const uint32_t end = std::min(count, (task + 1) * photons_per_task);
        for (uint32_t i = task * photons_per_task; i < end; ++i) tracer.trace(i, parts[task]);
    });
    std::vector<CausticPhoton> landed;
    for (const auto& part : parts) landed.insert(landed.end(), part.begin(), part.end());
    std::erase_if(landed, [](const CausticPhoton& p) {
        return !(p.power > 0.0F && p.radiance > 0.0F) || !std::isfinite(p.power) || !std::isfinite(p.radiance);
    });
    return landed;
}

}  // namespace nephroid

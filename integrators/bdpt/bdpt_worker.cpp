#include "integrators/bdpt/bdpt_worker.h"

#include <algorithm>

#include "integrators/bdpt/bdpt_integrator.h"
#include "integrators/path/wave_stages.h"

namespace nephroid {

namespace {

// Dimension pairs of a camera sub-path: the film, then four per scattering.
constexpr uint32_t film_dimension = 0;
enum VertexDimension : uint32_t { lobe_and_roulette, direction, light_point, light_choice, per_vertex };

constexpr uint32_t dimension_of(uint32_t bounce, VertexDimension dimension) {
    return 1 + bounce * per_vertex + dimension;
}

FloatV load(const AlignedArray<float>& values, size_t i) {
    return FloatV(&values[i], stdx::vector_aligned);
}

}  // namespace

BdptIntegrator::BdptIntegrator(const RenderContext& context, const CasterReport& casters, const BdptView& view,
                               const BdptSettings& settings)
    : context_{context,
               LightEmission(context.scene, context.lights, casters,
                             settings.aim_emission ? EmissionAim::mostly_casters : EmissionAim::everywhere),
               CameraProjection(context.camera_rays), view.crop,
               static_cast<float>(light_paths_per_sample(view.width, view.height, view.crop))} {}

std::unique_ptr<IntegratorWorker> BdptIntegrator::make_worker() const {
    return std::make_unique<BdptWorker>(context_);
}

BdptWorker::BdptWorker(const LightTracing& context)
    : context_(context),
      render_(context.render),
      light_(context),
      tracer_(context.render),
      connections_(context),
      lights_(max_slots_per_block),
      ray_density_(max_slots_per_block),
      shadows_(max_slots_per_block),
      ones_(max_slots_per_block) {
    std::fill_n(ones_.data(), ones_.size(), 1.0F);
}

uint64_t BdptWorker::rays() const {
    return light_.ray_count() + tracer_.ray_count() + connections_.ray_count() + shadow_ray_count_;
}

void BdptWorker::render(const SampleBlock& block, SampleBuffer& samples) {
    clear_samples(samples, render_.aovs, block.slot_count());
    samples.splats.clear();
    light_.trace(block, samples);
    start_camera_paths(render_, block, film_dimension, tracer_.seeds, tracer_.indices, tracer_.paths);
    const LightSet& lights = render_.lights;
    for (uint32_t bounce = 0; tracer_.paths.rays.count > 0; ++bounce) {
        tracer_.trace(bounce == 0);
        find_vertices(bounce, samples);
        if (bounce == render_.max_depth || tracer_.vertices.count == 0 || lights.empty()) break;
        sample_lights(bounce);
        weigh_lights();
        push_shadow_rays(tracer_.vertices, lights_, shadows_);
        shadow_ray_count_ += shadows_.rays.count;
        render_.accelerator.occluded(shadows_.rays, bounce == 0, shadows_.occluded);
        add_unoccluded(render_.aovs, shadows_, samples);
        connections_.connect(bounce, tracer_.vertices, tracer_.sums, light_.vertices(), samples);
        // The last scattering matters only where a light can be hit.
        if (bounce + 1 == render_.max_depth && !lights.has_hittable()) break;
        tracer_.scatter<Transport::radiance>(
            {bounce, dimension_of(bounce, lobe_and_roulette), dimension_of(bounce, direction), ones_});
        tracer_.scatter_sums(true, nullptr);
    }
}

// Adds what hit lights emit and finds the surface points that scatter.
void BdptWorker::find_vertices(uint32_t bounce, SampleBuffer& samples) {
    const Surfaces& surfaces = render_.surfaces;
    const auto object_count = static_cast<uint32_t>(surfaces.object_count());
    tracer_.find_vertices(render_.lights.environment() != nullptr);
    const HitBatch& hits = tracer_.hits;
    for (const uint32_t i : tracer_.special) {
        const uint32_t object = hits.object[i];
        if (object == no_hit) {
            add_escaped(i, bounce, samples);
        } else if (object >= object_count) {
            add_sphere_light(i, object - object_count, bounce, samples);
        } else {
            const SurfaceInteraction surface =
                surfaces.interact(object, hits.primitive[i], hits.u[i], hits.v[i], -tracer_.paths.rays.direction(i));
            if (surfaces.emits(object)) add_surface_emission(i, surface, bounce, samples);
            push_vertex(tracer_.paths, i, surface, tracer_.vertices);
        }
    }
    if (bounce == 0) {
        start_sums();
        record_first_hits(render_.aovs, hits, tracer_.vertices, samples);
    } else {
        tracer_.carry_sums();
    }
    if (render_.aovs.caustic) set_flags();
}

NEPHROID_FLATTEN void BdptWorker::start_sums() {
    const VertexWave& vertices = tracer_.vertices;
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const CameraView<FloatV> view = context_.projection.view(vertices.position.load(k));
        const FloatV density = view.pixel_density * dot(vertices.geometric_normal.load(k), vertices.wo.load(k));
        tracer_.sums.store(k, mis_camera_start(density, FloatV(context_.light_paths)));
    }
}

/// PathFlags of the path tracer.
void BdptWorker::set_flags() {
    VertexWave& vertices = tracer_.vertices;
    for (size_t k = 0; k < vertices.count; ++k) {
        const size_t path = vertices.path[k];
        const bool is_caster = render_.surfaces.is_caster(tracer_.hits.object[path]);
        vertices.flags[k] = path_flags_at(is_caster, tracer_.paths.flags[path]);
    }
}

// Strategy s = 0. What the camera sees directly has no other strategy.
void BdptWorker::add_escaped(size_t path, uint32_t bounce, SampleBuffer& samples) {
    const LightSet& lights = render_.lights;
    const Vec3 direction = tracer_.paths.rays.direction(path);
    const Environment::Evaluation evaluation = lights.environment()->evaluate(direction);
    float weight = 1.0F;
    if (bounce > 0) {
        const auto light = static_cast<uint32_t>(lights.size() - 1);
        const float direct_pdf = lights.environment_probability() * evaluation.pdf;
        const float ray_density =
            context_.emission.ray_density(light, direct_pdf, tracer_.paths.rays.origin(path), -direction, 1.0F);
        weight = mis_weight_hit(tracer_.path_sums.get(path), direct_pdf, ray_density);
    }
    add_emission(path, evaluation.radiance, weight, false, samples);
}

void BdptWorker::add_sphere_light(size_t path, uint32_t light, uint32_t bounce, SampleBuffer& samples) {
    const Vec3 origin = tracer_.paths.rays.origin(path);
    const PunctualLight& sphere = render_.scene.lights[light];
    const Vec3 from_centre = origin - sphere.position;
    if (glm::dot(from_centre, from_centre) <= sphere.radius * sphere.radius) return;  // Emits outwards only.
    float weight = 1.0F;
    if (bounce > 0) {
        const float direct_pdf = render_.lights.pdf_sphere(light, origin);
        const float ray_density = context_.emission.ray_density(
            light, direct_pdf, origin, -tracer_.paths.rays.direction(path), tracer_.hits.t[path]);
        weight = mis_weight_hit(tracer_.path_sums.get(path), direct_pdf, ray_density);
    }
    add_emission(path, LightSet::sphere_radiance(sphere), weight, true, samples);
}

void BdptWorker::add_surface_emission(size_t path, const SurfaceInteraction& surface, uint32_t bounce,
                                      SampleBuffer& samples) {
    const uint32_t object = tracer_.hits.object[path];
    const uint32_t primitive = tracer_.hits.primitive[path];
    const Material& material = render_.surfaces.material(object);
    if (!surface.front && !material.double_sided) return;
    float weight = 1.0F;
    if (bounce > 0) {
        const RayBatch& rays = tracer_.paths.rays;
        const float direct_pdf = render_.lights.pdf_triangle(object, primitive, surface.area, rays.origin(path),
                                                             surface.position, surface.geometric_normal);
        const float ray_density =
            context_.emission.ray_density(render_.lights.triangle_light(object, primitive), direct_pdf,
                                          rays.origin(path), -rays.direction(path), tracer_.hits.t[path]);
        weight = mis_weight_hit(tracer_.path_sums.get(path), direct_pdf, ray_density);
    }
    add_emission(path, emitted_radiance(render_.scene, material, surface.uv), weight, false, samples);
}

void BdptWorker::add_emission(size_t path, const Rgb& radiance, float weight, bool small_light, SampleBuffer& samples) {
    const Rgb contribution = tracer_.paths.throughput.get(path) * radiance * weight;
    const size_t slot = tracer_.paths.slot[path];
    const bool caustic = render_.aovs.caustic && small_light && (tracer_.paths.flags[path] & on_caster_chain) != 0;
    for (int c = 0; c < 3; ++c) {
        samples.radiance[c][slot] += contribution[c];
        if (caustic) samples.caustic[c][slot] += contribution[c];
    }
}

// Strategy s = 1: one light and a direction towards it for every vertex.
void BdptWorker::sample_lights(uint32_t bounce) {
    const VertexWave& vertices = tracer_.vertices;
    alignas(simd_alignment) float u[3][simd_width];
    for (size_t first = 0; first < vertices.count; first += simd_width) {
        const UintV slot(&vertices.slot[first], stdx::vector_aligned);
        const auto active = first_lanes(vertices.count - first);
        const UintV seed = gather(tracer_.seeds.data(), slot, active);
        const UintV index = gather(tracer_.indices.data(), slot, active);
        const auto [x, y] = sample_2d(render_.sampler, seed, index, dimension_of(bounce, light_point));
        sample_1d(render_.sampler, seed, index, dimension_of(bounce, light_choice)).copy_to(u[0], stdx::vector_aligned);
        x.copy_to(u[1], stdx::vector_aligned);
        y.copy_to(u[2], stdx::vector_aligned);
        for (size_t k = first; k < std::min(first + simd_width, vertices.count); ++k) {
            sample_light(k, u[0][k - first], {u[1][k - first], u[2][k - first]});
        }
    }
}

void BdptWorker::sample_light(size_t k, float u_select, Vec2 u) {
    const Vec3 position = tracer_.vertices.position.get(k);
    const LightSample sample = render_.lights.sample(u_select, u, position);
    lights_.wi.set(k, sample.wi);
    lights_.target.set(k, sample.target);
    lights_.radiance.set(k, sample.radiance);
    lights_.pdf[k] = sample.pdf;
    lights_.bsdf_competes[k] = sample.delta ? 0.0F : 1.0F;
    lights_.infinite[k] = sample.infinite ? 1.0F : 0.0F;
    const bool small = sample.light < render_.scene.lights.size();
    lights_.caustic[k] = small && (tracer_.vertices.flags[k] & on_caster_chain) != 0 ? 1 : 0;
    const float distance = glm::length(sample.target - position);
    ray_density_[k] = sample.pdf > 0.0F
                          ? context_.emission.ray_density(sample.light, sample.pdf, position, -sample.wi, distance)
                          : 0.0F;
}

// radiance <- throughput * f * cos * radiance * MIS weight / pdf.
NEPHROID_FLATTEN void BdptWorker::weigh_lights() {
    const FloatV zero(0.0F);
    const VertexWave& vertices = tracer_.vertices;
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const Frame<FloatV> frame = make_frame(vertices.shading_normal.load(k));
        const Triple<FloatV> wi = lights_.wi.load(k);
        const Triple<FloatV> local_wi = frame.to_local(wi);
        const Triple<FloatV> local_wo = frame.to_local(vertices.wo.load(k));
        const BsdfParameters<FloatV> parameters = vertices.bsdf(k);
        const BsdfEvaluation<FloatV> bsdf = evaluate_bsdf(parameters, local_wo, local_wi);
        const FloatV reverse_pdf = evaluate_bsdf(parameters, local_wi, local_wo).pdf;
        const FloatV pdf = load(lights_.pdf, k);
        const FloatV cosine = dot(vertices.geometric_normal.load(k), wi);
        // The geometric half space decides what is lit: a shading normal alone would let light leak through.
        const auto lit = (cosine > zero) && (pdf > zero);
        const FloatV weight = mis_weight_light(tracer_.sums.load(k), pdf, bsdf.pdf * load(lights_.bsdf_competes, k),
                                               load(ray_density_, k), cosine, reverse_pdf);
        const Triple<FloatV> contribution =
            vertices.throughput.load(k) * bsdf.value * lights_.radiance.load(k) * (weight / pdf);
        lights_.radiance.store(k, select<FloatV>(lit, contribution, {zero, zero, zero}));
    }
}

}  // namespace nephroid

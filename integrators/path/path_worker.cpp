#include "integrators/path/path_worker.h"

#include <algorithm>
#include <cmath>

#include "core/rounding.h"
#include "integrators/mis.h"
#include "integrators/path/path_integrator.h"

namespace nephroid {

namespace {

// Dimension pairs of a sample: the film, then four per scattering.
constexpr uint32_t film_dimension = 0;
enum VertexDimension : uint32_t { lobe_and_roulette, bsdf_direction, light_point, light_choice, per_vertex };

constexpr uint32_t dimension_of(uint32_t bounce, VertexDimension dimension) {
    return 1 + bounce * per_vertex + dimension;
}

/// Scatterings before Russian roulette: short paths carry most of the light and are never cut.
constexpr uint32_t roulette_start = 4;

/// Shadow rays end this far (relative) before their target: two roundings of the segment's length.
constexpr float segment_end = 1.0F - 4.0F * rounding_bound(1);

FloatV load(const AlignedArray<float>& values, size_t i) {
    return FloatV(&values[i], stdx::vector_aligned);
}

/// Entries of `values` at the slots of paths i .. i + simd_width.
UintV gather(const AlignedArray<uint32_t>& values, const AlignedArray<uint32_t>& slots, size_t i) {
    return UintV([&](auto lane) { return values[slots[i + lane]]; });
}

}  // namespace

std::unique_ptr<IntegratorWorker> PathIntegrator::make_worker() const {
    return std::make_unique<PathWorker>(context_);
}

PathWorker::PathWorker(const RenderContext& context)
    : context_(context), seeds_(max_slots_per_block), indices_(max_slots_per_block), paths_(max_slots_per_block),
      hits_(max_slots_per_block), vertices_(max_slots_per_block), lights_(max_slots_per_block),
      shadows_(max_slots_per_block) {}

void PathWorker::render(const SampleBlock& block, SampleBuffer& samples) {
    const size_t slots = block.slot_count();
    for (auto* layer : {&samples.radiance, &samples.caustic, &samples.albedo, &samples.normal}) {
        for (auto& channel : *layer) std::fill_n(channel.data(), slots, 0.0F);
    }
    std::fill_n(samples.depth.data(), slots, 0.0F);

    start_paths(block);
    for (uint32_t bounce = 0; paths_.rays.count > 0; ++bounce) {
        trace();
        collect_vertices(bounce, samples);
        if (bounce == context_.max_depth || vertices_.count == 0) break;
        if (!context_.lights.empty()) {
            sample_lights(bounce);
            weigh_lights();
            push_shadow_rays();
            add_unoccluded(samples);
        }
        // The last scattering matters only where a light can be hit.
        if (bounce + 1 == context_.max_depth && !context_.lights.has_hittable()) break;
        scatter(bounce);
    }
}

// Camera rays, with the film position jittered over the pixel (box filter).
void PathWorker::start_paths(const SampleBlock& block) {
    const size_t slots = block.slot_count();
    AlignedArray<float>& film_x = paths_.pdf;  // Borrowed until the loop below writes the densities.
    AlignedArray<float>& film_y = paths_.rays.t_max;
    for (uint32_t s = 0; s < block.sample_count; ++s) {
        for (uint32_t p = 0; p < block.pixel_count; ++p) {
            const size_t slot = size_t{s} * block.pixel_count + p;
            const int x = block.tile_x + block.pixel_x[p];
            const int y = block.tile_y + block.pixel_y[p];
            film_x[slot] = static_cast<float>(x);
            film_y[slot] = static_cast<float>(y);
            seeds_[slot] = pixel_seed(static_cast<uint32_t>(x), static_cast<uint32_t>(y), context_.seed);
            indices_[slot] = block.first_sample + s;
            paths_.slot[slot] = static_cast<uint32_t>(slot);
            paths_.flags[slot] = 0;
        }
    }
    RayBatch& rays = paths_.rays;
    rays.count = slots;
    for (size_t i = 0; i < slots; i += simd_width) {
        const UintV seed(&seeds_[i], stdx::vector_aligned);
        const UintV index(&indices_[i], stdx::vector_aligned);
        const auto [jitter_x, jitter_y] = sample_2d(context_.sampler, seed, index, film_dimension);
        const FloatV x = load(film_x, i) + jitter_x;
        const FloatV y = load(film_y, i) + jitter_y;
        const Triple<FloatV> origin = context_.camera_rays.origin(x, y);
        const Triple<FloatV> direction = context_.camera_rays.direction(x, y);
        origin.x.copy_to(&rays.origin_x[i], stdx::vector_aligned);
        origin.y.copy_to(&rays.origin_y[i], stdx::vector_aligned);
        origin.z.copy_to(&rays.origin_z[i], stdx::vector_aligned);
        direction.x.copy_to(&rays.direction_x[i], stdx::vector_aligned);
        direction.y.copy_to(&rays.direction_y[i], stdx::vector_aligned);
        direction.z.copy_to(&rays.direction_z[i], stdx::vector_aligned);
        paths_.throughput.store(i, {FloatV(1.0F), FloatV(1.0F), FloatV(1.0F)});
        FloatV(0.0F).copy_to(&paths_.pdf[i], stdx::vector_aligned);
        FloatV(std::numeric_limits<float>::infinity()).copy_to(&rays.t_max[i], stdx::vector_aligned);
    }
}

void PathWorker::trace() {
    rays_ += paths_.rays.count;
    context_.accelerator.intersect(paths_.rays, true, hits_);
}

// Adds what hit lights emit and gathers the surface points that scatter.
void PathWorker::collect_vertices(uint32_t bounce, SampleBuffer& samples) {
    const Surfaces& surfaces = context_.surfaces;
    const bool last = bounce == context_.max_depth;
    vertices_.count = 0;
    for (size_t i = 0; i < paths_.rays.count; ++i) {
        const uint32_t object = hits_.object[i];
        if (object == no_hit) {
            add_escaped(i, samples);
            continue;
        }
        if (object >= surfaces.object_count()) {
            add_sphere_light(i, object - static_cast<uint32_t>(surfaces.object_count()), samples);
            continue;
        }
        if (last && !surfaces.emits(object)) continue;
        const Vec3 wo = -paths_.rays.direction(i);
        const SurfaceInteraction surface = surfaces.interact(object, hits_.primitive[i], hits_.u[i], hits_.v[i], wo);
        if (surfaces.emits(object)) {
            hits_.object[i] = object;
            add_surface_emission(i, surface, samples);
        }
        if (bounce == 0) {
            const size_t slot = paths_.slot[i];
            const AovSelection& aovs = context_.aovs;
            if (aovs.depth) samples.depth[slot] = hits_.t[i];
            for (int c = 0; c < 3; ++c) {
                if (aovs.normal) samples.normal[c][slot] = surface.shading_normal[c];
                if (aovs.albedo) samples.albedo[c][slot] = to_vec3(surface.bsdf.base)[c];
            }
        }
        if (!last) push_vertex(i, surface);
    }
}

void PathWorker::push_vertex(size_t path, const SurfaceInteraction& surface) {
    const size_t k = vertices_.count++;
    vertices_.position.set(k, surface.position);
    vertices_.error.set(k, surface.error);
    vertices_.geometric_normal.set(k, surface.geometric_normal);
    vertices_.shading_normal.set(k, surface.shading_normal);
    vertices_.wo.set(k, -paths_.rays.direction(path));
    vertices_.throughput.copy(k, paths_.throughput, path);
    vertices_.base.set(k, to_vec3(surface.bsdf.base));
    vertices_.coat_f0.set(k, to_vec3(surface.bsdf.coat_f0));
    vertices_.coat_f90[k] = surface.bsdf.coat_f90;
    vertices_.metallic[k] = surface.bsdf.metallic;
    vertices_.alpha[k] = surface.bsdf.alpha;
    vertices_.slot[k] = paths_.slot[path];
    const uint32_t seen = paths_.flags[path] & receiver_seen;
    const bool caster = context_.surfaces.is_caster(hits_.object[path]);
    vertices_.flags[k] = caster ? (seen != 0 ? receiver_seen | on_caster_chain : 0U) : uint32_t{receiver_seen};
}

void PathWorker::add_escaped(size_t path, SampleBuffer& samples) {
    const Environment* environment = context_.lights.environment();
    if (environment == nullptr) return;
    const Vec3 direction = paths_.rays.direction(path);
    const float light_pdf = paths_.pdf[path] > 0.0F ? context_.lights.pdf_environment(direction) : 0.0F;
    add_emission(path, environment->radiance(direction), light_pdf, false, samples);
}

void PathWorker::add_sphere_light(size_t path, uint32_t light, SampleBuffer& samples) {
    const Vec3 origin = paths_.rays.origin(path);
    const PunctualLight& sphere = context_.scene.lights[light];
    const Vec3 from_centre = origin - sphere.position;
    if (glm::dot(from_centre, from_centre) <= sphere.radius * sphere.radius) return;  // Emits outwards only.
    const float light_pdf = paths_.pdf[path] > 0.0F ? context_.lights.pdf_sphere(light, origin) : 0.0F;
    add_emission(path, LightSet::sphere_radiance(sphere), light_pdf, true, samples);
}

void PathWorker::add_surface_emission(size_t path, const SurfaceInteraction& surface, SampleBuffer& samples) {
    const Material& material = context_.surfaces.material(hits_.object[path]);
    if (!surface.front && !material.double_sided) return;
    float light_pdf = 0.0F;
    if (paths_.pdf[path] > 0.0F) {
        light_pdf = context_.lights.pdf_triangle(hits_.object[path], hits_.primitive[path], surface.area,
                                                 paths_.rays.origin(path), surface.position, surface.geometric_normal);
    }
    add_emission(path, emitted_radiance(context_.scene, material, surface.uv), light_pdf, false, samples);
}

// Radiance of a light that the path ran into, weighted against next event estimation from its last vertex.
void PathWorker::add_emission(size_t path, const Rgb& radiance, float light_pdf, bool small_light,
                              SampleBuffer& samples) {
    const float weight = light_pdf > 0.0F ? power_heuristic(paths_.pdf[path], light_pdf) : 1.0F;
    const Rgb contribution = paths_.throughput.get(path) * radiance * weight;
    const size_t slot = paths_.slot[path];
    const bool caustic = small_light && (paths_.flags[path] & on_caster_chain) != 0;
    for (int c = 0; c < 3; ++c) {
        samples.radiance[c][slot] += contribution[c];
        if (caustic) samples.caustic[c][slot] += contribution[c];
    }
}

// One light and a direction towards it for every vertex.
void PathWorker::sample_lights(uint32_t bounce) {
    const LightSet& lights = context_.lights;
    const bool several = lights.size() > 1;
    const bool extended = lights.has_hittable();
    alignas(simd_alignment) float choice[simd_width];
    alignas(simd_alignment) float point_x[simd_width];
    alignas(simd_alignment) float point_y[simd_width];
    for (size_t first = 0; first < vertices_.count; first += simd_width) {
        const UintV seed = gather(seeds_, vertices_.slot, first);
        const UintV index = gather(indices_, vertices_.slot, first);
        FloatV(0.0F).copy_to(choice, stdx::vector_aligned);
        if (several) {
            sample_1d(context_.sampler, seed, index, dimension_of(bounce, light_choice))
                .copy_to(choice, stdx::vector_aligned);
        }
        if (extended) {
            const auto [x, y] = sample_2d(context_.sampler, seed, index, dimension_of(bounce, light_point));
            x.copy_to(point_x, stdx::vector_aligned);
            y.copy_to(point_y, stdx::vector_aligned);
        }
        for (size_t k = first; k < std::min(first + simd_width, vertices_.count); ++k) {
            const size_t lane = k - first;
            const Vec2 point = extended ? Vec2(point_x[lane], point_y[lane]) : Vec2(0.0F);
            const LightSample sample = lights.sample(choice[lane], point, vertices_.position.get(k));
            lights_.wi.set(k, sample.wi);
            lights_.target.set(k, sample.target);
            lights_.radiance.set(k, sample.radiance);
            lights_.pdf[k] = sample.pdf;
            lights_.bsdf_competes[k] = sample.delta ? 0.0F : 1.0F;
            lights_.infinite[k] = sample.infinite ? 1 : 0;
            const bool small = sample.light < context_.scene.lights.size();
            lights_.caustic[k] = small && (vertices_.flags[k] & on_caster_chain) != 0 ? 1 : 0;
        }
    }
}

// radiance <- throughput * f * cos * radiance * MIS weight / pdf.
void PathWorker::weigh_lights() {
    const FloatV zero(0.0F);
    for (size_t i = 0; i < vertices_.count; i += simd_width) {
        const Frame<FloatV> frame = make_frame(vertices_.shading_normal.load(i));
        const Triple<FloatV> wi = lights_.wi.load(i);
        const BsdfEvaluation<FloatV> bsdf =
            evaluate_bsdf(vertices_.bsdf(i), frame.to_local(vertices_.wo.load(i)), frame.to_local(wi));
        const FloatV pdf = load(lights_.pdf, i);
        // The geometric half space decides what is lit: a shading normal alone would let light leak through.
        const auto lit = (dot(vertices_.geometric_normal.load(i), wi) > zero) && (pdf > zero);
        const FloatV weight = power_heuristic(pdf, bsdf.pdf * load(lights_.bsdf_competes, i)) / pdf;
        const Triple<FloatV> contribution =
            vertices_.throughput.load(i) * bsdf.value * lights_.radiance.load(i) * weight;
        lights_.radiance.store(i, select<FloatV>(lit, contribution, {zero, zero, zero}));
    }
}

void PathWorker::push_shadow_rays() {
    shadows_.rays.count = 0;
    for (size_t k = 0; k < vertices_.count; ++k) {
        const Rgb contribution = lights_.radiance.get(k);
        if (contribution == Rgb(0.0F)) continue;
        const size_t s = shadows_.rays.count;
        const Vec3 wi = lights_.wi.get(k);
        const Vec3 origin = offset_ray_origin(vertices_.position.get(k), vertices_.error.get(k),
                                              vertices_.geometric_normal.get(k), wi);
        if (lights_.infinite[k] != 0) {
            shadows_.rays.push(origin, wi);
        } else {
            shadows_.rays.push(origin, lights_.target.get(k) - origin, segment_end);
        }
        shadows_.contribution.set(s, contribution);
        shadows_.slot[s] = vertices_.slot[k];
        shadows_.caustic[s] = lights_.caustic[k];
    }
}

void PathWorker::add_unoccluded(SampleBuffer& samples) {
    rays_ += shadows_.rays.count;
    context_.accelerator.occluded(shadows_.rays, true, shadows_.occluded);
    for (size_t s = 0; s < shadows_.rays.count; ++s) {
        if (shadows_.occluded[s] != 0) continue;
        const size_t slot = shadows_.slot[s];
        const Rgb contribution = shadows_.contribution.get(s);
        for (int c = 0; c < 3; ++c) {
            samples.radiance[c][slot] += contribution[c];
            if (shadows_.caustic[s] != 0) samples.caustic[c][slot] += contribution[c];
        }
    }
}

// Samples the BSDF at every vertex; the survivors become the next wave.
void PathWorker::scatter(uint32_t bounce) {
    const FloatV zero(0.0F);
    alignas(simd_alignment) float direction[3][simd_width];
    alignas(simd_alignment) float throughput[3][simd_width];
    alignas(simd_alignment) float pdf[simd_width];
    alignas(simd_alignment) float alive[simd_width];
    paths_.rays.count = 0;
    for (size_t first = 0; first < vertices_.count; first += simd_width) {
        const UintV seed = gather(seeds_, vertices_.slot, first);
        const UintV index = gather(indices_, vertices_.slot, first);
        const auto [u_lobe, u_roulette] =
            sample_2d(context_.sampler, seed, index, dimension_of(bounce, lobe_and_roulette));
        const auto [u, v] = sample_2d(context_.sampler, seed, index, dimension_of(bounce, bsdf_direction));
        const Frame<FloatV> frame = make_frame(vertices_.shading_normal.load(first));
        const BsdfSample<FloatV> sample =
            sample_bsdf(vertices_.bsdf(first), frame.to_local(vertices_.wo.load(first)), u_lobe, u, v);
        const Triple<FloatV> wi = frame.to_world(sample.wi);
        Triple<FloatV> weight = vertices_.throughput.load(first) * sample.weight;
        const FloatV survival = bounce + 1 > roulette_start
                                    ? minimum(FloatV(1.0F), maximum(FloatV(0.05F), max_component(weight)))
                                    : FloatV(1.0F);
        weight = weight * (FloatV(1.0F) / survival);
        const auto lives = (u_roulette < survival) && (max_component(weight) > zero) &&
                           (dot(vertices_.geometric_normal.load(first), wi) > zero);
        wi.x.copy_to(direction[0], stdx::vector_aligned);
        wi.y.copy_to(direction[1], stdx::vector_aligned);
        wi.z.copy_to(direction[2], stdx::vector_aligned);
        weight.x.copy_to(throughput[0], stdx::vector_aligned);
        weight.y.copy_to(throughput[1], stdx::vector_aligned);
        weight.z.copy_to(throughput[2], stdx::vector_aligned);
        select(sample.delta, zero, sample.pdf).copy_to(pdf, stdx::vector_aligned);
        select(lives, FloatV(1.0F), zero).copy_to(alive, stdx::vector_aligned);

        for (size_t k = first; k < std::min(first + simd_width, vertices_.count); ++k) {
            const size_t lane = k - first;
            if (alive[lane] == 0.0F) continue;
            const size_t next = paths_.rays.count;
            const Vec3 wi_lane(direction[0][lane], direction[1][lane], direction[2][lane]);
            paths_.throughput.set(next, {throughput[0][lane], throughput[1][lane], throughput[2][lane]});
            paths_.pdf[next] = pdf[lane];
            paths_.slot[next] = vertices_.slot[k];
            paths_.flags[next] = vertices_.flags[k];
            paths_.rays.push(offset_ray_origin(vertices_.position.get(k), vertices_.error.get(k),
                                               vertices_.geometric_normal.get(k), wi_lane),
                             wi_lane);
        }
    }
}

}  // namespace nephroid

#include "integrators/path/path_worker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/delta_light.h"
#include "core/rounding.h"
#include "integrators/mis.h"
#include "integrators/path/wave_stages.h"

namespace nephroid {

namespace {

// Dimension pairs of a sample: the film, then five per scattering, one of them spare. The guide's choice is stratified
// with the direction.
constexpr uint32_t film_dimension = 0;
enum VertexDimension : uint32_t { lobe_and_roulette, direction, light_point, light_choice, spare, per_vertex };

constexpr uint32_t dimension_of(uint32_t bounce, VertexDimension dimension) {
    return 1 + bounce * per_vertex + dimension;
}

/// Throughput below which a path may end before, where a guide has taken its light already.
constexpr float spent_throughput = 0.05F;

/// Throughput below which roulette ends guided paths. Less than one: a guide leaves few dots, and of those many come
/// from paths that roulette had made bright before they met a highlight.
constexpr float guided_roulette_throughput = 0.25F;

FloatV load(const AlignedArray<float>& values, size_t i) {
    return FloatV(&values[i], stdx::vector_aligned);
}

}  // namespace

PathWorker::PathWorker(const RenderContext& context, const DirectionalGuide* guide, const FilmGuide* film_guide,
                       const LightTracing* light_tracing, AdaptiveSampling* adaptive)
    : context_(context),
      seeds_(max_slots_per_block),
      indices_(max_slots_per_block),
      paths_(max_slots_per_block),
      hits_(max_slots_per_block),
      vertices_(max_slots_per_block),
      lights_(max_slots_per_block),
      shadows_(max_slots_per_block),
      adaptive_(adaptive),
      light_tracing_(light_tracing) {
    if (film_guide != nullptr || adaptive != nullptr) {
        pixel_samples_.emplace(context, film_guide, adaptive, film_dimension);
        further_samples_.emplace();
    }
    if (adaptive != nullptr) rays_per_slot_ = AlignedArray<uint32_t>(max_slots_per_block);
    if (light_tracing != nullptr) rivals_.emplace(max_slots_per_block);
    if (guide == nullptr) return;
    guide_ = guide->make_worker();
    least_guided_alpha_ = guide->least_alpha();
    guide_leads_on_ = guide->leads_on();
    guide_is_for_casters_ = guide->is_for_casters();
    if (guide_is_for_casters_) track_vertices();
    guided_.emplace(max_slots_per_block);
}

void PathWorker::render(const SampleBlock& block, SampleBuffer& samples) {
    clear_samples(samples, context_.aovs, block.slot_count());
    start_camera_paths(context_, block, film_dimension, seeds_, indices_, paths_);
    if (rivals_) std::fill_n(rivals_->paths_per_sample.data(), block.slot_count(), 1.0F);
    if (pixel_samples_) start_special_samples(block);
    counts_rays_ = adaptive_ != nullptr && adaptive_->recording();
    if (counts_rays_) std::fill_n(rays_per_slot_.data(), block.slot_count(), 0U);
    trace_paths(samples);
    if (counts_rays_) record_first_paths(block, samples);
    if (pixel_samples_ && !pixel_samples_->found().empty()) add_further_paths(samples);
    counts_rays_ = false;
}

void PathWorker::trace_paths(SampleBuffer& samples) {
    for (uint32_t bounce = 0; paths_.rays.count > 0; ++bounce) {
        trace(bounce);
        if (bounce > 0) arrive(samples);
        collect_vertices(bounce, samples);
        if (bounce == context_.max_depth || vertices_.count == 0) break;
        // What the last scattering meets is not lit by next event estimation any more: no caustic to guide to.
        const bool guided = guide_ != nullptr && bounce + 1 < context_.max_depth && !context_.lights.empty();
        if (!context_.lights.empty()) {
            if (const PunctualLight* light = context_.lights.single_delta_light()) {
                sample_single_light(*light);
            } else {
                sample_lights(bounce);
            }
            if (guided) choose_directions(bounce);
            if (rivals_ && bounce > 0) find_ray_densities();
            weigh_lights(bounce, guided);
            push_shadow_rays(vertices_, lights_, shadows_);
            rays_ += shadows_.rays.count;
            if (counts_rays_) count_rays(shadows_.slot, shadows_.rays.count);
            context_.accelerator.occluded(shadows_.rays, bounce == 0, shadows_.occluded);
            add_unoccluded(context_.aovs, shadows_, samples);
        }
        // The last scattering matters only where a light can be hit.
        if (bounce + 1 == context_.max_depth && !context_.lights.has_hittable()) break;
        guided_last_ = guided;
        if (guided) {
            scatter<true>(bounce);
        } else {
            scatter<false>(bounce);
        }
    }
    if (observer_ != nullptr) observer_->finished(samples);
}

void PathWorker::incident_radiance(const RayBatch& rays, std::span<const uint32_t> seeds, uint32_t first_index,
                                   SampleBuffer& samples) {
    clear_samples(samples, context_.aovs, rays.count);
    paths_.rays.count = 0;
    for (size_t i = 0; i < rays.count; ++i) {
        push_path(rays.origin(i), rays.direction(i), 1.0F, seeds[i], first_index);
        paths_.flags[i] = receiver_seen;
    }
    if (rivals_) std::fill_n(rivals_->paths_per_sample.data(), rays.count, 1.0F);
    trace_paths(samples);
}

// A path of its own slot.
void PathWorker::push_path(const Vec3& origin, const Vec3& direction, float throughput, uint32_t seed, uint32_t index) {
    const size_t path = paths_.rays.count;
    paths_.rays.push(origin, direction);
    paths_.throughput.set(path, Vec3(throughput));
    paths_.pdf[path] = 0.0F;
    paths_.slot[path] = static_cast<uint32_t>(path);
    paths_.flags[path] = 0;
    seeds_[path] = seed;
    indices_[path] = index;
}

// They start anew.
void PathWorker::start_special_samples(const SampleBlock& block) {
    for (const PixelSamples::Sample& sample : pixel_samples_->find(block, seeds_)) {
        if (rivals_) rivals_->paths_per_sample[sample.slot] = shared_by(sample);
        const CameraStart start = pixel_samples_->start(sample, 0);
        indices_[sample.slot] = start.index;
        paths_.throughput.set(sample.slot, Vec3(start.weight));
        // Otherwise the camera ray stays, which AOVs are of.
        if (start.weight > 0.0F) paths_.rays.set(sample.slot, start.origin, start.direction);
    }
}

/// For weights against splats, which ask adaptive sampling too.
float PathWorker::shared_by(const PixelSamples::Sample& sample) const {
    return adaptive_ != nullptr ? static_cast<float>(sample.paths) : 1.0F;
}

void PathWorker::record_first_paths(const SampleBlock& block, const SampleBuffer& samples) {
    for (uint32_t p = 0; p < block.pixel_count; ++p) {
        for (uint32_t s = 0; s < block.sample_count; ++s) {
            const size_t slot = size_t{s} * block.pixel_count + p;
            adaptive_->record(block.tile_x + block.pixel_x[p], block.tile_y + block.pixel_y[p],
                              luminance(samples.radiance_of(slot)), rays_per_slot_[slot]);
        }
    }
}

void PathWorker::count_rays(const PathArray<uint32_t>& slots, size_t count) {
    for (size_t i = 0; i < count; ++i) ++rays_per_slot_[slots[i]];
}

// Wave by wave, until each sample is the mean of all of its paths.
void PathWorker::add_further_paths(SampleBuffer& samples) {
    // An observer has seen the sample already.
    PathObserver* observer = std::exchange(observer_, nullptr);
    paths_.rays.count = 0;
    for (const PixelSamples::Sample& sample : pixel_samples_->found()) {
        for (uint32_t i = 1; i < sample.paths; ++i) {
            const CameraStart start = pixel_samples_->start(sample, i);
            if (!(start.weight > 0.0F)) {
                if (counts_rays_) adaptive_->record(sample.x, sample.y, 0.0F, 0);
                continue;
            }
            if (paths_.rays.count == max_slots_per_block) trace_further_paths(samples);
            if (rivals_) rivals_->paths_per_sample[further_.size()] = shared_by(sample);
            further_.push_back(&sample);
            push_path(start.origin, start.direction, start.weight, start.seed, start.index);
        }
    }
    trace_further_paths(samples);
    observer_ = observer;
    for (const PixelSamples::Sample& sample : pixel_samples_->found()) {
        const float share = 1.0F / static_cast<float>(sample.paths);
        for (int c = 0; c < 3; ++c) {
            samples.radiance[c][sample.slot] *= share;
            if (context_.aovs.caustic) samples.caustic[c][sample.slot] *= share;
        }
    }
}

void PathWorker::trace_further_paths(SampleBuffer& samples) {
    if (counts_rays_) std::fill_n(rays_per_slot_.data(), further_.size(), 0U);
    clear_samples(*further_samples_, context_.aovs, further_.size());
    trace_paths(*further_samples_);
    for (size_t i = 0; i < further_.size(); ++i) {
        const PixelSamples::Sample& sample = *further_[i];
        if (counts_rays_) {
            adaptive_->record(sample.x, sample.y, luminance(further_samples_->radiance_of(i)), rays_per_slot_[i]);
        }
        for (int c = 0; c < 3; ++c) {
            samples.radiance[c][sample.slot] += further_samples_->radiance[c][i];
            if (context_.aovs.caustic) samples.caustic[c][sample.slot] += further_samples_->caustic[c][i];
        }
    }
    further_.clear();
    paths_.rays.count = 0;
}

void PathWorker::trace(uint32_t bounce) {
    rays_ += paths_.rays.count;
    if (counts_rays_) count_rays(paths_.slot, paths_.rays.count);
    context_.accelerator.intersect(paths_.rays, bounce == 0, hits_);
}

// What scattering had to leave open before the rays were traced.
void PathWorker::arrive(const SampleBuffer& samples) {
    if (guided_last_ && guide_is_for_casters_) settle_guided();
    if (observer_ == nullptr) return;
    observer_->scattered({paths_, *scattered_from_, vertices_, guided_last_ ? &guided_->batch : nullptr}, samples);
}

// A guide for casters shares its directions with the BSDF where they meet one. Everywhere else the BSDF's count alone,
// by their own density: few vertices need the guide's.
void PathWorker::settle_guided() {
    GuideBatch& batch = guided_->batch;
    open_paths_.clear();
    open_vertices_.clear();
    for (size_t i = 0; i < paths_.rays.count; ++i) {
        const uint32_t vertex = (*scattered_from_)[i];
        if (batch.fraction[vertex] == 0.0F) continue;
        const bool met = meets_caster(context_.surfaces, hits_.object[i]);
        if (!met) {
            batch.pdf[vertex] = 0.0F;
            if (batch.guided[vertex] == 0.0F) continue;
            hits_.object[i] = no_hit;
            paths_.throughput.set(i, Vec3(0.0F));
        } else if (batch.guided[vertex] == 0.0F && paths_.pdf[i] > 0.0F) {  // Mirror directions have no density.
            open_paths_.push_back(static_cast<uint32_t>(i));
            if (batch.pdf[vertex] == 0.0F) open_vertices_.push_back(vertex);
        }
    }
    if (!open_vertices_.empty()) {
        guide_->find_densities(guide_points(vertices_, vertices_.wo, lights_.wi), open_vertices_, batch);
    }
    for (const uint32_t i : open_paths_) count_guide_in(i, (*scattered_from_)[i]);
}

/// From the BSDF's density to that of guide and BSDF together.
void PathWorker::count_guide_in(size_t path, size_t vertex) {
    const GuideBatch& batch = guided_->batch;
    const float alone = paths_.pdf[path], both = alone + batch.fraction[vertex] * batch.pdf[vertex];
    const float factor = alone / both;
    paths_.pdf[path] = both;
    paths_.throughput.set(path, paths_.throughput.get(path) * factor);
    if (rivals_) rivals_->path_chain[path] *= squared(factor);
}

// Adds what hit lights emit and finds the surface points that scatter.
void PathWorker::collect_vertices(uint32_t bounce, SampleBuffer& samples) {
    const Surfaces& surfaces = context_.surfaces;
    const bool last = bounce == context_.max_depth;
    const bool has_environment = context_.lights.environment() != nullptr;
    const auto object_count = static_cast<uint32_t>(surfaces.object_count());
    list_hits(surfaces, paths_, hits_, has_environment, vertices_, special_paths_);
    if (last) vertices_.count = 0;
    interpolate_plain_vertices(surfaces, paths_, hits_, vertices_);
    for (const uint32_t i : special_paths_) {
        const uint32_t object = hits_.object[i];
        if (object == no_hit) {
            add_escaped(i, samples);
        } else if (object >= object_count) {
            add_sphere_light(i, object - object_count, bounce, samples);
        } else {
            const SurfaceInteraction surface =
                surfaces.interact(object, hits_.primitive[i], hits_.u[i], hits_.v[i], -paths_.rays.direction(i));
            if (surfaces.emits(object)) add_surface_emission(i, surface, samples);
            if (!last) push_vertex(paths_, i, surface, vertices_);
        }
    }
    if (context_.aovs.caustic) set_flags();
    if (bounce == 0) record_first_hits(context_.aovs, hits_, vertices_, samples);
    if (rivals_) carry_sums(bounce);
}

// Towards MisSums of the vertices: of what splats would do for the path so far.
NEPHROID_FLATTEN void PathWorker::carry_sums(uint32_t bounce) {
    for (size_t k = 0; k < vertices_.count; k += simd_width) {
        const FloatV cosine = dot(vertices_.geometric_normal.load(k), vertices_.wo.load(k));
        if (bounce == 0) {
            const CameraView<FloatV> view = light_tracing_->projection.view(vertices_.position.load(k));
            const UintV slot(&vertices_.slot[k], stdx::vector_aligned);
            const FloatV camera_paths =
                gather(rivals_->paths_per_sample.data(), slot, first_lanes(vertices_.count - k));
            rivals_->sums.store(
                k, mis_camera_start(view.pixel_density * cosine * camera_paths, FloatV(light_tracing_->light_paths)));
            continue;
        }
        const auto active = first_lanes(vertices_.count - k);
        const UintV path(&vertices_.path[k], stdx::vector_aligned);
        const MisSums<FloatV> past{FloatV(0.0F), gather(rivals_->path_chain.data(), path, active)};
        rivals_->sums.store(k, mis_arrive(past, gather(hits_.t.data(), path, active), cosine));
    }
}

void PathWorker::set_flags() {
    for (size_t k = 0; k < vertices_.count; ++k) {
        const size_t path = vertices_.path[k];
        const bool is_caster = context_.surfaces.is_caster(hits_.object[path]);
        vertices_.flags[k] = path_flags_at(is_caster, paths_.flags[path]);
    }
}

void PathWorker::add_escaped(size_t path, SampleBuffer& samples) {
    const Environment* environment = context_.lights.environment();
    if (environment == nullptr) return;
    const Environment::Evaluation evaluation = environment->evaluate(paths_.rays.direction(path));
    const float light_pdf = context_.lights.environment_probability() * evaluation.pdf;
    add_emission(path, evaluation.radiance, weight_of_hit(path, light_pdf), false, samples);
}

void PathWorker::add_sphere_light(size_t path, uint32_t light, uint32_t bounce, SampleBuffer& samples) {
    const Vec3 origin = paths_.rays.origin(path);
    const PunctualLight& sphere = context_.scene.lights[light];
    const Vec3 from_centre = origin - sphere.position;
    if (glm::dot(from_centre, from_centre) <= sphere.radius * sphere.radius) return;  // Emits outwards only.
    const float light_pdf = context_.lights.pdf_sphere(light, origin);
    float weight = weight_of_hit(path, light_pdf);
    if (rivals_ && bounce > 1) {
        const float density =
            light_tracing_->emission.ray_density(light, light_pdf, origin, -paths_.rays.direction(path), hits_.t[path]);
        weight = 1.0F / (1.0F / weight + squared(density) * rivals_->path_chain[path]);
    }
    add_emission(path, LightSet::sphere_radiance(sphere), weight, true, samples);
}

void PathWorker::add_surface_emission(size_t path, const SurfaceInteraction& surface, SampleBuffer& samples) {
    const Material& material = context_.surfaces.material(hits_.object[path]);
    if (!surface.front && !material.double_sided) return;
    float weight = 1.0F;
    if (paths_.pdf[path] > 0.0F) {
        const float light_pdf =
            context_.lights.pdf_triangle(hits_.object[path], hits_.primitive[path], surface.area,
                                         paths_.rays.origin(path), surface.position, surface.geometric_normal);
        weight = weight_of_hit(path, light_pdf);
    }
    add_emission(path, emitted_radiance(context_.scene, material, surface.uv), weight, false, samples);
}

/// Of a light that the path ran into, against next event estimation from its last vertex.
float PathWorker::weight_of_hit(size_t path, float light_pdf) const {
    const bool competes = paths_.pdf[path] > 0.0F && light_pdf > 0.0F;
    return competes ? power_heuristic(paths_.pdf[path], light_pdf) : 1.0F;
}

void PathWorker::add_emission(size_t path, const Rgb& radiance, float weight, bool small_light, SampleBuffer& samples) {
    const Rgb contribution = paths_.throughput.get(path) * radiance * weight;
    const size_t slot = paths_.slot[path];
    const bool caustic = context_.aovs.caustic && small_light && (paths_.flags[path] & on_caster_chain) != 0;
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
        const UintV slot(&vertices_.slot[first], stdx::vector_aligned);
        const auto active = first_lanes(vertices_.count - first);
        const UintV seed = gather(seeds_.data(), slot, active);
        const UintV index = gather(indices_.data(), slot, active);
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
            lights_.infinite[k] = sample.infinite ? 1.0F : 0.0F;
            if (rivals_) rivals_->light[k] = sample.light;
            const bool small = sample.light < context_.scene.lights.size();
            lights_.caustic[k] = small && (vertices_.flags[k] & on_caster_chain) != 0 ? 1 : 0;
        }
    }
}

// The same for a scene whose only light is a delta light: no choice to make, and a vector at a time.
NEPHROID_FLATTEN void PathWorker::sample_single_light(const PunctualLight& light) {
    const float infinite = light.kind == LightKind::directional ? 1.0F : 0.0F;
    for (size_t i = 0; i < vertices_.count; i += simd_width) {
        const DeltaLightSample<FloatV> sample = sample_delta_light(light, vertices_.position.load(i));
        lights_.wi.store(i, sample.wi);
        lights_.radiance.store(i, sample.irradiance);
        lights_.target.store(i, {FloatV(light.position.x), FloatV(light.position.y), FloatV(light.position.z)});
        FloatV(1.0F).copy_to(&lights_.pdf[i], stdx::vector_aligned);
        FloatV(0.0F).copy_to(&lights_.bsdf_competes[i], stdx::vector_aligned);
        FloatV(infinite).copy_to(&lights_.infinite[i], stdx::vector_aligned);
    }
    if (rivals_) std::fill_n(rivals_->light.data(), vertices_.count, 0U);
    for (size_t k = 0; k < vertices_.count && context_.aovs.caustic; ++k) {
        lights_.caustic[k] = (vertices_.flags[k] & on_caster_chain) != 0 ? 1 : 0;
    }
}

void PathWorker::find_ray_densities() {
    for (size_t k = 0; k < vertices_.count; ++k) {
        rivals_->ray_density[k] = 0.0F;
        if (!(rivals_->sums.chain[k] > 0.0F && lights_.pdf[k] > 0.0F)) continue;
        const Vec3 position = vertices_.position.get(k);
        const float distance = glm::length(lights_.target.get(k) - position);
        rivals_->ray_density[k] = light_tracing_->emission.ray_density(rivals_->light[k], lights_.pdf[k], position,
                                                                       -lights_.wi.get(k), distance);
    }
}

// BSDF's directions, replaced by the guide's where it takes over.
NEPHROID_FLATTEN void PathWorker::choose_directions(uint32_t bounce) {
    GuidedWave& wave = *guided_;
    GuideBatch& batch = wave.batch;
    batch.count = vertices_.count;
    batch.wants_light_pdf = context_.lights.has_hittable() && !guide_is_for_casters_;
    std::fill_n(batch.density_wanted.data(), batch.count, guide_is_for_casters_ ? 0.0F : 1.0F);
    for (size_t k = 0; k < vertices_.count; k += simd_width) {
        const UintV slot(&vertices_.slot[k], stdx::vector_aligned);
        const auto active = first_lanes(vertices_.count - k);
        const UintV seed = gather(seeds_.data(), slot, active);
        const UintV index = gather(indices_.data(), slot, active);
        const FloatV u_lobe = sample_2d(context_.sampler, seed, index, dimension_of(bounce, lobe_and_roulette)).first;
        const auto [u, v, choice] = sample_3d(context_.sampler, seed, index, dimension_of(bounce, direction));
        const Frame<FloatV> frame = make_frame(vertices_.shading_normal.load(k));
        const BsdfParameters<FloatV> bsdf = vertices_.bsdf(k);
        const BsdfSample<FloatV> sample = sample_bsdf(bsdf, frame.to_local(vertices_.wo.load(k)), u_lobe, u, v);
        batch.direction.store(k, frame.to_world(sample.wi));
        wave.delta_weight.store(k, sample.weight);
        select(sample.delta, FloatV(1.0F), FloatV(0.0F)).copy_to(&wave.delta[k], stdx::vector_aligned);
        const auto narrow = is_narrow_metal(bsdf.metallic, bsdf.alpha, least_guided_alpha_);
        select(narrow, FloatV(0.0F), FloatV(1.0F)).copy_to(&batch.fraction[k], stdx::vector_aligned);
        choice.copy_to(&batch.u_choice[k], stdx::vector_aligned);
        u.copy_to(&batch.u[k], stdx::vector_aligned);
        v.copy_to(&batch.v[k], stdx::vector_aligned);
    }
    guide_->guide(guide_points(vertices_, vertices_.wo, lights_.wi), batch);
}

// The direction that BSDF or guide chose, weighted by the density of both together, or by the BSDF's part of it where
// that is settled on arrival.
NEPHROID_FLATTEN BsdfSample<FloatV> PathWorker::guided_sample(size_t k, const Frame<FloatV>& frame) const {
    const GuideBatch& batch = guided_->batch;
    const FloatV zero(0.0F);
    const FloatV fraction = load(batch.fraction, k);
    const Triple<FloatV> wi = frame.to_local(batch.direction.load(k));
    const BsdfEvaluation<FloatV> bsdf = evaluate_bsdf(vertices_.bsdf(k), frame.to_local(vertices_.wo.load(k)), wi);
    FloatV pdf = mixed_pdf(batch, k, bsdf.pdf, batch.pdf);
    if (guide_is_for_casters_) {
        pdf = select(load(batch.guided, k) > zero, pdf, (FloatV(1.0F) - fraction) * bsdf.pdf);
    }
    const auto delta = (load(guided_->delta, k) > zero) && (load(batch.guided, k) == zero);
    const FloatV inverse_pdf = select(pdf > zero, FloatV(1.0F) / pdf, zero);
    const Triple<FloatV> weight = select<FloatV>(
        delta, guided_->delta_weight.load(k) * (FloatV(1.0F) / (FloatV(1.0F) - fraction)), bsdf.value * inverse_pdf);
    return {wi, weight, pdf, delta};
}

// radiance <- throughput * f * cos * radiance * MIS weight / pdf.
NEPHROID_FLATTEN void PathWorker::weigh_lights(uint32_t bounce, bool guided) {
    const FloatV zero(0.0F);
    const bool guide_competes = guided && context_.lights.has_hittable();
    const bool splats_compete = rivals_ && bounce > 0;
    for (size_t i = 0; i < vertices_.count; i += simd_width) {
        const Frame<FloatV> frame = make_frame(vertices_.shading_normal.load(i));
        const Triple<FloatV> wi = lights_.wi.load(i);
        const BsdfEvaluation<FloatV> bsdf =
            evaluate_bsdf(vertices_.bsdf(i), frame.to_local(vertices_.wo.load(i)), frame.to_local(wi));
        const FloatV pdf = load(lights_.pdf, i);
        // The geometric half space decides what is lit: a shading normal alone would let light leak through.
        const auto lit = (dot(vertices_.geometric_normal.load(i), wi) > zero) && (pdf > zero);
        FloatV direction_pdf = bsdf.pdf;
        if (guide_competes) {
            direction_pdf = guide_is_for_casters_ ? (FloatV(1.0F) - load(guided_->batch.fraction, i)) * bsdf.pdf
                                                  : mixed_pdf(guided_->batch, i, bsdf.pdf, guided_->batch.light_pdf);
        }
        direction_pdf = direction_pdf * load(lights_.bsdf_competes, i);
        FloatV weight = power_heuristic(pdf, direction_pdf) / pdf;
        if (splats_compete) {
            const FloatV reverse_pdf =
                evaluate_bsdf(vertices_.bsdf(i), frame.to_local(wi), frame.to_local(vertices_.wo.load(i))).pdf;
            const FloatV cosine = dot(vertices_.geometric_normal.load(i), wi);
            weight = mis_weight_light(rivals_->sums.load(i), pdf, direction_pdf, load(rivals_->ray_density, i), cosine,
                                      reverse_pdf) /
                     pdf;
        }
        const Triple<FloatV> contribution =
            vertices_.throughput.load(i) * bsdf.value * lights_.radiance.load(i) * weight;
        lights_.radiance.store(i, select<FloatV>(lit, contribution, {zero, zero, zero}));
    }
}

// Long paths live on with a probability in proportion to their throughput. Guided directions have a density so high
// that little throughput is left after them: the light they are for has been found at the vertex they led to, `before`
// it scatters, and what follows is hardly worth tracing.
FloatV PathWorker::survival_probability(const FloatV& before, const FloatV& after, uint32_t bounce) const {
    const FloatV one(1.0F), least(least_survival);
    if (bounce + 1 > roulette_start) {
        const float limit = guide_ == nullptr ? 1.0F : guided_roulette_throughput;
        return minimum(one, maximum(least, after * FloatV(1.0F / limit)));
    }
    if (guide_ == nullptr || guide_leads_on_) return one;
    return minimum(one, maximum(least, before * FloatV(1.0F / spent_throughput)));
}

// Samples a direction at every vertex; the survivors become the next wave.
template <bool guided>
NEPHROID_FLATTEN void PathWorker::scatter(uint32_t bounce) {
    const FloatV zero(0.0F);
    const FloatV infinity(std::numeric_limits<float>::infinity());
    RayBatch& rays = paths_.rays;
    rays.count = 0;
    for (size_t k = 0; k < vertices_.count; k += simd_width) {
        const UintV slot(&vertices_.slot[k], stdx::vector_aligned);
        const auto active = first_lanes(vertices_.count - k);
        const UintV seed = gather(seeds_.data(), slot, active);
        const UintV index = gather(indices_.data(), slot, active);
        const auto [u_lobe, u_roulette] =
            sample_2d(context_.sampler, seed, index, dimension_of(bounce, lobe_and_roulette));
        const auto [u, v] = sample_2d(context_.sampler, seed, index, dimension_of(bounce, direction));
        const Frame<FloatV> frame = make_frame(vertices_.shading_normal.load(k));
        BsdfSample<FloatV> sample;
        if constexpr (guided) {
            sample = guided_sample(k, frame);
        } else {
            sample = sample_bsdf(vertices_.bsdf(k), frame.to_local(vertices_.wo.load(k)), u_lobe, u, v);
        }
        const Triple<FloatV> wi = guided ? guided_->batch.direction.load(k) : frame.to_world(sample.wi);
        Triple<FloatV> weight = vertices_.throughput.load(k) * sample.weight;
        const FloatV survival =
            survival_probability(max_component(vertices_.throughput.load(k)), max_component(weight), bounce);
        weight = weight * (FloatV(1.0F) / survival);
        const Triple<FloatV> normal = vertices_.geometric_normal.load(k);
        const auto lives =
            active && (u_roulette < survival) && (max_component(weight) > zero) && (dot(normal, wi) > zero);
        const Triple<FloatV> origin =
            offset_ray_origin(vertices_.position.load(k), vertices_.error.load(k), normal, wi);
        append_rays(rays, origin, wi, infinity, lives);
        if (scattered_from_) {
            compress_store(&(*scattered_from_)[rays.count], lane_numbers() + UintV(static_cast<uint32_t>(k)), lives);
        }
        paths_.throughput.append(rays.count, weight, lives);
        compress_store(&paths_.pdf[rays.count], select(sample.delta, zero, sample.pdf), lives);
        if (rivals_) {
            const FloatV reverse_pdf =
                evaluate_bsdf(vertices_.bsdf(k), sample.wi, frame.to_local(vertices_.wo.load(k))).pdf;
            const MisSums<FloatV> after =
                mis_scatter(rivals_->sums.load(k), dot(normal, wi), sample.pdf, reverse_pdf, sample.delta);
            compress_store(&rivals_->path_chain[rays.count], after.chain, lives);
        }
        compress_store(&paths_.slot[rays.count], slot, lives);
        compress_store(&paths_.flags[rays.count], UintV(&vertices_.flags[k], stdx::vector_aligned), lives);
        rays.count += count_of(lives);
    }
}

}  // namespace nephroid

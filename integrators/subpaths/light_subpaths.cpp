#include "integrators/subpaths/light_subpaths.h"

#include <algorithm>

#include "integrators/path/wave_stages.h"

namespace nephroid {

namespace {

// Dimension pairs of a light sub-path: emission, then two per scattering.
enum LightDimension : uint32_t { light_choice, emission_position, emission_direction, first_scattering };

/// Light sub-paths draw from their own sequences. All slots of a tile share one, since each light path serves the whole
/// picture: the paths of a tile are stratified together. (A sequence per pixel instead made no
/// difference beyond that of seeds.)
constexpr uint32_t light_seed_salt = 0x2c1b3c6dU;

}  // namespace

LightSubpaths::LightSubpaths(const LightTracing& context)
    : context_(context),
      tracer_(context.render),
      viewer_(max_slots_per_block),
      emissions_(max_slots_per_block),
      emitted_(max_slots_per_block),
      splats_(max_slots_per_block) {
    if (context.guide == nullptr) return;
    guide_ = context.guide->make_worker();
    least_guided_alpha_ = context.guide->least_alpha();
    guide_is_for_casters_ = context.guide->is_for_casters();
    if (guide_is_for_casters_) left_caster_ = PathArray<uint32_t>(max_slots_per_block);
    from_camera_.emplace(max_slots_per_block);
    from_next_.emplace(max_slots_per_block);
}

void LightSubpaths::trace(const SampleBlock& block, SampleBuffer& samples) {
    stored_.vertices.clear();
    std::fill_n(stored_.last.data(), block.slot_count(), no_vertex);
    const uint32_t max_depth = context_.render.max_depth;
    if (max_depth == 0 || context_.render.lights.empty()) return;
    if (guide_is_for_casters_) std::fill_n(left_caster_.data(), max_slots_per_block, 0U);
    tile_x_ = block.tile_x;
    tile_y_ = block.tile_y;
    is_recorded_ = context_.adaptive != nullptr && context_.adaptive->recording();
    const uint64_t rays_before = ray_count();
    start(block);
    for (uint32_t bounce = 0; tracer_.paths.rays.count > 0; ++bounce) {
        tracer_.trace(false);
        find_vertices(bounce);
        if (tracer_.vertices.count == 0) break;
        if (guide_) start_questions(*from_camera_);
        if (bounce > 0 || context_.connections) {
            connect_to_camera();
            if (guide_) look_from_camera();
            weigh_splats();
            add_splats(samples);
        }
        if (bounce + 1 == max_depth) break;
        if (context_.connections) store_vertices(bounce);
        const uint32_t dimension = first_scattering + 2 * bounce;
        tracer_.scatter<Transport::importance>({bounce, dimension, dimension + 1, emitted_});
        if (guide_) look_from_next_vertices();
        tracer_.scatter_sums(context_.connections, guide_ ? &*from_next_ : nullptr);
    }
    if (is_recorded_) context_.adaptive->record_light_rays(tile_x_, tile_y_, ray_count() - rays_before);
}

// Light paths are spread evenly over the samples of the block: parts of a block may be dropped. They count as many
// times as there are samples for each.
void LightSubpaths::start(const SampleBlock& block) {
    constexpr uint32_t tile_pixels = uint32_t{tile_size} * tile_size;
    const uint32_t tile_seed = hash_combine(
        pixel_seed(static_cast<uint32_t>(block.tile_x), static_cast<uint32_t>(block.tile_y), context_.render.seed),
        light_seed_salt);
    slots_.clear();
    for (uint32_t s = 0; s < block.sample_count; ++s) {
        const uint32_t first_index = (block.first_sample + s) * (tile_pixels / context_.one_in);
        for (uint32_t p = 0; p < block.pixel_count; p += context_.one_in) {
            const uint32_t slot = s * block.pixel_count + p;
            tracer_.seeds[slot] = tile_seed;
            tracer_.indices[slot] = first_index + p / context_.one_in;
            slots_.push_back(slot);
        }
    }
    const uint32_t paths_per_sample = (block.pixel_count + context_.one_in - 1) / context_.one_in;
    const float weight = static_cast<float>(block.pixel_count) / static_cast<float>(paths_per_sample);
    tracer_.paths.rays.count = 0;
    const SamplerKind sampler = context_.render.sampler;
    const size_t count = slots_.size();
    alignas(simd_alignment) float u[5][simd_width];
    slots_.resize((slots_.size() + simd_width - 1) / simd_width * simd_width, slots_.back());
    for (size_t first = 0; first < count; first += simd_width) {
        const UintV slot(&slots_[first], stdx::element_aligned);
        const auto active = first_lanes(count - first);
        const UintV seed = gather(tracer_.seeds.data(), slot, active);
        const UintV index = gather(tracer_.indices.data(), slot, active);
        const auto [position_x, position_y] = sample_2d(sampler, seed, index, emission_position);
        const auto [direction_x, direction_y] = sample_2d(sampler, seed, index, emission_direction);
        sample_1d(sampler, seed, index, light_choice).copy_to(u[0], stdx::vector_aligned);
        position_x.copy_to(u[1], stdx::vector_aligned);
        position_y.copy_to(u[2], stdx::vector_aligned);
        direction_x.copy_to(u[3], stdx::vector_aligned);
        direction_y.copy_to(u[4], stdx::vector_aligned);
        for (size_t i = first; i < std::min(first + simd_width, count); ++i) {
            const size_t lane = i - first;
            EmissionSample emission =
                context_.emission.sample(u[0][lane], {u[1][lane], u[2][lane]}, {u[3][lane], u[4][lane]});
            emission.weight *= weight;
            add_path(slots_[i], emission);
        }
    }
}

void LightSubpaths::add_path(size_t slot, const EmissionSample& emission) {
    emissions_[slot] = emission;
    emitted_[slot] = max_component(emission.weight);
    if (!(emitted_[slot] > 0.0F)) return;
    PathWave& paths = tracer_.paths;
    const size_t i = paths.rays.count;
    paths.rays.push(emission.origin, emission.direction);
    paths.throughput.set(i, emission.weight);
    paths.slot[i] = static_cast<uint32_t>(slot);
    paths.flags[i] = emission.light < context_.render.scene.lights.size() ? from_small_light : 0U;
}

void LightSubpaths::find_vertices(uint32_t bounce) {
    const Surfaces& surfaces = context_.render.surfaces;
    tracer_.find_vertices(false);
    for (const uint32_t i : tracer_.special) {
        const uint32_t object = tracer_.hits.object[i];
        if (object >= surfaces.object_count()) continue;  // A sphere light reflects nothing.
        push_vertex(tracer_.paths, i,
                    surfaces.interact(object, tracer_.hits.primitive[i], tracer_.hits.u[i], tracer_.hits.v[i],
                                      -tracer_.paths.rays.direction(i)),
                    tracer_.vertices);
    }
    if (bounce == 0) {
        start_sums();
    } else {
        tracer_.carry_sums();
    }
    if (context_.render.aovs.caustic) set_flags(bounce);
}

void LightSubpaths::start_sums() {
    const VertexWave& vertices = tracer_.vertices;
    for (size_t k = 0; k < vertices.count; ++k) {
        const EmissionSample& emission = emissions_[vertices.slot[k]];
        const Vec3 position = vertices.position.get(k);
        const Vec3 wo = vertices.wo.get(k);
        const float distance = tracer_.hits.t[vertices.path[k]];
        const float direct_pdf = context_.emission.direct_density(emission, position, distance);
        const float ray_density =
            context_.emission.ray_density(emission.light, direct_pdf, position, emission.direction, distance);
        const float cosine = glm::dot(vertices.geometric_normal.get(k), wo);
        tracer_.sums.set(k, mis_light_start(direct_pdf, ray_density, cosine, emission.delta));
    }
}

void LightSubpaths::set_flags(uint32_t bounce) {
    VertexWave& vertices = tracer_.vertices;
    for (size_t k = 0; k < vertices.count; ++k) {
        const size_t path = vertices.path[k];
        const uint32_t before = tracer_.paths.flags[path];
        const bool caster = context_.render.surfaces.is_caster(tracer_.hits.object[path]);
        if (bounce == 0) {
            vertices.flags[k] = before == from_small_light && caster ? by_casters_only : 0U;
        } else {
            vertices.flags[k] = before == by_casters_only && !caster ? is_caustic : before;
        }
    }
}

void LightSubpaths::store_vertices(uint32_t bounce) {
    const VertexWave& v = tracer_.vertices;
    for (size_t k = 0; k < v.count; ++k) {
        if (is_narrow_metal(v.metallic[k], v.alpha[k], delta_alpha)) continue;  // Nothing can be connected to a mirror.
        uint32_t& last = stored_.last[v.slot[k]];
        const MisSums<float> sums = tracer_.sums.get(k);
        stored_.vertices.push_back({v.position.get(k), v.error.get(k), v.geometric_normal.get(k),
                                    v.shading_normal.get(k), v.wo.get(k), v.throughput.get(k), v.base.get(k),
                                    v.coat_f0.get(k), v.coat_f90[k], v.metallic[k], v.alpha[k], sums.connect,
                                    sums.chain, last, bounce + 1, v.flags[k]});
        last = static_cast<uint32_t>(stored_.vertices.size() - 1);
    }
}

// Strategy t = 1: rays from the vertices to the camera, with the radiance of the pixel that they bring.
NEPHROID_FLATTEN void LightSubpaths::connect_to_camera() {
    const VertexWave& vertices = tracer_.vertices;
    const PixelRegion& crop = context_.crop;
    const FloatV zero(0.0F);
    ShadowWave& shadows = splats_.shadows;
    RayBatch& rays = shadows.rays;
    rays.count = 0;
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const Triple<FloatV> position = vertices.position.load(k);
        const CameraView<FloatV> view = context_.projection.view(position);
        const Triple<FloatV> normal = vertices.geometric_normal.load(k);
        const FloatV cosine = dot(normal, view.wi);
        auto seen = first_lanes(vertices.count - k) && (view.depth > zero) && (cosine > zero) &&
                    (view.x >= FloatV(static_cast<float>(crop.x0))) && (view.x < FloatV(static_cast<float>(crop.x1))) &&
                    (view.y >= FloatV(static_cast<float>(crop.y0))) && (view.y < FloatV(static_cast<float>(crop.y1)));
        if (stdx::none_of(seen)) continue;
        viewer_.store(k, view.wi);
        const Frame<FloatV> frame = make_frame(vertices.shading_normal.load(k));
        const Triple<FloatV> back = vertices.wo.load(k);
        // Seen from the camera, light comes from `back`: f |back.Ns| |wi.Ng| / |back.Ng|, the adjoint BSDF.
        const BsdfEvaluation<FloatV> bsdf =
            evaluate_bsdf(vertices.bsdf(k), frame.to_local(view.wi), frame.to_local(back));
        const Triple<FloatV> contribution = vertices.throughput.load(k) * bsdf.value;
        // "Not zero" rather than "positive": a non-finite contribution must arrive where it is counted.
        seen = seen && !(contribution.x == zero && contribution.y == zero && contribution.z == zero);
        const Triple<FloatV> origin = offset_ray_origin(position, vertices.error.load(k), normal, view.wi);
        append_rays(rays, origin, view.target - origin, FloatV(segment_end), seen);
        shadows.contribution.append(rays.count, contribution, seen);
        compress_store(&shadows.slot[rays.count], UintV(&vertices.slot[k], stdx::vector_aligned), seen);
        compress_store(&shadows.caustic[rays.count], UintV(&vertices.flags[k], stdx::vector_aligned), seen);
        compress_store(&splats_.vertex[rays.count], lane_numbers() + UintV(static_cast<uint32_t>(k)), seen);
        compress_store(&splats_.film_x[rays.count], view.x, seen);
        compress_store(&splats_.film_y[rays.count], view.y, seen);
        compress_store(&splats_.density[rays.count], view.pixel_density * cosine, seen);
        compress_store(&splats_.back_cosine[rays.count], dot(normal, back), seen);
        compress_store(&splats_.back_pdf[rays.count], bsdf.pdf, seen);
        splats_.sums.append(rays.count, tracer_.sums.load(k), seen);
        rays.count += count_of(seen);
    }
    shadow_ray_count_ += rays.count;
    context_.render.accelerator.occluded(rays, false, shadows.occluded);
}

// The guide's density of the direction that the light has come from is wanted where a splat arrives.
void LightSubpaths::look_from_camera() {
    for (size_t i = 0; i < splats_.shadows.rays.count; ++i) {
        if (splats_.shadows.occluded[i] == 0) ask(splats_.vertex[i], *from_camera_);
    }
    answer(*from_camera_);
}

NEPHROID_FLATTEN void LightSubpaths::weigh_splats() {
    ShadowWave& shadows = splats_.shadows;
    for (size_t i = 0; i < shadows.rays.count; i += simd_width) {
        const auto load = [i](const PathArray<float>& values) { return FloatV(&values[i], stdx::vector_aligned); };
        const FloatV density = load(splats_.density);
        FloatV back_pdf = load(splats_.back_pdf);
        if (guide_) {
            const auto active = first_lanes(shadows.rays.count - i);
            const UintV vertex(&splats_.vertex[i], stdx::vector_aligned);
            back_pdf = mixed_pdf(gather(from_camera_->fraction.data(), vertex, active), back_pdf,
                                 gather(from_camera_->pdf.data(), vertex, active));
        }
        const FloatV weight = mis_weight_camera(splats_.sums.load(i), density * camera_paths_of_splats(i),
                                                context_.light_paths, back_pdf) *
                              density / maximum(load(splats_.back_cosine), FloatV(mis_floor));
        shadows.contribution.store(i, shadows.contribution.load(i) * weight);
    }
}

/// Per sample of the pixels that splats i and following come to.
FloatV LightSubpaths::camera_paths_of_splats(size_t i) const {
    if (context_.adaptive == nullptr) return FloatV(1.0F);
    alignas(simd_alignment) float paths[simd_width] = {};
    for (size_t lane = 0; lane < simd_width && i + lane < splats_.shadows.rays.count; ++lane) {
        paths[lane] = static_cast<float>(context_.adaptive->paths(static_cast<int>(splats_.film_x[i + lane]),
                                                                  static_cast<int>(splats_.film_y[i + lane])));
    }
    return FloatV(paths, stdx::vector_aligned);
}

void LightSubpaths::add_splats(SampleBuffer& samples) {
    const ShadowWave& shadows = splats_.shadows;
    const float share_of_sample = 1.0F / (context_.light_paths * static_cast<float>(context_.one_in));
    for (size_t i = 0; i < shadows.rays.count; ++i) {
        if (shadows.occluded[i] != 0) continue;
        const int x = static_cast<int>(splats_.film_x[i]), y = static_cast<int>(splats_.film_y[i]);
        const Rgb value = shadows.contribution.get(i);
        samples.splats.push_back({x, y, shadows.slot[i], shadows.caustic[i] == is_caustic, value});
        if (is_recorded_) {
            context_.adaptive->record_splat(tile_x_, tile_y_, x, y, luminance(value) * share_of_sample);
        }
    }
}

// It is wanted where the light path goes on, unless it is known already.
void LightSubpaths::look_from_next_vertices() {
    const RayBatch& rays = tracer_.paths.rays;
    start_questions(*from_next_);
    for (size_t i = 0; i < rays.count; ++i) {
        const uint32_t vertex = tracer_.scattered_from[i];
        if (from_camera_->holds_for_any_wo(vertex)) continue;
        viewer_.set(vertex, rays.direction(i));
        ask(vertex, *from_next_);
    }
    answer(*from_next_);
    for (size_t i = 0; i < rays.count; ++i) {
        const uint32_t vertex = tracer_.scattered_from[i];
        if (!from_camera_->holds_for_any_wo(vertex)) continue;
        from_next_->fraction[vertex] = from_camera_->fraction[vertex];
        from_next_->pdf[vertex] = from_camera_->pdf[vertex];
    }
    for (size_t i = 0; i < rays.count && guide_is_for_casters_; ++i) {
        const uint32_t path = tracer_.vertices.path[tracer_.scattered_from[i]];
        left_caster_[i] = meets_caster(context_.render.surfaces, tracer_.hits.object[path]) ? 1U : 0U;
    }
}

void LightSubpaths::start_questions(GuideBatch& questions) const {
    questions.count = tracer_.vertices.count;
    std::fill_n(questions.fraction.data(), questions.count, 0.0F);
}

void LightSubpaths::ask(size_t vertex, GuideBatch& questions) const {
    const VertexWave& vertices = tracer_.vertices;
    if (is_narrow_metal(vertices.metallic[vertex], vertices.alpha[vertex], least_guided_alpha_)) return;
    questions.fraction[vertex] = 1.0F;
    questions.u_choice[vertex] = 1.0F;  // Keeps the direction as it is.
    questions.direction.set(vertex, vertices.wo.get(vertex));
    // Elsewhere its directions do not count, and it is enough to know how often it takes them from the BSDF.
    if (guide_is_for_casters_)
        questions.density_wanted[vertex] = static_cast<float>(left_caster_[vertices.path[vertex]]);
}

void LightSubpaths::answer(GuideBatch& questions) {
    guide_->guide(guide_points(tracer_.vertices, viewer_, tracer_.vertices.wo), questions);
    if (!guide_is_for_casters_) return;
    for (size_t k = 0; k < questions.count; ++k) {
        if (left_caster_[tracer_.vertices.path[k]] == 0) questions.pdf[k] = 0.0F;
    }
}

}  // namespace nephroid

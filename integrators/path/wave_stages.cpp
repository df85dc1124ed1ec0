#include "integrators/path/wave_stages.h"

#include <limits>

namespace nephroid {

NEPHROID_FLATTEN void start_camera_paths(const RenderContext& context, const SampleBlock& block,
                                         uint32_t film_dimension, AlignedArray<uint32_t>& seeds,
                                         AlignedArray<uint32_t>& indices, PathWave& paths) {
    const size_t slots = block.slot_count();
    AlignedArray<float>& film_x = paths.pdf;  // Borrowed until the loop below writes the densities.
    AlignedArray<float>& film_y = paths.rays.t_max;
    for (uint32_t s = 0; s < block.sample_count; ++s) {
        for (uint32_t p = 0; p < block.pixel_count; ++p) {
            const size_t slot = size_t{s} * block.pixel_count + p;
            const int x = block.tile_x + block.pixel_x[p];
            const int y = block.tile_y + block.pixel_y[p];
            film_x[slot] = static_cast<float>(x);
            film_y[slot] = static_cast<float>(y);
            seeds[slot] = pixel_seed(static_cast<uint32_t>(x), static_cast<uint32_t>(y), context.seed);
            indices[slot] = block.first_sample + s;
            paths.slot[slot] = static_cast<uint32_t>(slot);
            paths.flags[slot] = 0;
        }
    }
    RayBatch& rays = paths.rays;
    rays.count = slots;
    for (size_t i = 0; i < slots; i += simd_width) {
        const UintV seed(&seeds[i], stdx::vector_aligned);
        const UintV index(&indices[i], stdx::vector_aligned);
        const auto [jitter_x, jitter_y] = sample_2d(context.sampler, seed, index, film_dimension);
        const FloatV x = FloatV(&film_x[i], stdx::vector_aligned) + jitter_x;
        const FloatV y = FloatV(&film_y[i], stdx::vector_aligned) + jitter_y;
        const Triple<FloatV> origin = context.camera_rays.origin(x, y);
        const Triple<FloatV> direction = context.camera_rays.direction(x, y);
        origin.x.copy_to(&rays.origin_x[i], stdx::vector_aligned);
        origin.y.copy_to(&rays.origin_y[i], stdx::vector_aligned);
        origin.z.copy_to(&rays.origin_z[i], stdx::vector_aligned);
        direction.x.copy_to(&rays.direction_x[i], stdx::vector_aligned);
        direction.y.copy_to(&rays.direction_y[i], stdx::vector_aligned);
        direction.z.copy_to(&rays.direction_z[i], stdx::vector_aligned);
        paths.throughput.store(i, {FloatV(1.0F), FloatV(1.0F), FloatV(1.0F)});
        FloatV(0.0F).copy_to(&paths.pdf[i], stdx::vector_aligned);
        FloatV(std::numeric_limits<float>::infinity()).copy_to(&rays.t_max[i], stdx::vector_aligned);
    }
}

// Plain hits without a branch.
void list_hits(const Surfaces& surfaces, const PathWave& paths, const HitBatch& hits, bool wants_misses,
               VertexWave& vertices, std::vector<uint32_t>& special) {
    const auto object_count = static_cast<uint32_t>(surfaces.object_count());
    size_t count = 0;
    special.clear();
    for (size_t i = 0; i < paths.rays.count; ++i) {
        const uint32_t object = hits.object[i];
        const bool plain = object < object_count && surfaces.is_plain(object);
        vertices.path[count] = static_cast<uint32_t>(i);
        count += plain ? 1 : 0;
        if (!plain && (object != no_hit || wants_misses)) special.push_back(static_cast<uint32_t>(i));
    }
    vertices.count = count;
}

NEPHROID_FLATTEN void interpolate_plain_vertices(const Surfaces& surfaces, const PathWave& paths, const HitBatch& hits,
                                                 VertexWave& vertices) {
    const RayBatch& rays = paths.rays;
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const auto active = first_lanes(vertices.count - k);
        const UintV path(&vertices.path[k], stdx::vector_aligned);
        TriangleCorners<FloatV> corners;
        BsdfParameters<FloatV> bsdf;
        surfaces.load_plain(gather(hits.object.data(), path, active), gather(hits.primitive.data(), path, active),
                            active, corners, bsdf);
        const Triple<FloatV> wo{-gather(rays.direction_x.data(), path, active),
                                -gather(rays.direction_y.data(), path, active),
                                -gather(rays.direction_z.data(), path, active)};
        const SurfaceGeometry<FloatV> g =
            interpolate_surface(corners, gather(hits.u.data(), path, active), gather(hits.v.data(), path, active), wo);
        vertices.position.store(k, g.position);
        vertices.error.store(k, g.error);
        vertices.geometric_normal.store(k, g.geometric_normal);
        vertices.shading_normal.store(k, face_forward(g.shading_normal, g.geometric_normal));
        vertices.wo.store(k, wo);
        vertices.throughput.store(k, paths.throughput.gather(path, active));
        vertices.base.store(k, bsdf.base);
        vertices.coat_f0.store(k, bsdf.coat_f0);
        bsdf.coat_f90.copy_to(&vertices.coat_f90[k], stdx::vector_aligned);
        bsdf.metallic.copy_to(&vertices.metallic[k], stdx::vector_aligned);
        bsdf.alpha.copy_to(&vertices.alpha[k], stdx::vector_aligned);
        gather(paths.slot.data(), path, active).copy_to(&vertices.slot[k], stdx::vector_aligned);
    }
}

void push_vertex(const PathWave& paths, size_t path, const SurfaceInteraction& surface, VertexWave& vertices) {
    const size_t k = vertices.count++;
    vertices.path[k] = static_cast<uint32_t>(path);
    vertices.position.set(k, surface.position);
    vertices.error.set(k, surface.error);
    vertices.geometric_normal.set(k, surface.geometric_normal);
    vertices.shading_normal.set(k, surface.shading_normal);
    vertices.wo.set(k, -paths.rays.direction(path));
    vertices.throughput.set(k, paths.throughput.get(path));
    vertices.set_bsdf(k, surface.bsdf);
    vertices.slot[k] = paths.slot[path];
}

void record_first_hits(const AovSelection& aovs, const HitBatch& hits, const VertexWave& vertices,
                       SampleBuffer& samples) {
    if (!aovs.depth && !aovs.normal && !aovs.albedo) return;
    for (size_t k = 0; k < vertices.count; ++k) {
        const size_t slot = vertices.slot[k];
        // One, but where a film guide has a say.
        const float weight = vertices.throughput.get(k).x;
        samples.depth[slot] = weight * hits.t[vertices.path[k]];
        const Vec3 normal = vertices.shading_normal.get(k);
        const Rgb albedo = vertices.base.get(k);
        for (int c = 0; c < 3; ++c) {
            samples.normal[c][slot] = weight * normal[c];
            samples.albedo[c][slot] = weight * albedo[c];
        }
    }
}

NEPHROID_FLATTEN void push_shadow_rays(const VertexWave& vertices, const LightWave& lights, ShadowWave& shadows) {
    const FloatV infinity(std::numeric_limits<float>::infinity());
    RayBatch& rays = shadows.rays;
    rays.count = 0;
    for (size_t k = 0; k < vertices.count; k += simd_width) {
        const Triple<FloatV> contribution = lights.radiance.load(k);
        // "Not zero" rather than "positive": a non-finite contribution must arrive where it is counted.
        const auto lit =
            first_lanes(vertices.count - k) &&
            !(contribution.x == FloatV(0.0F) && contribution.y == FloatV(0.0F) && contribution.z == FloatV(0.0F));
        const Triple<FloatV> wi = lights.wi.load(k);
        const Triple<FloatV> origin =
            offset_ray_origin(vertices.position.load(k), vertices.error.load(k), vertices.geometric_normal.load(k), wi);
        const auto endless = FloatV(&lights.infinite[k], stdx::vector_aligned) > FloatV(0.0F);
        const Triple<FloatV> direction = select<FloatV>(endless, wi, lights.target.load(k) - origin);
        append_rays(rays, origin, direction, select(endless, infinity, FloatV(segment_end)), lit);
        shadows.contribution.append(rays.count, contribution, lit);
        compress_store(&shadows.slot[rays.count], UintV(&vertices.slot[k], stdx::vector_aligned), lit);
        compress_store(&shadows.caustic[rays.count], UintV(&lights.caustic[k], stdx::vector_aligned), lit);
        rays.count += count_of(lit);
    }
}

}  // namespace nephroid

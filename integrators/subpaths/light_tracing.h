// What is needed to follow light from the lights to the camera, and to weigh that against paths from the camera: shared
// settings, and the state of waves of sub-paths beyond the path tracer's.
#pragma once

#include "core/camera.h"
#include "core/light_emission.h"
#include "guiding/directional_guide.h"
#include "integrators/integrator.h"
#include "integrators/path/adaptive_sampling.h"
#include "integrators/path/wave.h"
#include "integrators/subpaths/mis_recursion.h"

namespace nephroid {

/// What all workers share. Which strategies make a path decides its weights, and both sides must agree: camera paths
/// run into lights and sample them at every vertex; light paths are splatted from every vertex.
struct LightTracing {
    const RenderContext& render;
    LightEmission emission;
    CameraProjection projection;
    PixelRegion crop;   ///< Where splats count.
    float light_paths;  ///< Per sample of a pixel: light_paths_per_sample / one_in.
    /// Vertices of both sides are connected too. If not, light sampling alone makes paths of one scattering.
    bool connections = true;
    uint32_t one_in = 1;                      ///< Samples for each that brings a light path: a power of two up to 64.
    const DirectionalGuide* guide = nullptr;  ///< Of camera paths; null: none.
    AdaptiveSampling* adaptive = nullptr;     ///< Of camera paths, told of splats; null: one for each sample.
};

/// MisSums per path.
struct MisArray {
    explicit MisArray(size_t capacity) : connect(capacity), chain(capacity) {}
    PathArray<float> connect, chain;

    MisSums<FloatV> load(size_t i) const {
        return {FloatV(&connect[i], stdx::vector_aligned), FloatV(&chain[i], stdx::vector_aligned)};
    }
    MisSums<FloatV> gather(const UintV& index, const FloatV::mask_type& active) const {
        return {nephroid::gather(connect.data(), index, active), nephroid::gather(chain.data(), index, active)};
    }
    void store(size_t i, const MisSums<FloatV>& sums) {
        sums.connect.copy_to(&connect[i], stdx::vector_aligned);
        sums.chain.copy_to(&chain[i], stdx::vector_aligned);
    }
    void append(size_t i, const MisSums<FloatV>& sums, const FloatV::mask_type& kept) {
        compress_store(&connect[i], sums.connect, kept);
        compress_store(&chain[i], sums.chain, kept);
    }
    MisSums<float> get(size_t i) const { return {connect[i], chain[i]}; }
    void set(size_t i, const MisSums<float>& sums) {
        connect[i] = sums.connect;
        chain[i] = sums.chain;
    }
};

/// Of camera paths whose only rivals are splats.
struct RivalWave {
    explicit RivalWave(size_t capacity)
        : paths_per_sample(capacity), path_chain(capacity), sums(capacity), light(capacity), ray_density(capacity) {}
    PathArray<float> paths_per_sample;  ///< Per slot: camera paths of a sample of its pixel.
    PathArray<float> path_chain;        ///< Per path: MisSums::chain past the last scattering.
    MisArray sums;                      ///< Per vertex.
    PathArray<uint32_t> light;          ///< Per vertex: the light that was sampled.
    PathArray<float> ray_density;       ///< Per vertex: of rays emitted the other way around.
};

/// How light has come to a vertex of a light sub-path, for the caustic layer.
enum LightPathFlag : uint32_t {
    from_small_light = 1,  ///< No vertex so far, and the light is small.
    by_casters_only = 2,   ///< It has, and every vertex so far is a caster.
    is_caustic = 4,        ///< From a small light by casters to a receiver: a caustic, whatever follows.
};

/// A vertex of a light sub-path that others can be connected to. One structure per vertex, of two cache lines, rather
/// than arrays: connections read whole vertices in no particular order.
struct alignas(64) LightVertex {
    Vec3 position, error, geometric_normal, shading_normal;
    Vec3 wo;         ///< Towards the previous vertex.
    Rgb throughput;  ///< Power that arrives.
    Vec3 base, coat_f0;
    float coat_f90, metallic, alpha;
    float mis_connect, mis_chain;
    uint32_t previous;    ///< Index of the sub-path's previous stored vertex, or no_vertex.
    uint32_t scattering;  ///< How many scatterings a path has made past this vertex: 1 at the first.
    uint32_t flags;       ///< LightPathFlag.
};
static_assert(sizeof(LightVertex) == 128);
inline constexpr uint32_t no_vertex = ~0U;

/// Light sub-paths of a block: stored vertices, and the last one of each slot. Keeps its capacity between blocks.
struct LightVertices {
    LightVertices() : last(max_slots_per_block) {}
    std::vector<LightVertex> vertices;
    AlignedArray<uint32_t> last;
};

}  // namespace nephroid

// Ray queries against a scene. The only interface to Embree.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>

#include "accel/ray_batch.h"
#include "core/scene.h"

namespace nephroid {

inline constexpr uint32_t no_hit = std::numeric_limits<uint32_t>::max();

struct Ray {
    Vec3 origin;
    Vec3 direction;
    float t_max = std::numeric_limits<float>::infinity();
};

struct Hit {
    uint32_t object = no_hit;  ///< Index into Scene::objects; no_hit; or objects.size() + index of a sphere light.
    uint32_t primitive = 0;
    float u = 0.0F;
    float v = 0.0F;
    float t = 0.0F;
};

class Accelerator {
  public:
    /// Builds over all objects and sphere lights with `threads` threads. The scene must outlive the accelerator: vertex
    /// and index arrays are shared, not copied. Throws Error(render_failed) where memory runs out.
    Accelerator(const Scene& scene, int threads);
    ~Accelerator();
    Accelerator(const Accelerator&) = delete;
    Accelerator& operator=(const Accelerator&) = delete;

    /// Closest hit with t > 0; thread-safe, as all queries are.
    Hit intersect(const Ray& ray) const;
    /// Whether anything lies in 0 < t < t_max.
    bool occluded(const Ray& ray) const;

    /// Closest hits of a batch, in packets of 16. `coherent` only affects speed.
    void intersect(RayBatch& rays, bool coherent, HitBatch& hits) const;
    /// occluded[i] = 1 where something lies in the way, else 0; holds padded_to_packets(rays.count) entries.
    void occluded(RayBatch& rays, bool coherent, AlignedArray<uint32_t>& occluded) const;

  private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace nephroid

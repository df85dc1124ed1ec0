// Cached points where the camera looks: where caustics will be seen, directly or in mirrors.
#pragma once

#include <cstdint>
#include <vector>

#include "accel/surface.h"
#include "core/camera.h"
#include "core/film.h"

namespace nephroid {

struct Receiver {
    Vec3 position{0.0F};          ///< World space, metres.
    Vec3 error{0.0F};             ///< Bound of the position's rounding error, per coordinate (SurfaceInteraction).
    Vec3 geometric_normal{0.0F};  ///< Unit, on the viewer's side.
    Vec3 shading_normal{0.0F};    ///< Unit, on the side of the geometric normal.
    float alpha = 0.0F;           ///< GGX width; below delta_alpha only the diffuse base is a receiver.
    /// Side of the square of surface that the point stands for, metres: from the spacing of the camera rays, the
    /// distance along the path and the cosine, as if mirrors were flat; more where curved ones spread the rays, as the
    /// distance of neighbouring points tells. Positive; at most a quarter of the scene.
    float footprint = 0.0F;
    uint32_t object = 0;  ///< Index into Scene::objects.
};

struct ReceiverSampling {
    int width = 0;  ///< Of the film that the camera rays are for, pixels.
    int height = 0;
    PixelRegion crop;    ///< Only what is seen through these pixels.
    uint32_t count = 0;  ///< Wanted points.
    uint32_t seed = 0;
    int max_bounces = 4;  ///< Most mirror reflections of a path; 0: only what is seen directly.
};

inline constexpr float merge_distance = 0.25F;      ///< In footprints: closer points of similar normals are merged.
inline constexpr float merge_normal_cosine = 0.9F;  ///< Geometric normals are similar above it.

/// Follows camera rays through a jittered grid over the crop. Every surface hit is a receiver, but for pure mirrors
/// (alpha below delta_alpha without a diffuse base), emissive objects and triangles without area. At mirrors and at
/// casters (Surfaces::set_casters, alpha at most max_caster_alpha) the path goes on in the mirror direction; it ends
/// elsewhere, at lights, and behind a shading or geometric horizon.
///
/// The grid is refined or coarsened until about `count` points are left after merging; never more than 1.25 times as
/// many, but fewer where 16 rays per wanted point do not find them. Sorted along a Morton curve. The same points for
/// any number of threads (TBB's current arena).
std::vector<Receiver> sample_receivers(const Scene& scene, const Accelerator& accelerator, const Surfaces& surfaces,
                                       const CameraRays& camera, const ReceiverSampling& sampling);

}  // namespace nephroid

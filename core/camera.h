// Cameras of the scene file, and rays from them.
#pragma once

#include <string>

#include "core/simd.h"
#include "core/vec.h"

namespace nephroid {

enum class CameraKind : uint8_t { perspective, orthographic };

/// glTF camera: looks along -Z of its node, +Y up.
struct Camera {
    std::string name;
    CameraKind kind = CameraKind::perspective;
    Mat4 to_world{1.0F};
    float yfov = 0.8F;    ///< Perspective: vertical field of view, radians, in (0, pi).
    float aspect = 0.0F;  ///< Width / height of the file; 0: none given.
    float xmag = 1.0F;    ///< Orthographic: half width, metres.
    float ymag = 1.0F;    ///< Orthographic: half height, metres.
};

/// Rays through the film of a camera. Both kinds are linear in the film position, which is in pixels from the top left
/// corner: origin = origin_base + x origin_dx + y origin_dy, and the same for the direction before normalisation.
struct CameraRays {
    Vec3 origin_base, origin_dx, origin_dy;
    Vec3 direction_base, direction_dx, direction_dy;

    template <class F>
    Triple<F> origin(const F& x, const F& y) const {
        return linear(origin_base, origin_dx, origin_dy, x, y);
    }
    template <class F>
    Triple<F> direction(const F& x, const F& y) const {
        return normalized(linear(direction_base, direction_dx, direction_dy, x, y));
    }

  private:
    template <class F>
    static Triple<F> linear(const Vec3& base, const Vec3& dx, const Vec3& dy, const F& x, const F& y) {
        return {F(base.x) + x * F(dx.x) + y * F(dy.x), F(base.y) + x * F(dx.y) + y * F(dy.y),
                F(base.z) + x * F(dx.z) + y * F(dy.z)};
    }
};

/// Where on the film a point is seen, for light that is traced towards the camera.
template <class F>
struct CameraView {
    F x, y;            ///< Film position in pixels.
    F depth;           ///< Along the view direction; only what is above zero is in front of the camera.
    Triple<F> wi;      ///< Unit, from the point to the camera.
    Triple<F> target;  ///< Where the ray to the camera ends.
    F pixel_density;   ///< Density of the camera rays of one pixel at the point, per area across the ray (m^-2).
};

/// The inverse of CameraRays, and the density of its rays. A pixel's mean radiance is the integral over the surfaces
/// that it sees of radiance times cosine times this density: for a pinhole, rays per solid angle (|d|^3 over
/// |d . (dx x dy)| for the unnormalised direction d) over squared distance; for parallel rays, one per pixel's area.
class CameraProjection {
  public:
    explicit CameraProjection(const CameraRays& rays);

    template <class F>
    CameraView<F> view(const Triple<F>& p) const {
        const Triple<F> v = p - splat<F>(origin_);
        const F depth = dot(v, splat<F>(to_depth_));
        if (!parallel_) return view_along(v);
        const Triple<F> forward = splat<F>(forward_);
        return {dot(v, splat<F>(to_x_)), dot(v, splat<F>(to_y_)), depth, -forward, p - forward * depth, F(density_)};
    }

    /// Of the point at the offset v from the pinhole; not for parallel rays.
    template <class F>
    CameraView<F> view_along(const Triple<F>& v) const {
        const F depth = dot(v, splat<F>(to_depth_));
        const F inverse = F(1.0F) / depth;
        const F distance = square_root(dot(v, v));
        // With d = v / depth: |d|^3 / |v|^2.
        return {dot(v, splat<F>(to_x_)) * inverse,
                dot(v, splat<F>(to_y_)) * inverse,
                depth,
                v * (F(-1.0F) / distance),
                splat<F>(origin_),
                F(density_) * distance * (inverse * inverse * inverse)};
    }

  private:
    template <class F>
    static Triple<F> splat(const Vec3& v) {
        return {F(v.x), F(v.y), F(v.z)};
    }

    bool parallel_;
    Vec3 origin_, forward_;
    Vec3 to_depth_, to_x_, to_y_;  ///< Rows of the inverse of (direction, dx, dy).
    float density_;
};

/// Rays for a film of width x height pixels. The vertical extent is the camera's own; the horizontal follows from the
/// film's shape, so pixels are square.
CameraRays make_camera_rays(const Camera& camera, int width, int height);

/// A perspective camera in front of (+Z, slightly above) the bounds that sees all of them.
Camera framing_camera(const Vec3& bounds_min, const Vec3& bounds_max);

}  // namespace nephroid

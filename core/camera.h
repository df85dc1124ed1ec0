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

/// Rays for a film of width x height pixels. The vertical extent is the camera's own; the horizontal follows from the
/// film's shape, so pixels are square.
CameraRays make_camera_rays(const Camera& camera, int width, int height);

/// A perspective camera in front of (+Z, slightly above) the bounds that sees all of them.
Camera framing_camera(const Vec3& bounds_min, const Vec3& bounds_max);

}  // namespace nephroid

// Bounds of floating-point rounding errors, and what follows for rays: where a ray must start so that it leaves its
// surface, without any constant that depends on the scene's size.
#pragma once

#include <limits>

#include "core/simd.h"
#include "core/vec.h"

namespace nephroid {

/// Bound of the relative error of n chained float operations: n eps / (1 - n eps) (Higham 2002).
constexpr float rounding_bound(int n) {
    constexpr float half_ulp = std::numeric_limits<float>::epsilon() * 0.5F;
    return static_cast<float>(n) * half_ulp / (1.0F - static_cast<float>(n) * half_ulp);
}

/// x moved by at least one unit in the last place in the direction of the sign of `towards`. From zero by 1e-30: less
/// than any scene notices, but not so little that a distance from there, divided by a long ray's length, is flushed to
/// zero, which counts as a hit.
template <class F>
F nudge(const F& x, const F& towards) {
    constexpr float ulp = std::numeric_limits<float>::epsilon(), from_zero = 1e-30F;
    const F step = absolute(x) * F(ulp) + F(from_zero);
    return x + select(towards < F(0.0F), -step, step);
}

/// Origin of a ray that leaves point p, known up to +-error per coordinate, of a surface with unit normal n on the side
/// of `direction`: outside the slab that the error box spans about the surface (Pharr et al. 2023, Sec. 6.8.6).
template <class F>
Triple<F> offset_ray_origin(const Triple<F>& p, const Triple<F>& error, const Triple<F>& n,
                            const Triple<F>& direction) {
    const F slab = absolute(n.x) * error.x + absolute(n.y) * error.y + absolute(n.z) * error.z;
    const Triple<F> offset = n * select(dot(n, direction) < F(0.0F), -slab, slab);
    const Triple<F> origin = p + offset;
    return {nudge(origin.x, offset.x), nudge(origin.y, offset.y), nudge(origin.z, offset.z)};
}
inline Vec3 offset_ray_origin(const Vec3& p, const Vec3& error, const Vec3& n, const Vec3& direction) {
    return to_vec3(offset_ray_origin(to_triple(p), to_triple(error), to_triple(n), to_triple(direction)));
}

}  // namespace nephroid

#include "pathcut/skimming.h"

namespace nephroid {

namespace {

/// The largest sine of elevation along `up` (unit) at which a corner of one triangle sees a corner of the other.
float highest_elevation(const ReflectorTree& reflectors, uint32_t from, uint32_t to, const Triple<float>& up) {
    float highest = 0.0F;
    for (size_t a = 0; a < 3; ++a) {
        const Triple<float> p = to_triple(reflectors.position(from, a));
        for (size_t b = 0; b < 3; ++b) {
            const Triple<float> v = to_triple(reflectors.position(to, b)) - p;
            const float height = dot(v, up);
            if (height > 0.0F) highest = maximum(highest, height * reciprocal_square_root(dot(v, v)));
        }
    }
    return highest;
}

}  // namespace

bool only_skims(const ReflectorTree& reflectors, uint32_t triangle, const MirrorBound<float>& mirror,
                const Leg<float>& outer, uint32_t other) {
    constexpr float elevation_slack = 0.02F;
    const float elevation = dot(outer.direction, mirror.axis);
    const Triple<float> up = elevation < 0.0F ? -mirror.axis : mirror.axis;
    // The spread holds the normals' deviation from the axis, which tilts both elevations, and theta_h.
    const float tilt = outer.chord + 3.0F * mirror.sin_spread + elevation_slack;
    if (!(std::abs(elevation) > tilt)) return false;
    return std::abs(elevation) - tilt > 2.0F * highest_elevation(reflectors, triangle, other, up);
}

}  // namespace nephroid

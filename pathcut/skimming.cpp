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

/// How far a triangle's normals are from the axis, at most: a chord.
float normal_deviation(const ReflectorTree& reflectors, uint32_t triangle, const Triple<float>& axis) {
    float most = 0.0F;
    for (size_t corner = 0; corner < 3; ++corner) {
        const Triple<float> off = to_triple(reflectors.normal(triangle, corner)) - axis;
        most = maximum(most, std::sqrt(dot(off, off)));
    }
    return most;
}

}  // namespace

bool only_skims(const ReflectorTree& reflectors, uint32_t triangle, const Leg<float>& outer, float sin_acceptance,
                uint32_t other) {
    constexpr float elevation_slack = 0.02F;
    const Triple<float> axis = reflectors.bound(triangle).axis;
    const float elevation = dot(outer.direction, axis);
    const Triple<float> up = elevation < 0.0F ? -axis : axis;
    // Deviations of the normal tilt both elevations.
    const float tilt = outer.chord + 2.0F * (normal_deviation(reflectors, triangle, axis) + sin_acceptance);
    const float least = std::abs(elevation) - tilt - elevation_slack;
    return least > 0.0F && least > 2.0F * highest_elevation(reflectors, triangle, other, up);
}

}  // namespace nephroid

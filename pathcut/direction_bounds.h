// Bounds of sets of directions, such as the shading normals of a reflector: as a cone, or as a box of coordinates.
//
// A cone is the better bound of a narrow, evenly spread set and cheap to test; a box adapts to sets that are wide in
// one way and narrow in the other (a cylinder's normals). Both serve the relaxed half-vector test of the path cuts
// (Sec. 3.3, Li et al. 2022). That test is offered as a cosine, as in the paper, and as a sine: the cosine of 1e-4
// radians differs from 1 by less than float resolves, its sine does not.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "pathcut/interval_vector.h"

namespace nephroid {

/// The box of the given unit directions; empty for none. Not of what lies between them: see `spanned_box`.
inline IntervalVector<float> box_of(std::span<const Vec3> directions) {
    IntervalVector<float> box = empty_box<float>();
    for (const Vec3& d : directions) box = hull(box, point_box(to_triple(d)));
    return box;
}

/// The box of all directions that interpolation between members of `corners` and normalisation give: of the shading
/// normals of triangles, when `corners` bounds the normals at their vertices. The normals halfway between two vertices
/// leave the vertices' box, so this box must be used where interpolated normals are meant.
inline IntervalVector<float> spanned_box(const IntervalVector<float>& corners) {
    return normalized(corners);
}

/// All directions within an angle of an axis. Held as sine and cosine of the angle, so that tests need no trigonometry.
template <class F>
struct DirectionCone {
    Triple<F> axis;    ///< Unit to float precision.
    F cos_half_angle;  ///< 1: the axis alone; -1: the whole sphere; above 1: empty.
    F sin_half_angle;  ///< >= 0.
};

namespace direction_cone {
/// More than the rounding errors of an axis, a half angle and the tests below together make up, in radians: a unit
/// vector in float is known to 2e-7, and each test chains fewer than ten operations of relative error 6e-8.
inline constexpr float slack = 2e-6F;
}  // namespace direction_cone

inline DirectionCone<float> empty_cone() {
    return {{0.0F, 0.0F, 1.0F}, infinity, 0.0F};
}
inline DirectionCone<float> whole_sphere() {
    return {{0.0F, 0.0F, 1.0F}, -1.0F, 0.0F};
}
inline bool is_empty(const DirectionCone<float>& cone) {
    return cone.cos_half_angle > 1.0F;
}
inline double half_angle(const DirectionCone<float>& cone) {
    return std::atan2(double{cone.sin_half_angle}, double{cone.cos_half_angle});
}

/// The angle between two non-zero vectors in radians, precise for small angles, too.
inline double angle_between(const Vec3d& a, const Vec3d& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

/// The cone about `axis` (non-zero) with half angle `angle`, in radians, widened by the rounding errors.
inline DirectionCone<float> make_cone(const Vec3d& axis, double angle) {
    const double widened = angle + double{direction_cone::slack};
    if (!(widened < 3.14159)) return whole_sphere();
    return {to_triple(Vec3(glm::normalize(axis))), static_cast<float>(std::cos(widened)),
            static_cast<float>(std::sin(widened))};
}

/// A cone that holds the given unit directions and, if it is narrower than a half space, all that interpolation between
/// them and normalisation give. It is the whole sphere where they have no mean direction, and empty for none.
inline DirectionCone<float> cone_of(std::span<const Vec3> directions) {
    if (directions.empty()) return empty_cone();
    Vec3d sum(0.0);
    for (const Vec3& d : directions) sum += Vec3d(d);
    if (!(glm::length(sum) > 1e-6 * static_cast<double>(directions.size()))) return whole_sphere();
    double angle = 0.0;
    for (const Vec3& d : directions) angle = std::max(angle, angle_between(sum, Vec3d(d)));
    // Beyond a half space the cone is not convex: it need not hold what is interpolated.
    return angle < 1.57 ? make_cone(sum, angle) : whole_sphere();
}

/// The smallest cone that holds both, up to rounding. Grows by the slack in each of a hierarchy's levels.
inline DirectionCone<float> hull(const DirectionCone<float>& a, const DirectionCone<float>& b) {
    if (is_empty(a)) return b;
    if (is_empty(b)) return a;
    const Vec3d axis_a(a.axis.x, a.axis.y, a.axis.z), axis_b(b.axis.x, b.axis.y, b.axis.z);
    const double angle_a = half_angle(a), angle_b = half_angle(b), between = angle_between(axis_a, axis_b);
    if (between + angle_b <= angle_a) return a;
    if (between + angle_a <= angle_b) return b;
    const double angle = (angle_a + angle_b + between) / 2.0;
    // Opposite axes span no plane to turn in.
    const Vec3d across = axis_b - axis_a * glm::dot(axis_a, axis_b);
    if (!(angle < 3.14159) || !(glm::length(across) > 1e-7)) {
        return between < 1.0 ? make_cone(axis_a, between + std::max(angle_a, angle_b)) : whole_sphere();
    }
    const double turn = angle - angle_a;
    return make_cone(glm::normalize(axis_a) * std::cos(turn) + glm::normalize(across) * std::sin(turn), angle);
}

/// The cone about the directions of all non-zero vectors in a box: of the differences of two boxes of points, or of
/// sums of directions. The whole sphere if the sphere about the box holds the origin.
template <class F>
DirectionCone<F> cone_of(const IntervalVector<F>& box) {
    const F half(0.5F);
    const Triple<F> centre{(box.x.lower + box.x.upper) * half, (box.y.lower + box.y.upper) * half,
                           (box.z.lower + box.z.upper) * half};
    // Scaled by the largest coordinate, so that no square overflows or vanishes.
    const F scale = F(1.0F) / maximum<F>(max_component(absolute(centre)), F(1e-37F));
    const IntervalVector<F> side = (box - point_box(centre)) * point_interval(scale);
    const F radius = square_root_up(squared_length(IntervalVector<F>{point_interval(largest_magnitude(side.x)),
                                                                     point_interval(largest_magnitude(side.y)),
                                                                     point_interval(largest_magnitude(side.z))})
                                        .upper);
    const Triple<F> scaled = centre * scale;
    const F distance = square_root(dot(scaled, scaled));
    const F sine = radius / distance + F(direction_cone::slack);
    // Not `sine >= 1`: NaN, from unbounded boxes, must give the whole sphere.
    const auto narrow = sine < F(0.9999F);
    const F used = select(narrow, sine, F(0.0F));
    const F cosine = select(narrow, square_root((F(1.0F) - used) * (F(1.0F) + used)), F(-1.0F));
    const Triple<F> axis = scaled * (F(1.0F) / distance);
    return {select<F>(narrow, axis, Triple<F>{F(0.0F), F(0.0F), F(1.0F)}), cosine, used};
}

/// Cosine and sine of the gap between two cones: of the smallest angle between a member of one and a member of the
/// other. Bounds on the safe side: cosine from above, sine from below (and 1 for gaps beyond a right angle).
template <class F>
struct DirectionGap {
    F max_cosine, min_sine;
};

/// Cones that touch have max_cosine = 1 and min_sine = 0. Neither may be empty.
template <class F>
DirectionGap<F> gap_between(const DirectionCone<F>& a, const DirectionCone<F>& b) {
    const Triple<F> axes_cross = cross(a.axis, b.axis);
    const F cos_axes = dot(a.axis, b.axis);
    const F sin_axes = square_root(dot(axes_cross, axes_cross));
    // Both half angles together; beyond half a turn (negative sine) every direction is reached.
    const F cos_both = a.cos_half_angle * b.cos_half_angle - a.sin_half_angle * b.sin_half_angle;
    const F sin_both = a.sin_half_angle * b.cos_half_angle + a.cos_half_angle * b.sin_half_angle;
    const F cosine = cos_axes * cos_both + sin_axes * sin_both + F(direction_cone::slack);
    const F sine = sin_axes * cos_both - cos_axes * sin_both - F(direction_cone::slack);
    // Either comparison shows that the axes are further apart than both half angles: the sine resolves small gaps, the
    // cosine gaps near half a turn.
    const auto further = sine > F(0.0F) || cos_axes < cos_both - F(2.0F * direction_cone::slack);
    const auto apart = further && sin_both >= F(0.0F) && a.cos_half_angle > F(-1.0F) && b.cos_half_angle > F(-1.0F);
    const F sine_or_one = select(cosine < F(0.0F), F(1.0F), maximum<F>(sine, F(0.0F)));
    return {select(apart, minimum<F>(cosine, F(1.0F)), F(1.0F)), select(apart, sine_or_one, F(0.0F))};
}

/// The same for two boxes of non-zero vectors, which need not be of unit length.
template <class F>
DirectionGap<F> gap_between(const IntervalVector<F>& a, const IntervalVector<F>& b) {
    const Interval<F> length_a = length(a), length_b = length(b);
    const F longest = multiply_up(length_a.upper, length_b.upper);
    const F shortest = maximum<F>(multiply_down(length_a.lower, length_b.lower), F(0.0F));
    const F most = upper_dot(a, b);
    // A negative dot product is closest to zero, relatively, between the longest vectors.
    const F divisor = select(most > F(0.0F), shortest, longest);
    const F cosine = divide_up(most, divisor);
    const F sine = divide_down(length<F>(cross(a, b)).lower, longest);
    // Zero or unbounded lengths make quotients NaN: nothing is known then but the sign of the dot product.
    const F cosine_or_sign = select(cosine == cosine, cosine, select(most < F(0.0F), F(0.0F), F(1.0F)));
    const F sine_or_zero = select(sine >= F(0.0F), minimum<F>(sine, F(1.0F)), F(0.0F));
    return {minimum<F>(cosine_or_sign, F(1.0F)), select(most < F(0.0F), F(1.0F), sine_or_zero)};
}

}  // namespace nephroid

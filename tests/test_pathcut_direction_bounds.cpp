// Bounds of directions: every member, every interpolated member and every pair of members is inside of what is claimed.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "pathcut/direction_bounds.h"

using namespace nephroid;

namespace {

using Generator = std::mt19937_64;

double uniform(Generator& generator, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
}
Vec3d random_direction(Generator& generator) {
    const double z = uniform(generator, -1.0, 1.0), phi = uniform(generator, 0.0, 2.0 * M_PI),
                 r = std::sqrt(1.0 - z * z);
    return {r * std::cos(phi), r * std::sin(phi), z};
}
/// From 1e-6 radians to all directions; sometimes a single one.
std::vector<Vec3> random_directions(Generator& generator) {
    const Vec3d centre = random_direction(generator);
    const double spread =
        uniform(generator, 0.0, 1.0) < 0.1 ? 0.0 : std::exp(uniform(generator, std::log(1e-6), std::log(3.0)));
    std::vector<Vec3> directions;
    for (int i = 0; i < 4; ++i) directions.emplace_back(glm::normalize(centre + spread * random_direction(generator)));
    return directions;
}
Vec3d interpolated(Generator& generator, const std::vector<Vec3>& directions) {
    Vec3d sum(0.0);
    for (const Vec3& d : directions) sum += Vec3d(d) * uniform(generator, 0.0, 1.0);
    return glm::normalize(sum);
}
Vec3d to_vec3d(const Triple<float>& v) {
    return {v.x, v.y, v.z};
}
bool inside(const DirectionCone<float>& cone, const Vec3d& d) {
    return angle_between(to_vec3d(cone.axis), d) <= half_angle(cone);
}
bool inside(const IntervalVector<float>& box, const Vec3d& d) {
    return box.x.lower <= d.x && d.x <= box.x.upper && box.y.lower <= d.y && d.y <= box.y.upper && box.z.lower <= d.z &&
           d.z <= box.z.upper;
}
/// Whether the claimed gap is one that directions a and b respect.
bool respects(const DirectionGap<float>& gap, const Vec3d& a, const Vec3d& b) {
    const double angle = angle_between(a, b);
    const double sine = angle > M_PI / 2.0 ? 1.0 : std::sin(angle);
    return gap.max_cosine >= std::cos(angle) && gap.min_sine <= sine && gap.min_sine >= 0.0F && gap.max_cosine <= 1.0F;
}

}  // namespace

TEST_CASE("cones and boxes hold their directions and what is interpolated between them") {
    Generator generator(1);
    size_t outside = 0;
    for (int n = 0; n < 100000; ++n) {
        const std::vector<Vec3> a = random_directions(generator), b = random_directions(generator);
        const DirectionCone<float> cone = cone_of(a), both = hull(cone, cone_of(b));
        const IntervalVector<float> box = box_of(a), spanned = spanned_box(box);
        for (size_t i = 0; i < a.size(); ++i) {
            outside += inside(cone, a[i]) && inside(both, a[i]) && inside(both, b[i]) && inside(box, a[i]) ? 0 : 1;
        }
        for (int m = 0; m < 4; ++m) {
            const Vec3d d = interpolated(generator, a);
            outside += inside(cone, d) && inside(both, d) && inside(spanned, d) ? 0 : 1;
        }
    }
    CHECK(outside == 0);
}

TEST_CASE("gaps between bounds are conservative") {
    Generator generator(2);
    size_t outside = 0, cones_apart = 0, boxes_apart = 0, pairs = 0;
    for (int n = 0; n < 100000; ++n) {
        const std::vector<Vec3> a = random_directions(generator), b = random_directions(generator);
        const DirectionGap<float> cones = gap_between(cone_of(a), cone_of(b));
        const DirectionGap<float> boxes = gap_between(spanned_box(box_of(a)), spanned_box(box_of(b)));
        const DirectionGap<float> raw_boxes = gap_between(box_of(a), box_of(b));
        for (int m = 0; m < 8; ++m) {
            const Vec3d p = m < 4 ? Vec3d(a[static_cast<size_t>(m)]) : interpolated(generator, a);
            const Vec3d q = m < 4 ? Vec3d(b[static_cast<size_t>(m)]) : interpolated(generator, b);
            outside += respects(cones, p, q) && respects(boxes, p, q) && respects(raw_boxes, p, q) ? 0 : 1;
        }
        cones_apart += cones.min_sine > 0.0F ? 1 : 0;
        boxes_apart += boxes.min_sine > 0.0F ? 1 : 0;
        ++pairs;
    }
    CHECK(outside == 0);
    // Bounds that never separate anything would be conservative, too.
    CHECK(cones_apart > pairs / 2);
    CHECK(boxes_apart > pairs / 2);
}

TEST_CASE("gaps resolve angles far below what a cosine in float does") {
    for (const double angle : {1e-4, 1e-3, 1e-2, 0.5, 1.5, 3.0}) {
        const std::vector<Vec3> a{Vec3(0.0F, 0.0F, 1.0F)};
        const std::vector<Vec3> b{Vec3(static_cast<float>(std::sin(angle)), 0.0F, static_cast<float>(std::cos(angle)))};
        const DirectionGap<float> cones = gap_between(cone_of(a), cone_of(b)),
                                  boxes = gap_between(box_of(a), box_of(b));
        const double sine = angle > M_PI / 2.0 ? 1.0 : std::sin(angle);
        CHECK(cones.min_sine > sine - 1e-5);
        CHECK(boxes.min_sine > sine * (1.0 - 1e-5));
        CHECK(cones.max_cosine < std::cos(angle) + 1e-5);
        CHECK(boxes.max_cosine < std::cos(angle) + 1e-6);
    }
    const std::vector<Vec3> up{Vec3(0.0F, 0.0F, 1.0F)}, down{Vec3(0.0F, 0.0F, -1.0F)};
    CHECK(gap_between(cone_of(up), cone_of(down)).min_sine == 1.0F);
    CHECK(gap_between(box_of(up), box_of(down)).min_sine == 1.0F);
}

TEST_CASE("the cone of a box of vectors holds their directions, at any scale") {
    Generator generator(3);
    size_t outside = 0, narrow = 0;
    for (int n = 0; n < 100000; ++n) {
        const double scale = std::exp(uniform(generator, std::log(1e-30), std::log(1e30)));
        const double spread = std::exp(uniform(generator, std::log(1e-7), std::log(3.0)));
        std::array<Interval<float>, 3> sides;
        const Vec3d centre = random_direction(generator);
        for (int axis = 0; axis < 3; ++axis) {
            const double low = centre[axis] - spread * uniform(generator, 0.0, 1.0);
            const double high = centre[axis] + spread * uniform(generator, 0.0, 1.0);
            sides[static_cast<size_t>(axis)] = {static_cast<float>(scale * low), static_cast<float>(scale * high)};
        }
        const DirectionCone<float> cone = cone_of(IntervalVector<float>{sides[0], sides[1], sides[2]});
        for (int m = 0; m < 8; ++m) {
            Vec3d v;
            for (int axis = 0; axis < 3; ++axis) {
                const Interval<float>& side = sides[static_cast<size_t>(axis)];
                const double choice = uniform(generator, -0.5, 1.5);
                v[axis] = choice < 0.0   ? side.lower
                          : choice > 1.0 ? side.upper
                                         : side.lower + choice * (double{side.upper} - side.lower);
            }
            outside += inside(cone, v / scale) ? 0 : 1;
        }
        narrow += cone.cos_half_angle > 0.0F ? 1 : 0;
    }
    CHECK(outside == 0);
    CHECK(narrow > 50000);
}

TEST_CASE("degenerate direction bounds are defined") {
    CHECK(is_empty(cone_of(std::span<const Vec3>())));
    const std::vector<Vec3> opposite{Vec3(1.0F, 0.0F, 0.0F), Vec3(-1.0F, 0.0F, 0.0F)}, one{Vec3(1.0F, 0.0F, 0.0F)};
    CHECK(cone_of(opposite).cos_half_angle == -1.0F);
    CHECK(half_angle(hull(cone_of(one), cone_of(std::span<const Vec3>()))) < 1e-5);
    CHECK(gap_between(whole_sphere(), cone_of(one)).min_sine == 0.0F);
    CHECK(gap_between(whole_sphere(), whole_sphere()).max_cosine == 1.0F);
    const Interval<float> zero = point_interval(0.0F), all = unbounded_interval<float>();
    for (const Interval<float>& side : {zero, all, Interval<float>{-largest_float, largest_float},
                                        Interval<float>{1e-45F, 2e-45F}, Interval<float>{1e38F, largest_float}}) {
        const IntervalVector<float> box{side, side, side};
        const DirectionCone<float> cone = cone_of(box);
        const DirectionGap<float> gap = gap_between(box, box), gap_cones = gap_between(cone, cone);
        CHECK(std::isfinite(cone.axis.x + cone.cos_half_angle + cone.sin_half_angle));
        CHECK((gap.max_cosine == 1.0F && gap.min_sine == 0.0F));
        CHECK((gap_cones.max_cosine == 1.0F && gap_cones.min_sine == 0.0F));
    }
}

// The last test before the solver: sixteen triangles against one receiver and one light, linear in slope space.
//
// Over a small triangle the slope C is nearly linear, so that the triangle's image in slope space is the triangle of
// its corners' slopes: an exact specular path runs through it if that image holds the origin, and the smallest slope is
// the image's distance from the origin. How far C is from linear shows at the centroid; what it may be elsewhere is
// allowed for twice over. Not conservative in theory, therefore; no miss in the tests against brute force.
#pragma once

#include <cstddef>

#include "core/frame.h"
#include "pathcut/cut_test.h"
#include "pathcut/reflector_tree.h"

namespace nephroid {

/// Sixteen triangles or as many as a vector holds.
template <class F>
struct TriangleLanes {
    std::array<Triple<F>, 3> positions;
    std::array<Triple<F>, 3> normals;
    F max_slope;
};

inline TriangleLanes<FloatV> load(const TriangleBlock& block, size_t first) {
    TriangleLanes<FloatV> lanes;
    for (size_t corner = 0; corner < 3; ++corner) {
        const auto& p = block.positions[corner];
        const auto& n = block.normals[corner];
        lanes.positions[corner] = load_lanes<FloatV>(p[0], p[1], p[2], first);
        lanes.normals[corner] = load_lanes<FloatV>(n[0], n[1], n[2], first);
    }
    lanes.max_slope = load_lanes<FloatV>(block.max_slope, first);
    return lanes;
}

/// Field `field` of TriangleBlock, counted in lanes, of triangle `triangle` of each lane that exists; zero elsewhere.
inline FloatV gather_field(const ReflectorTree& reflectors, const UintV& triangle, const UintV& field,
                           const FloatV::mask_type& exists) {
    constexpr auto lanes = static_cast<uint32_t>(block_size);
    constexpr auto block_floats = static_cast<uint32_t>(sizeof(TriangleBlock) / sizeof(float));
    static_assert(sizeof(TriangleBlock) == block_floats * sizeof(float));
    const auto* values = reinterpret_cast<const float*>(reflectors.blocks.data());
    return gather(values, (triangle >> 4) * block_floats + field * lanes + (triangle & 15U), exists);
}

/// A corner of a triangle, in each lane another.
struct CornerLanes {
    Triple<FloatV> position, normal;
};

inline CornerLanes gather_corner(const ReflectorTree& reflectors, const UintV& triangle, const UintV& corner,
                                 const FloatV::mask_type& exists) {
    constexpr auto first_normal =
        static_cast<uint32_t>(offsetof(TriangleBlock, normals) / sizeof(TriangleBlock::Lanes));
    const auto gather_triple = [&](const UintV& first) {
        return Triple<FloatV>{gather_field(reflectors, triangle, first, exists),
                              gather_field(reflectors, triangle, first + 1U, exists),
                              gather_field(reflectors, triangle, first + 2U, exists)};
    };
    return {gather_triple(corner * 3U), gather_triple(corner * 3U + first_normal)};
}

/// A point of slope space.
template <class F>
struct SlopePoint {
    F x, y;
    friend SlopePoint operator-(const SlopePoint& a, const SlopePoint& b) { return {a.x - b.x, a.y - b.y}; }
    friend SlopePoint operator+(const SlopePoint& a, const SlopePoint& b) { return {a.x + b.x, a.y + b.y}; }
    friend SlopePoint operator*(const SlopePoint& a, const F& s) { return {a.x * s, a.y * s}; }
};
template <class F>
F squared_length(const SlopePoint<F>& a) {
    return a.x * a.x + a.y * a.y;
}
template <class F>
F cross(const SlopePoint<F>& a, const SlopePoint<F>& b) {
    return a.x * b.y - a.y * b.x;
}

/// Unit directions towards the light, or towards the previous reflector, from points of a triangle.
template <class F>
struct IncomingDirections {
    std::array<Triple<F>, 3> at_corner;
    Triple<F> at_centroid;
};

template <class F>
Triple<F> centroid_of(const TriangleLanes<F>& t) {
    return (t.positions[0] + t.positions[1] + t.positions[2]) * F(1.0F / 3.0F);
}

template <class F>
Triple<F> direction_to(const PathLight& light, const Triple<F>& position) {
    const Triple<F> point{F(light.point.x), F(light.point.y), F(light.point.z)};
    if (light.at_infinity) return point;
    const Triple<F> to_light = point - position;
    return to_light * reciprocal_square_root(dot(to_light, to_light));
}

template <class F>
IncomingDirections<F> directions_to(const PathLight& light, const TriangleLanes<F>& t) {
    return {
        {direction_to(light, t.positions[0]), direction_to(light, t.positions[1]), direction_to(light, t.positions[2])},
        direction_to(light, centroid_of(t))};
}

/// True where the receiver is behind the triangle as the light sees it, or in its plane as far as rounding can tell: so
/// that nothing is reflected to it. `error`: of the directions, a chord.
template <class F>
MaskOf<F> is_behind(const TriangleLanes<F>& t, const IncomingDirections<F>& wi, const F& error,
                    const Triple<F>& receiver) {
    constexpr float in_plane = 1e-5F;  // Sine.
    const auto& p = t.positions;
    const Triple<F> normal = normalized(cross(p[1] - p[0], p[2] - p[0])), to_viewer = receiver - p[0];
    const F height = dot(to_viewer, normal), above = F(in_plane) * square_root(dot(to_viewer, to_viewer));
    F lowest(1.0F), highest(-1.0F);
    for (const Triple<F>& direction : wi.at_corner) {
        const F light = dot(direction, normal);
        lowest = minimum(lowest, light);
        highest = maximum(highest, light);
    }
    return (lowest > error && height <= above) || (highest < -error && height >= -above);
}

/// What slopes are made of at a point.
template <class F>
struct SlopeSample {
    SlopePoint<F> slope;  ///< In the plane of a frame; grows without bound where h turns away from n.
    F lowest;             ///< The smaller cosine of wo and wi to the normal's line.
};

template <class F>
SlopeSample<F> slope_at(const Triple<F>& position, const Triple<F>& n, const Frame<F>& frame, const Triple<F>& receiver,
                        const Triple<F>& wi) {
    const Triple<F> to_viewer = receiver - position;
    const Triple<F> wo = to_viewer * reciprocal_square_root(dot(to_viewer, to_viewer));
    const Triple<F> h = wo + wi;
    const Triple<F> m = h * (F(1.0F) / dot(h, n)) - n;
    return {{dot(m, frame.s), dot(m, frame.t)}, minimum(absolute(dot(wo, n)), absolute(dot(wi, n)))};
}

/// Squared distance of the origin from the segment from a to b.
template <class F>
F squared_distance_from_origin(const SlopePoint<F>& a, const SlopePoint<F>& b) {
    const SlopePoint<F> edge = b - a;
    const F length2 = maximum(squared_length(edge), F(1e-30F));
    const F t = minimum(maximum(-(a.x * edge.x + a.y * edge.y) / length2, F(0.0F)), F(1.0F));
    return squared_length(a + edge * t);
}

/// A triangle's image in slope space.
template <class F>
struct SlopeImage {
    Frame<F> frame;
    std::array<SlopePoint<F>, 3> corners;
    F distance;                       ///< From the origin; zero inside.
    std::array<F, 3> edge_distances;  ///< The same of the edges 0-1, 1-2, 2-0.
    F error;                          ///< Bound of what linearity neglects, at least what rounding does.
    F area;                           ///< Twice the signed area: its sign is the Jacobian determinant's.
    F weight1, weight2;               ///< Barycentric coordinates of the origin: where slopes vanish.
    MaskOf<F> grazing;  ///< The triangle or one next to it may have its back to the light or the receiver.
};

template <class F>
SlopeImage<F> slope_image(const TriangleLanes<F>& t, const IncomingDirections<F>& wi, const Triple<F>& receiver) {
    const Triple<F> mean_normal = normalized(t.normals[0] + t.normals[1] + t.normals[2]);
    SlopeImage<F> image;
    const Frame<F>& frame = image.frame = make_frame(mean_normal);
    F lowest(1.0F), turn2(0.0F);
    for (size_t i = 0; i < 3; ++i) {
        const SlopeSample<F> sample = slope_at(t.positions[i], t.normals[i], frame, receiver, wi.at_corner[i]);
        image.corners[i] = sample.slope;
        lowest = minimum(lowest, sample.lowest);
        const Triple<F> turned = t.normals[i] - mean_normal;
        turn2 = maximum(turn2, dot(turned, turned));
    }
    image.grazing = lowest < F(0.01F) + F(3.0F) * square_root(turn2);
    const auto& c = image.corners;
    const SlopePoint<F> mean = (c[0] + c[1] + c[2]) * F(1.0F / 3.0F);
    const SlopePoint<F> bend = slope_at(centroid_of(t), mean_normal, frame, receiver, wi.at_centroid).slope - mean;
    const F extent2 =
        maximum(squared_length(c[0] - mean), maximum(squared_length(c[1] - mean), squared_length(c[2] - mean)));
    image.error = F(2.0F) * square_root(squared_length(bend)) + F(0.02F) * square_root(extent2) + F(1e-6F);
    const F s0 = cross(c[0], c[1]), s1 = cross(c[1], c[2]), s2 = cross(c[2], c[0]);
    const F zero(0.0F);
    const auto inside = (s0 >= zero && s1 >= zero && s2 >= zero) || (s0 <= zero && s1 <= zero && s2 <= zero);
    for (size_t i = 0; i < 3; ++i) {
        image.edge_distances[i] = square_root(squared_distance_from_origin(c[i], c[(i + 1) % 3]));
    }
    const F outside = minimum(image.edge_distances[0], minimum(image.edge_distances[1], image.edge_distances[2]));
    image.distance = select(inside, zero, outside);
    image.area = s0 + s1 + s2;
    image.weight1 = s2 / image.area;
    image.weight2 = s0 / image.area;
    return image;
}

/// True where the smallest slope inside the triangle is above what is accepted. `widening`: what a sphere light adds.
template <class F>
MaskOf<F> slopes_too_large(const TriangleLanes<F>& t, const SlopeImage<F>& image, const F& widening) {
    return image.distance > t.max_slope + widening + image.error;
}

template <class F>
F longest_edge(const SlopeImage<F>& image) {
    const auto& c = image.corners;
    return square_root(
        maximum(squared_length(c[1] - c[0]), maximum(squared_length(c[2] - c[1]), squared_length(c[0] - c[2]))));
}

/// By how much the barycentric coordinates where slopes vanish may be off, for all that the image's error says.
template <class F>
F weight_uncertainty(const SlopeImage<F>& image) {
    return image.error * longest_edge(image) / absolute(image.area);
}

/// Whether a triangle of that signed area in slope space may have the other orientation, for all that linearity
/// neglects: the surface folds here, and slopes may be smallest without vanishing.
template <class F>
MaskOf<F> may_fold(const SlopeImage<F>& image, const F& area) {
    const F least = longest_edge(image) * image.error;
    return !((area > least && image.area > least) || (area < -least && image.area < -least));
}

/// Twice the signed area of the image of the triangle across edge `edge`, whose third corner maps to `apex`.
template <class F>
F area_across(const SlopeImage<F>& image, size_t edge, const SlopePoint<F>& apex) {
    const SlopePoint<F>&from = image.corners[(edge + 1) % 3], &to = image.corners[edge];
    return cross(to - from, apex - from);
}

/// Whether slopes change more than `ratio` times faster across edge `edge`, where the third corner lies at `apex` and
/// twice the image's area is `across`: by area in slope space over area in space.
template <class F>
MaskOf<F> is_steeper(const TriangleLanes<F>& t, const SlopeImage<F>& image, size_t edge, const Triple<F>& apex,
                     const F& across, double ratio) {
    const auto& p = t.positions;
    const Triple<F>&from = p[(edge + 1) % 3], &to = p[edge];
    const Triple<F> area = cross(p[1] - p[0], p[2] - p[0]), area_across = cross(to - from, apex - from);
    // Roots, because products of four areas would vanish in small scenes.
    const F here = absolute(image.area) * square_root(dot(area_across, area_across));
    return absolute(across) * square_root(dot(area, area)) > F(static_cast<float>(ratio)) * here;
}

/// Barycentric coordinates of the point of one lane's triangle whose slope is smallest.
inline Vec2 lowest_point(const SlopeImage<FloatV>& image, size_t lane) {
    if (image.distance[lane] == 0.0F) return {image.weight1[lane], image.weight2[lane]};
    constexpr std::array<Vec2, 3> corners{Vec2(0.0F, 0.0F), Vec2(1.0F, 0.0F), Vec2(0.0F, 1.0F)};
    size_t edge = 0;
    for (size_t e = 1; e < 3; ++e) {
        if (image.edge_distances[e][lane] < image.edge_distances[edge][lane]) edge = e;
    }
    const SlopePoint<FloatV>&a = image.corners[edge], &b = image.corners[(edge + 1) % 3];
    const Vec2 from(a.x[lane], a.y[lane]), along = Vec2(b.x[lane], b.y[lane]) - from;
    const float length2 = std::max(glm::dot(along, along), 1e-30F);
    const float t = std::clamp(-glm::dot(from, along) / length2, 0.0F, 1.0F);
    return glm::mix(corners[edge], corners[(edge + 1) % 3], t);
}

}  // namespace nephroid

#include "pathcut/surface_patch.h"

#include <algorithm>
#include <cmath>

namespace nephroid {

namespace {

constexpr double smallest_height = 1e-12;       // Of a triangle, relative to its longest edge.
constexpr double smallest_interpolated = 1e-6;  // Length of an interpolated normal that still has a direction.

bool is_finite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// v without its part along the unit vector n.
Vec3d across(const Vec3d& v, const Vec3d& n) {
    return v - n * glm::dot(v, n);
}

/// The unit vector of v, or zero if v has no usable direction. Scaled first, so that no square over- or underflows.
Vec3d direction_or_zero(const Vec3d& v) {
    const double scale = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    if (!is_finite(v) || !(scale > 0.0)) return Vec3d(0.0);
    const Vec3d scaled = v / scale;
    return scaled / glm::length(scaled);
}

/// Any unit vector across the unit vector n.
Vec3d any_across(const Vec3d& n) {
    const Vec3d other = std::abs(n.x) < 0.6 ? Vec3d(1.0, 0.0, 0.0) : Vec3d(0.0, 1.0, 0.0);
    return glm::normalize(across(other, n));
}

Vec3d interpolate(const std::array<Vec3d, 3>& values, const Vec2d& b) {
    return values[0] * (1.0 - b.x - b.y) + values[1] * b.x + values[2] * b.y;
}

/// Basis of the plane and normal of a triangle without area.
void set_degenerate_frame(SurfacePatch& patch, const Vec3d& longest_edge, const Vec3d& mean_normal) {
    patch.degenerate = true;
    patch.barycentric_gradient = {Vec2d(0.0), Vec2d(0.0)};
    Vec3d e1 = direction_or_zero(longest_edge);
    if (e1 == Vec3d(0.0)) e1 = mean_normal == Vec3d(0.0) ? Vec3d(1.0, 0.0, 0.0) : any_across(mean_normal);
    const Vec3d n = across(mean_normal, e1);
    patch.geometric_normal = glm::length(n) > smallest_interpolated ? glm::normalize(n) : any_across(e1);
    patch.axes = {e1, glm::cross(patch.geometric_normal, e1)};
}

void set_frame(SurfacePatch& patch, const Vec3d& mean_normal) {
    const auto& p = patch.positions;
    const std::array<Vec3d, 3> edges{p[1] - p[0], p[2] - p[1], p[0] - p[2]};
    const auto longest = std::max_element(
        edges.begin(), edges.end(), [](const Vec3d& a, const Vec3d& b) { return glm::dot(a, a) < glm::dot(b, b); });
    patch.size = glm::length(*longest);
    const Vec3d e1 = direction_or_zero(*longest);
    const Vec3d height = across(p[2] - p[0], e1), other_height = across(p[1] - p[0], e1);
    const double tallest = std::max(glm::length(height), glm::length(other_height));
    const Vec3d n = direction_or_zero(glm::cross(edges[0] / patch.size, (p[2] - p[0]) / patch.size));
    if (!(tallest > smallest_height * patch.size) || n == Vec3d(0.0) || !std::isfinite(patch.size)) {
        set_degenerate_frame(patch, *longest, mean_normal);
        return;
    }
    patch.geometric_normal = n;
    patch.axes = {e1, glm::cross(n, e1)};
    // Columns: the edges from vertex 0 in plane coordinates; the gradient is the inverse.
    const Vec3d a = p[1] - p[0], b = p[2] - p[0];
    const Vec2d a2(glm::dot(a, patch.axes[0]), glm::dot(a, patch.axes[1]));
    const Vec2d b2(glm::dot(b, patch.axes[0]), glm::dot(b, patch.axes[1]));
    const double determinant = a2.x * b2.y - a2.y * b2.x;
    patch.barycentric_gradient = {Vec2d(b2.y, -a2.y) / determinant, Vec2d(-b2.x, a2.x) / determinant};
}

}  // namespace

SurfacePatch make_surface_patch(const std::array<Vec3d, 3>& positions, const std::array<Vec3d, 3>& normals) {
    SurfacePatch patch;
    patch.positions = positions;
    if (!std::all_of(positions.begin(), positions.end(), is_finite)) patch.positions.fill(Vec3d(0.0));
    for (size_t i = 0; i < 3; ++i) patch.normals[i] = direction_or_zero(normals[i]);
    set_frame(patch, direction_or_zero(patch.normals[0] + patch.normals[1] + patch.normals[2]));
    for (Vec3d& n : patch.normals) {
        if (n == Vec3d(0.0)) n = patch.geometric_normal;
    }
    return patch;
}

PatchPoint evaluate(const SurfacePatch& patch, const Vec2d& barycentrics) {
    PatchPoint point;
    point.position = interpolate(patch.positions, barycentrics);
    const Vec3d raw = interpolate(patch.normals, barycentrics);
    const double length = glm::length(raw);
    if (!(length > smallest_interpolated)) {
        point.normal = patch.geometric_normal;
        point.normal_derivative = {Vec3d(0.0), Vec3d(0.0)};
        return point;
    }
    const double inverse_length = 1.0 / length;
    point.normal = raw * inverse_length;
    const Vec3d d1 = patch.normals[1] - patch.normals[0], d2 = patch.normals[2] - patch.normals[0];
    for (size_t k = 0; k < 2; ++k) {
        const Vec2d& gradient = patch.barycentric_gradient[k];
        point.normal_derivative[k] = across(d1 * gradient.x + d2 * gradient.y, point.normal) * inverse_length;
    }
    return point;
}

Vec2d moved(const SurfacePatch& patch, const Vec2d& barycentrics, const Vec2d& delta) {
    return barycentrics + patch.barycentric_gradient[0] * delta.x + patch.barycentric_gradient[1] * delta.y;
}

Vec2d edge_vector(const SurfacePatch& patch, int k) {
    const auto from = static_cast<size_t>(k), to = static_cast<size_t>((k + 1) % 3);
    const Vec3d edge = patch.positions[to] - patch.positions[from];
    return {glm::dot(edge, patch.axes[0]), glm::dot(edge, patch.axes[1])};
}

bool is_inside(const Vec2d& b, double tolerance) {
    return b.x >= -tolerance && b.y >= -tolerance && b.x + b.y <= 1.0 + tolerance;
}

Vec2d closest_inside(const SurfacePatch& patch, const Vec2d& barycentrics) {
    if (is_inside(barycentrics, 0.0)) return barycentrics;
    const std::array<Vec2d, 3> corners{Vec2d(0.0, 0.0), Vec2d(1.0, 0.0), Vec2d(0.0, 1.0)};
    const Vec3d p = interpolate(patch.positions, barycentrics);
    Vec2d best = triangle_centre;
    double best_distance = INFINITY;
    for (size_t k = 0; k < 3; ++k) {
        const Vec3d& from = patch.positions[k];
        const Vec3d edge = patch.positions[(k + 1) % 3] - from;
        const double length2 = glm::dot(edge, edge);
        const double t = length2 > 0.0 ? std::clamp(glm::dot(p - from, edge) / length2, 0.0, 1.0) : 0.0;
        const double distance = glm::length(p - (from + edge * t));
        if (distance < best_distance) {
            best_distance = distance;
            best = corners[k] * (1.0 - t) + corners[(k + 1) % 3] * t;
        }
    }
    return best;
}

}  // namespace nephroid

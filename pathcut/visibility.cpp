#include "pathcut/visibility.h"

#include <algorithm>
#include <cmath>

#include "core/rounding.h"

namespace nephroid {

namespace {

/// Shadow rays end this far (relative) before their target: two roundings of the segment's length.
constexpr float segment_end = 1.0F - 4.0F * rounding_bound(1);

/// Solutions often lie on an edge of their triangle, where a ray must leave the neighbours as well. In a sharp crease
/// the offset along one side's normal leads behind the other side; this many errors along the ray lead away from both,
/// for normals up to 120 degrees apart.
constexpr double ray_clearance = 8.0;

/// Coordinates beyond it have squares that float cannot hold. NaN is no usable coordinate either.
constexpr double largest_coordinate = 1e18;

bool is_usable(const Vec3d& v) {
    return std::abs(v.x) < largest_coordinate && std::abs(v.y) < largest_coordinate &&
           std::abs(v.z) < largest_coordinate;
}

bool is_usable(const SurfacePoint& point) {
    return is_usable(point.position) && is_usable(Vec3d(point.geometric_normal)) && is_usable(Vec3d(point.error));
}

bool is_usable(const SpecularPathView& path) {
    return is_usable(path.receiver) && is_usable(path.light.point) && path.light_radius < largest_coordinate &&
           std::all_of(path.vertices.begin(), path.vertices.end(),
                       [](const SurfacePoint& vertex) { return is_usable(vertex); });
}

/// Where a ray in the unit direction leaves a point's surface, or where one against it must end. `further_error` adds
/// to the point's own. The error's length counts in all directions, because neighbours' normals point elsewhere.
Vec3 leave(const SurfacePoint& point, const Vec3d& direction, double further_error) {
    const double error = glm::length(Vec3d(point.error)) + further_error;
    const Vec3d n = glm::abs(Vec3d(point.geometric_normal));
    const auto box = static_cast<float>(error / std::max(n.x + n.y + n.z, 1.0));
    const Vec3 start(point.position + direction * (ray_clearance * error));
    return offset_ray_origin(start, Vec3(box), point.geometric_normal, Vec3(direction));
}

/// Traces from one point to the other; nothing is in the way of points that rounding cannot tell apart.
bool is_blocked(const Accelerator& accelerator, const SurfacePoint& from, const SurfacePoint& to) {
    const Vec3d difference = to.position - from.position;
    const double distance = glm::length(difference);
    if (!(distance > 0.0)) return false;
    const Vec3d direction = difference / distance;
    const Vec3 origin = leave(from, direction, 0.0);
    // At the far end the ray query's own error grows with the distance.
    const Vec3 target = leave(to, -direction, rounding_bound(8) * distance);
    const Vec3 segment = target - origin;
    if (!(glm::dot(Vec3d(segment), direction) > 0.0)) return false;
    return accelerator.occluded({origin, segment, segment_end});
}

bool is_blocked(const Accelerator& accelerator, const SurfacePoint& from, const PathEnd& light, double light_radius) {
    if (light.at_infinity) {
        const double length = glm::length(light.point);
        if (!(length > 0.0)) return true;
        const Vec3d direction = light.point / length;
        return accelerator.occluded({leave(from, direction, 0.0), Vec3(direction)});
    }
    const Vec3d difference = light.point - from.position;
    const double distance = glm::length(difference);
    if (!(distance > light_radius)) return false;
    const Vec3 origin = leave(from, difference / distance, 0.0);
    const Vec3 segment = Vec3(light.point) - origin;
    // Ray queries find a sphere's surface with an error relative to the distance of its centre.
    const double margin = light_radius > 0.0 ? rounding_bound(16) : rounding_bound(4);
    const double end = 1.0 - light_radius / glm::length(Vec3d(segment)) - margin;
    if (!(glm::dot(Vec3d(segment), difference) > 0.0) || !(end > 0.0)) return false;
    return accelerator.occluded({origin, segment, static_cast<float>(end)});
}

/// Whether the receiver's front sees the next point of the path.
bool faces(const SurfacePoint& receiver, const PathEnd& next) {
    const Vec3d direction = next.at_infinity ? next.point : next.point - receiver.position;
    return glm::dot(Vec3d(receiver.geometric_normal), direction) > 0.0;
}

}  // namespace

SurfacePoint surface_point(const Vec3d& position, const Vec3& geometric_normal, double extent,
                           const Vec3& transform_error) {
    const Vec3 rounded = rounding_bound(1) * Vec3(glm::abs(position));
    const Vec3 query(rounding_bound(8) * static_cast<float>(extent));
    return {position, geometric_normal, rounded + query + transform_error};
}

int first_blocked_segment(const Accelerator& accelerator, const SpecularPathView& path) {
    const auto length = static_cast<int>(path.vertices.size());
    if (!is_usable(path)) return length;
    if (!faces(path.receiver, length == 0 ? path.light : PathEnd{path.vertices.front().position})) return 0;
    const auto vertex = [&](int i) -> const SurfacePoint& {
        return i == 0 ? path.receiver : path.vertices[static_cast<size_t>(i - 1)];
    };
    if (is_blocked(accelerator, vertex(length), path.light, path.light_radius)) return length;
    for (int i = length - 1; i >= 0; --i) {
        if (is_blocked(accelerator, vertex(i), vertex(i + 1))) return i;
    }
    return no_segment;
}

}  // namespace nephroid

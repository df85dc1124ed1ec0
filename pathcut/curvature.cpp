#include "pathcut/curvature.h"

#include <cmath>
#include <utility>

namespace nephroid {

namespace {

constexpr double smallest_cosine = 1e-6;  // Between shading and geometric normal.

Vec3d any_across(const Vec3d& n) {
    const Vec3d other = std::abs(n.x) < 0.6 ? Vec3d(1.0, 0.0, 0.0) : Vec3d(0.0, 1.0, 0.0);
    return glm::normalize(other - n * glm::dot(n, other));
}

}  // namespace

PrincipalCurvatures flat_at(const Vec3d& normal) {
    PrincipalCurvatures result;
    result.normal = normal;
    result.direction[0] = any_across(normal);
    result.direction[1] = glm::cross(normal, result.direction[0]);
    return result;
}

PrincipalCurvatures diagonalise(const std::array<double, 3>& form, const Vec3d& u, const Vec3d& v,
                                const Vec3d& normal) {
    const double mean = 0.5 * (form[0] + form[2]), half_difference = 0.5 * (form[0] - form[2]);
    const double radius = std::hypot(half_difference, form[1]);
    PrincipalCurvatures result;
    result.normal = normal;
    result.direction = {u, v};
    if (!std::isfinite(mean) || !std::isfinite(radius)) return result;
    result.curvature = {mean + radius, mean - radius};
    // The angle of the larger one; both arguments zero (an umbilic) give zero.
    const double angle = 0.5 * std::atan2(form[1], half_difference);
    const double cosine = std::cos(angle), sine = std::sin(angle);
    result.direction = {u * cosine + v * sine, v * cosine - u * sine};
    return result;
}

PrincipalCurvatures principal_curvatures(const SurfacePatch& patch, const Vec2d& barycentrics) {
    const PatchPoint point = evaluate(patch, barycentrics);
    if (!std::isfinite(glm::dot(point.normal, point.normal))) return flat_at(patch.geometric_normal);
    const PrincipalCurvatures flat = flat_at(point.normal);
    const auto& [u, v] = flat.direction;
    // Columns: the axes of the triangle's plane and the change of the normal along them, in the tangent plane.
    const auto& e = patch.axes;
    const auto& dn = point.normal_derivative;
    const glm::dmat2 axes(glm::dot(u, e[0]), glm::dot(v, e[0]), glm::dot(u, e[1]), glm::dot(v, e[1]));
    const glm::dmat2 change(glm::dot(u, dn[0]), glm::dot(v, dn[0]), glm::dot(u, dn[1]), glm::dot(v, dn[1]));
    const double cosine = axes[0][0] * axes[1][1] - axes[1][0] * axes[0][1];
    if (patch.degenerate || !(std::abs(cosine) > smallest_cosine)) return flat;
    // Interpolated normals are not those of any surface: their shape operator is not quite symmetric.
    const glm::dmat2 shape = -change * glm::inverse(axes);
    return diagonalise({shape[0][0], 0.5 * (shape[0][1] + shape[1][0]), shape[1][1]}, u, v, point.normal);
}

}  // namespace nephroid

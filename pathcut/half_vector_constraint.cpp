#include "pathcut/half_vector_constraint.h"

#include <cmath>

#include "pathcut/half_vector_slope.h"

namespace nephroid {

namespace {

constexpr double steepest_slope = 1e9;        // Beyond it the half vector counts as at right angles to the normal.
constexpr double shortest_half = 1e-9;        // |H| below it: wi and wo cancel.
constexpr double largest_derivative = 1e100;  // 1/m. Ends nearer than its inverse count as coincident.

Triple<double> triple(const Vec3d& v) {
    return {v.x, v.y, v.z};
}
Vec3d vec(const Triple<double>& v) {
    return {v.x, v.y, v.z};
}

/// False where the two coincide, or are not finite.
bool connect(const Vec3d& vertex, const PathEnd& end, Connection<double>& connection) {
    const Vec3d v = end.at_infinity ? end.point : end.point - vertex;
    const double length = glm::length(v);
    if (!(length > 0.0) || !std::isfinite(length)) return false;
    connection = {triple(v * (1.0 / length)), end.at_infinity ? 0.0 : 1.0 / length};
    return true;
}

/// dC by the positions of a neighbour, or by its direction where it is at infinity; eta: the direction's factor in H.
glm::dmat3x2 by_neighbour(const HalfVectorSlope<double>& slope, const Connection<double>& connection, double eta) {
    const double rate = connection.inverse_distance == 0.0 ? eta : connection.inverse_distance * eta;
    glm::dmat3x2 result;
    for (int k = 0; k < 3; ++k) {
        Vec3d axis(0.0);
        axis[k] = 1.0;
        const Triple<double> v = triple(axis), &d = connection.direction;
        const SlopePair<double> change = slope.derivative((v - d * dot(d, v)) * rate, {0.0, 0.0, 0.0});
        result[k] = {change.c1, change.c2};
    }
    return result;
}

/// Whether all values are finite and so are the products that a solver forms of them.
bool is_usable(const SlopeConstraint& c) {
    double sum = glm::length(c.slope);
    for (int k = 0; k < 2; ++k) sum += std::abs(c.by_vertex[k].x) + std::abs(c.by_vertex[k].y);
    for (int k = 0; k < 3; ++k) {
        sum += std::abs(c.by_viewer[k].x) + std::abs(c.by_viewer[k].y);
        sum += std::abs(c.by_light[k].x) + std::abs(c.by_light[k].y);
    }
    return sum < largest_derivative;  // False for NaN.
}

bool on_required_sides(const Interaction& interaction, const Vec3d& wi, const Vec3d& wo, const Vec3d& n) {
    const double sides = glm::dot(n, wi) * glm::dot(n, wo);
    return interaction.transmission ? sides < 0.0 : sides > 0.0;
}

/// Whether a microfacet along H, turned to the side of n, faces wi and wo where the surface does (Walter et al. 2007,
/// the chi of Eq. 23). Always so for reflections on the required sides; the false branch of refraction fails.
bool faces_microfacet(const Vec3d& h, const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
    const double side = glm::dot(h, n);
    return glm::dot(wi, h) * side * glm::dot(wi, n) > 0.0 && glm::dot(wo, h) * side * glm::dot(wo, n) > 0.0;
}

}  // namespace

SlopeConstraint evaluate_constraint(const SurfacePatch& patch, const PatchPoint& vertex, const Interaction& interaction,
                                    const PathEnd& viewer, const PathEnd& light, Derivatives derivatives) {
    Connection<double> to_viewer{}, to_light{};
    if (!connect(vertex.position, viewer, to_viewer) || !connect(vertex.position, light, to_light)) return {};
    const Triple<double> h = to_light.direction * interaction.eta_i + to_viewer.direction * interaction.eta_o;
    const Triple<double> n = triple(vertex.normal);
    const double length = std::sqrt(dot(h, h));
    if (!(length > shortest_half) || !(std::abs(dot(h, n)) > length / steepest_slope)) return {};

    const HalfVectorSlope<double> slope = half_vector_slope(h, make_frame(n));
    SlopeConstraint result;
    result.slope = {slope.slope.c1, slope.slope.c2};
    result.s = vec(slope.frame.s);
    result.t = vec(slope.frame.t);
    for (size_t k = 0; k < 2; ++k) {
        const Triple<double> axis = triple(patch.axes[k]);
        const Triple<double> dh =
            to_light.turned_by_vertex(axis) * interaction.eta_i + to_viewer.turned_by_vertex(axis) * interaction.eta_o;
        const SlopePair<double> change = slope.derivative(dh, triple(vertex.normal_derivative[k]));
        result.by_vertex[static_cast<int>(k)] = {change.c1, change.c2};
    }
    if (derivatives == Derivatives::all) {
        result.by_viewer = by_neighbour(slope, to_viewer, interaction.eta_o);
        result.by_light = by_neighbour(slope, to_light, interaction.eta_i);
    }
    if (!is_usable(result)) return {};
    result.valid = true;
    const Vec3d wi = vec(to_light.direction), wo = vec(to_viewer.direction);
    result.admissible = !patch.degenerate && on_required_sides(interaction, wi, wo, vertex.normal) &&
                        on_required_sides(interaction, wi, wo, patch.geometric_normal) &&
                        faces_microfacet(vec(h), vertex.normal, wi, wo);
    return result;
}

}  // namespace nephroid

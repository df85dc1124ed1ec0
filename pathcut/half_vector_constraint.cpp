#include "pathcut/half_vector_constraint.h"

#include <cmath>

#include "core/frame.h"

namespace nephroid {

namespace {

constexpr double steepest_slope = 1e9;        // Beyond it the half vector counts as at right angles to the normal.
constexpr double shortest_half = 1e-9;        // |H| below it: wi and wo cancel.
constexpr double largest_derivative = 1e100;  // 1/m. Ends nearer than its inverse count as coincident.

/// Unit direction from a vertex to a neighbour, and how it turns when one of the two moves.
struct Connection {
    Vec3d direction{0.0};
    double inverse_distance = 0.0;  ///< 1/m; zero at infinity: moving the vertex turns nothing.
    bool at_infinity = false;
    bool valid = false;

    /// Change of the direction when the neighbour moves by v (or, at infinity, when its direction changes by v).
    Vec3d turned_by(const Vec3d& v) const {
        return (v - direction * glm::dot(direction, v)) * (at_infinity ? 1.0 : inverse_distance);
    }
    /// Change of the direction when the vertex moves by v.
    Vec3d turned_by_vertex(const Vec3d& v) const {
        return (v - direction * glm::dot(direction, v)) * -inverse_distance;
    }
};

Connection connect(const Vec3d& vertex, const PathEnd& end) {
    Connection connection;
    const Vec3d v = end.at_infinity ? end.point : end.point - vertex;
    const double length = glm::length(v);
    if (!(length > 0.0) || !std::isfinite(length)) return connection;
    connection.direction = v * (1.0 / length);
    connection.inverse_distance = end.at_infinity ? 0.0 : 1.0 / length;
    connection.at_infinity = end.at_infinity;
    connection.valid = true;
    return connection;
}

/// The slope of a half vector H (any length and sign) against normal n, and its derivative.
struct Slope {
    Vec3d s, t, n, h;
    double h_n;
    Vec2d value;

    /// dC for changes dH and dn; s and t follow n in parallel transport: ds = -(s.dn) n.
    Vec2d derivative(const Vec3d& dh, const Vec3d& dn) const {
        const double change = glm::dot(dn, h) + glm::dot(n, dh);
        return Vec2d(glm::dot(s, dh) - glm::dot(s, dn) * h_n - value.x * change,
                     glm::dot(t, dh) - glm::dot(t, dn) * h_n - value.y * change) /
               h_n;
    }
};

Slope make_slope(const Vec3d& h, const Vec3d& n) {
    const Frame<double> frame = make_frame(Triple<double>{n.x, n.y, n.z});
    Slope slope{{frame.s.x, frame.s.y, frame.s.z}, {frame.t.x, frame.t.y, frame.t.z}, n, h, glm::dot(h, n), {}};
    slope.value = Vec2d(glm::dot(h, slope.s), glm::dot(h, slope.t)) / slope.h_n;
    return slope;
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
    const Connection to_viewer = connect(vertex.position, viewer), to_light = connect(vertex.position, light);
    if (!to_viewer.valid || !to_light.valid) return {};
    const Vec3d h = to_light.direction * interaction.eta_i + to_viewer.direction * interaction.eta_o;
    const double length = glm::length(h);
    if (!(length > shortest_half) || !(std::abs(glm::dot(h, vertex.normal)) > length / steepest_slope)) return {};

    const Slope slope = make_slope(h, vertex.normal);
    SlopeConstraint result;
    result.slope = slope.value;
    result.s = slope.s;
    result.t = slope.t;
    for (int k = 0; k < 2; ++k) {
        const Vec3d& axis = patch.axes[static_cast<size_t>(k)];
        const Vec3d dh =
            to_light.turned_by_vertex(axis) * interaction.eta_i + to_viewer.turned_by_vertex(axis) * interaction.eta_o;
        result.by_vertex[k] = slope.derivative(dh, vertex.normal_derivative[static_cast<size_t>(k)]);
    }
    for (int k = 0; k < (derivatives == Derivatives::all ? 3 : 0); ++k) {
        Vec3d axis(0.0);
        axis[k] = 1.0;
        result.by_viewer[k] = slope.derivative(to_viewer.turned_by(axis) * interaction.eta_o, Vec3d(0.0));
        result.by_light[k] = slope.derivative(to_light.turned_by(axis) * interaction.eta_i, Vec3d(0.0));
    }
    if (!is_usable(result)) return {};
    result.valid = true;
    const Vec3d &wi = to_light.direction, &wo = to_viewer.direction;
    result.admissible = !patch.degenerate && on_required_sides(interaction, wi, wo, vertex.normal) &&
                        on_required_sides(interaction, wi, wo, patch.geometric_normal) &&
                        faces_microfacet(h, vertex.normal, wi, wo);
    return result;
}

}  // namespace nephroid

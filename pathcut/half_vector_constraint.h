// The constraint that makes a path specular: at each vertex the half vector h lies along the shading normal n.
//
// In slope form, C = (h.s, h.t) / (h.n) in a tangent frame (s, t) at n, so that |C| = tan(theta_h) is the slope of the
// microfacet that would make the path specular, in the units in which roughness is measured (Sec. 2, lobes.md). All
// derivatives are analytic and exact everywhere, also away from C = 0. (s, t) is transported in parallel when the point
// moves.
#pragma once

#include <cstdint>

#include "pathcut/surface_patch.h"

namespace nephroid {

/// What happens at a vertex, as the half vector sees it: H = eta_i wi + eta_o wo, up to sign and length, with wi
/// towards the light and wo towards the viewer (Walter et al. 2007, Eqs. 13 and 16).
struct Interaction {
    double eta_i = 1.0;         ///< Refractive index on the light's side.
    double eta_o = 1.0;         ///< On the viewer's side; equal to eta_i for a reflection.
    bool transmission = false;  ///< Whether wi and wo are on different sides of the surface.
};

/// The neighbour of a vertex on a path, or the path's end.
struct PathEnd {
    Vec3d point;               ///< Position, metres; or, at infinity, the unit direction towards it.
    bool at_infinity = false;  ///< A directional light.
};

/// The constraint at a vertex and its derivatives. Columns of matrices are what is varied, rows the two slopes.
struct SlopeConstraint {
    Vec2d slope{0.0};             ///< C.
    Vec3d s{1.0, 0.0, 0.0};       ///< Tangent that slope.x belongs to; unit, across n.
    Vec3d t{0.0, 1.0, 0.0};       ///< Tangent that slope.y belongs to; (s, t, n) is right-handed.
    glm::dmat2 by_vertex{0.0};    ///< dC / d(the vertex's own plane coordinates), 1/m.
    glm::dmat3x2 by_viewer{0.0};  ///< dC / d(position of the neighbour towards the viewer), 1/m.
    glm::dmat3x2 by_light{0.0};   ///< The same towards the light; d(direction) for one at infinity, dimensionless.
    bool valid = false;           ///< Otherwise everything above is as initialised here: coincident points, a half
                                  ///< vector of length zero or at right angles to the normal, non-finite input.
    bool admissible = false;      ///< Valid, wi and wo lie on the sides of the surface, both of the shading and of the
                                  ///< geometric normal, that the interaction asks for, and h faces them there.
};

/// Which derivatives are wanted: those by the neighbours cost as much again as all the rest.
enum class Derivatives : uint8_t {
    own,  ///< by_vertex alone; by_viewer and by_light stay zero.
    all,
};

/// The constraint at `vertex` of `patch` (which must come from `evaluate` of the same patch).
SlopeConstraint evaluate_constraint(const SurfacePatch& patch, const PatchPoint& vertex, const Interaction& interaction,
                                    const PathEnd& viewer, const PathEnd& light,
                                    Derivatives derivatives = Derivatives::all);

}  // namespace nephroid

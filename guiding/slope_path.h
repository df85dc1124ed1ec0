// A representative specular path as a slope lobe: the path's constraints linearised, and what is cached of it.
#pragma once

#include <array>
#include <span>

#include "guiding/slope_warp.h"
#include "pathcut/specular_chain.h"

namespace nephroid {

/// Where the first reflector sends light to the receiver from, about the path's vertex: an ellipse on the reflector's
/// plane, one profile width around.
struct SlopeFootprint {
    std::array<Vec2d, 2> direction{Vec2d(1.0, 0.0), Vec2d(0.0, 1.0)};  ///< Unit, plane coordinates, orthogonal.
    std::array<double, 2> extent{};                                    ///< Half axes, metres.
};

/// A path's constraints to first order.
struct LinearisedPath {
    SlopeFootprint footprint;
    glm::dmat3x2 move{0.0};  ///< dy/dx: how the first vertex's plane coordinates follow the receiver, dimensionless.
    double density = 0.0;  ///< Of all vertices' plane coordinates at the path itself, 1/m^2 for each vertex, where the
                           ///< slopes in units of `widths` have GGX's distribution.
};

/// For a valid evaluation. Widths are the lobe's at each vertex: alpha for exact paths, sqrt(alpha^2 + |C|^2) for
/// relaxed ones. Extents are limited to `largest_extent` (metres): near a caustic's fold the Jacobian is singular, and
/// they would be infinite.
LinearisedPath linearise(const SpecularChain& chain, const ChainEvaluation& evaluation, std::span<const double> widths,
                         double largest_extent);

/// What is cached for the receiver, but for the weight.
CachedSlopeLobe<float> make_cached_lobe(const SpecularChain& chain, const ChainEvaluation& evaluation,
                                        const LinearisedPath& path, double width);

/// The lobe at the receiver it was made for.
SlopeLobe<float> unmoved(const CachedSlopeLobe<float>& lobe, const Vec3& receiver);

}  // namespace nephroid

#include "pathcut/early_rejection.h"

#include <algorithm>
#include <array>

namespace nephroid {

namespace {

/// Distance of the origin from the segment a b.
double distance_from_origin(const Vec2d& a, const Vec2d& b) {
    const Vec2d edge = b - a;
    const double length2 = glm::dot(edge, edge);
    const double t = length2 > 0.0 ? std::clamp(-glm::dot(a, edge) / length2, 0.0, 1.0) : 0.0;
    return glm::length(a + edge * t);
}

/// A triangle as a linear map of its plane to slopes sees it.
struct SlopeTriangle {
    std::array<Vec2d, 3> corners;  ///< Changes of the slope from the centre to the corners.
    double extent = 0.0;           ///< The largest of them.

    SlopeTriangle(const SurfacePatch& patch, const glm::dmat2& derivative) {
        const Vec2d e0 = derivative * edge_vector(patch, 0), e2 = derivative * edge_vector(patch, 2);
        corners[0] = (e2 - e0) / 3.0;
        corners[1] = corners[0] + e0;
        corners[2] = corners[0] - e2;
        for (const Vec2d& corner : corners) extent = std::max(extent, glm::length(corner));
    }
    /// Of the triangle about `centre` from the origin of slope space, zero inside.
    double distance_from_zero(const Vec2d& centre) const {
        const std::array<Vec2d, 3> c{centre + corners[0], centre + corners[1], centre + corners[2]};
        const auto side = [](const Vec2d& a, const Vec2d& b) { return a.x * b.y - a.y * b.x; };
        const double s0 = side(c[0], c[1]), s1 = side(c[1], c[2]), s2 = side(c[2], c[0]);
        if ((s0 >= 0.0 && s1 >= 0.0 && s2 >= 0.0) || (s0 <= 0.0 && s1 <= 0.0 && s2 <= 0.0)) return 0.0;
        return std::min(
            {distance_from_origin(c[0], c[1]), distance_from_origin(c[1], c[2]), distance_from_origin(c[2], c[0])});
    }
};

}  // namespace

bool is_hopeless(const SpecularChain& chain, const ChainEvaluation& centre, double margin) {
    if (!centre.valid) return false;
    const ChainJacobian blocks = jacobian(chain, centre);
    const auto length = static_cast<size_t>(chain.length);
    for (size_t i = 0; i < length; ++i) {
        const SlopeTriangle own(*chain.vertices[i].patch, blocks.by_own[i]);
        double reach = chain.vertices[i].max_slope + margin * own.extent;
        if (i > 0) {
            reach += (1.0 + margin) * SlopeTriangle(*chain.vertices[i - 1].patch, blocks.by_viewer[i]).extent;
        }
        if (i + 1 < length) {
            reach += (1.0 + margin) * SlopeTriangle(*chain.vertices[i + 1].patch, blocks.by_light[i]).extent;
        }
        if (own.distance_from_zero(centre.constraints[i].slope) > reach) return true;
    }
    return false;
}

}  // namespace nephroid

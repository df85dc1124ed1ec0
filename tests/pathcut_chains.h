// Random points, chains and checks that the tests of pathcut share.
#pragma once

#include <cmath>
#include <initializer_list>
#include <limits>
#include <random>

#include "pathcut/newton_solver.h"

namespace nephroid::testing {

using Generator = std::mt19937_64;

inline double uniform(Generator& generator, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
}
inline Vec3d random_point(Generator& generator, double extent) {
    return {uniform(generator, -extent, extent), uniform(generator, -extent, extent),
            uniform(generator, -extent, extent)};
}

inline constexpr double no_limit = std::numeric_limits<double>::infinity();

/// A chain over the patches, at alpha 0.01.
inline SpecularChain chain_of(std::initializer_list<const SurfacePatch*> patches, const Vec3d& receiver,
                              const PathEnd& light, double max_slope = no_limit) {
    SpecularChain chain;
    for (const SurfacePatch* patch : patches) {
        chain.vertices[static_cast<size_t>(chain.length++)] = {patch, {}, 0.01, max_slope};
    }
    chain.receiver = receiver;
    chain.light = light;
    return chain;
}

/// Whether no number of a solution is infinite or NaN.
inline bool is_finite(const SpecularPath& path) {
    double sum = path.residual;
    for (size_t i = 0; i < static_cast<size_t>(max_chain_length); ++i) {
        const PathVertex& v = path.vertices[i];
        sum += glm::length(v.barycentrics) + glm::length(v.position) + glm::length(v.normal) + glm::length(v.slope) +
               glm::length(v.s) + glm::length(v.t);
        for (int k = 0; k < 2; ++k) {
            sum += glm::length(path.jacobian.by_own[i][k]) + glm::length(path.jacobian.by_viewer[i][k]) +
                   glm::length(path.jacobian.by_light[i][k]);
        }
    }
    for (int k = 0; k < 3; ++k) sum += glm::length(path.by_receiver[k]) + glm::length(path.by_light_source[k]);
    return std::isfinite(sum);
}

}  // namespace nephroid::testing

#include "pathcut/specular_chain.h"

#include <algorithm>
#include <limits>

namespace nephroid {

ChainEvaluation evaluate(const SpecularChain& chain, const ChainPosition& position, Derivatives derivatives) {
    ChainEvaluation evaluation;
    const auto length = static_cast<size_t>(chain.length);
    for (size_t i = 0; i < length; ++i) evaluation.points[i] = evaluate(*chain.vertices[i].patch, position[i]);
    evaluation.valid = evaluation.admissible = true;
    for (size_t i = 0; i < length; ++i) {
        const PathEnd viewer{i == 0 ? chain.receiver : evaluation.points[i - 1].position};
        const PathEnd light = i + 1 == length ? chain.light : PathEnd{evaluation.points[i + 1].position};
        const ChainVertex& vertex = chain.vertices[i];
        SlopeConstraint& constraint = evaluation.constraints[i];
        constraint =
            evaluate_constraint(*vertex.patch, evaluation.points[i], vertex.interaction, viewer, light, derivatives);
        evaluation.valid = evaluation.valid && constraint.valid;
        evaluation.admissible = evaluation.admissible && constraint.admissible;
    }
    return evaluation;
}

double largest_slope(const SpecularChain& chain, const ChainEvaluation& evaluation) {
    if (!evaluation.valid) return std::numeric_limits<double>::infinity();
    double largest = 0.0;
    for (size_t i = 0; i < static_cast<size_t>(chain.length); ++i) {
        largest = std::max(largest, glm::length(evaluation.constraints[i].slope));
    }
    return largest;
}

namespace {

/// From derivatives along the world's axes to derivatives along a patch's.
glm::dmat2 along_plane(const glm::dmat3x2& by_position, const SurfacePatch& patch) {
    return {by_position * patch.axes[0], by_position * patch.axes[1]};
}

}  // namespace

ChainJacobian jacobian(const SpecularChain& chain, const ChainEvaluation& evaluation) {
    ChainJacobian blocks;
    const auto length = static_cast<size_t>(chain.length);
    for (size_t i = 0; i < length; ++i) {
        const SlopeConstraint& constraint = evaluation.constraints[i];
        blocks.by_own[i] = constraint.by_vertex;
        if (i > 0) blocks.by_viewer[i] = along_plane(constraint.by_viewer, *chain.vertices[i - 1].patch);
        if (i + 1 < length) blocks.by_light[i] = along_plane(constraint.by_light, *chain.vertices[i + 1].patch);
    }
    return blocks;
}

double determinant(const ChainJacobian& jacobian, int length) {
    // Block elimination from the receiver's side.
    glm::dmat2 pivot = jacobian.by_own[0];
    double product = glm::determinant(pivot);
    for (size_t i = 1; i < static_cast<size_t>(length) && product != 0.0; ++i) {
        pivot = jacobian.by_own[i] - jacobian.by_viewer[i] * glm::inverse(pivot) * jacobian.by_light[i - 1];
        product *= glm::determinant(pivot);
    }
    return product;
}

}  // namespace nephroid

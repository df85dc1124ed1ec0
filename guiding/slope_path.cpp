#include "guiding/slope_path.h"

#include <algorithm>
#include <cmath>

namespace nephroid {

namespace {

constexpr size_t most = 2 * static_cast<size_t>(max_chain_length);
using Matrix = std::array<std::array<double, most>, most>;

void set_block(Matrix& matrix, size_t row, size_t column, const glm::dmat2& block, double scale) {
    for (int r = 0; r < 2; ++r) {
        for (int c = 0; c < 2; ++c) {
            matrix[2 * row + static_cast<size_t>(r)][2 * column + static_cast<size_t>(c)] = block[c][r] * scale;
        }
    }
}

/// dC / dy, slopes in units of the widths.
Matrix scaled_jacobian(const SpecularChain& chain, const ChainEvaluation& evaluation, std::span<const double> widths) {
    const ChainJacobian blocks = jacobian(chain, evaluation);
    Matrix matrix{};
    const auto length = static_cast<size_t>(chain.length);
    for (size_t i = 0; i < length; ++i) {
        const double scale = 1.0 / widths[i];
        set_block(matrix, i, i, blocks.by_own[i], scale);
        if (i > 0) set_block(matrix, i, i - 1, blocks.by_viewer[i], scale);
        if (i + 1 < length) set_block(matrix, i, i + 1, blocks.by_light[i], scale);
    }
    return matrix;
}

/// Inverse of the symmetric positive definite n x n matrix, and the logarithm of its determinant (Gauss and Jordan).
double invert(Matrix& matrix, size_t n) {
    double log_determinant = 0.0;
    for (size_t k = 0; k < n; ++k) {
        const double pivot = matrix[k][k];
        log_determinant += std::log(pivot);
        matrix[k][k] = 1.0;
        for (size_t j = 0; j < n; ++j) matrix[k][j] /= pivot;
        for (size_t i = 0; i < n; ++i) {
            if (i == k) continue;
            const double factor = matrix[i][k];
            matrix[i][k] = 0.0;
            for (size_t j = 0; j < n; ++j) matrix[i][j] -= factor * matrix[k][j];
        }
    }
    return log_determinant;
}

/// Of the symmetric matrix (p, q; q, r), an ellipse's covariance.
SlopeFootprint ellipse(double p, double q, double r) {
    const double mean = 0.5 * (p + r), half = 0.5 * (p - r), radius = std::hypot(half, q);
    const double angle = 0.5 * std::atan2(q, half);
    const Vec2d first(std::cos(angle), std::sin(angle));
    return {{first, Vec2d(-first.y, first.x)},
            {std::sqrt(mean + radius), std::sqrt(std::max(mean - radius, 1e-12 * (mean + radius)))}};
}

Triple<float> to_floats(const Vec3d& v) {
    return to_triple(Vec3(v));
}

}  // namespace

LinearisedPath linearise(const SpecularChain& chain, const ChainEvaluation& evaluation, std::span<const double> widths,
                         double largest_extent) {
    const size_t n = 2 * static_cast<size_t>(chain.length);
    const Matrix a = scaled_jacobian(chain, evaluation, widths);
    // A^T A with what limits the extents on its diagonal.
    Matrix normal{};
    for (size_t i = 0; i < n; ++i) {
        for (size_t j = 0; j < n; ++j) {
            for (size_t k = 0; k < n; ++k) normal[i][j] += a[k][i] * a[k][j];
        }
        normal[i][i] += 1.0 / (largest_extent * largest_extent);
    }
    const double log_determinant = invert(normal, n);
    LinearisedPath path;
    path.footprint = ellipse(normal[0][0], normal[0][1], normal[1][1]);
    constexpr double log_pi = 1.1447298858494002;
    path.density = std::exp(0.5 * log_determinant - 0.5 * static_cast<double>(n) * log_pi);
    // Only the first vertex's slope knows the receiver.
    const glm::dmat3x2& by_receiver = evaluation.constraints[0].by_viewer;
    for (int axis = 0; axis < 3; ++axis) {
        for (size_t row = 0; row < 2; ++row) {
            double sum = 0.0;
            for (size_t j = 0; j < n; ++j) {
                const double right = a[0][j] * by_receiver[axis][0] + a[1][j] * by_receiver[axis][1];
                sum -= normal[row][j] * right / widths[0];
            }
            path.move[axis][static_cast<int>(row)] = sum;
        }
    }
    return path;
}

CachedSlopeLobe<float> make_cached_lobe(const SpecularChain& chain, const ChainEvaluation& evaluation,
                                        const LinearisedPath& path, double width) {
    const SurfacePatch& patch = *chain.vertices[0].patch;
    const PatchPoint& point = evaluation.points[0];
    const SlopeConstraint& constraint = evaluation.constraints[0];
    const SlopeFootprint& footprint = path.footprint;
    const auto row = [&](size_t k) { return Vec2(footprint.direction[k] / footprint.extent[k]); };
    const auto move = [&](int k) {
        return Triple<float>(to_floats({path.move[0][k], path.move[1][k], path.move[2][k]}));
    };
    CachedSlopeLobe<float> lobe{};
    lobe.y = to_floats(point.position);
    lobe.e1 = to_floats(patch.axes[0]);
    lobe.e2 = to_floats(patch.axes[1]);
    lobe.normal = to_floats(point.normal);
    lobe.tangent = to_floats(constraint.s);
    lobe.dn1 = to_floats(point.normal_derivative[0]);
    lobe.dn2 = to_floats(point.normal_derivative[1]);
    lobe.light = to_floats(chain.light.point);
    lobe.light_at_infinity = chain.light.at_infinity ? 1.0F : 0.0F;
    lobe.slope1 = static_cast<float>(constraint.slope.x);
    lobe.slope2 = static_cast<float>(constraint.slope.y);
    lobe.j11 = row(0).x;
    lobe.j12 = row(0).y;
    lobe.j21 = row(1).x;
    lobe.j22 = row(1).y;
    lobe.move1 = move(0);
    lobe.move2 = move(1);
    constexpr double floor = 0.7;  // Of the smallest singular value, lobes.md, Sec. 2.
    lobe.squared_floor =
        static_cast<float>(std::pow(floor * width / std::max(footprint.extent[0], footprint.extent[1]), 2.0));
    lobe.reach = static_cast<float>(patch.size);
    lobe.is_single = chain.length == 1 ? 1.0F : 0.0F;
    return lobe;
}

SlopeLobe<float> unmoved(const CachedSlopeLobe<float>& lobe, const Vec3& receiver) {
    return make_slope_lobe(to_triple(receiver), lobe.y, lobe.e1, lobe.e2, lobe.j11, lobe.j12, lobe.j21, lobe.j22);
}

}  // namespace nephroid

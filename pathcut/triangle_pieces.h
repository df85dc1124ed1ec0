// A triangle in sixteen congruent pieces, one to a lane: where its image in slope space is too bent to be told by its
// corners, those of its pieces, a sixteenth as bent, may tell.
#pragma once

#include "pathcut/slope_triangle.h"

namespace nephroid {

/// Pieces of a triangle; as many as a block has lanes.
inline constexpr size_t piece_count = 16;
static_assert(piece_count == block_size);

/// A piece's corners, as barycentric coordinates (b1, b2) of the whole triangle.
struct alignas(simd_alignment) PieceCorners {
    std::array<std::array<std::array<float, piece_count>, 2>, 3> weights{};  ///< [corner][coordinate]
};

/// Four rows of pieces along the edge 0-1; all of the whole triangle's orientation.
constexpr PieceCorners make_piece_corners() {
    constexpr int rows = 4;
    PieceCorners corners;
    size_t piece = 0;
    const auto set = [&](size_t corner, int i, int j) {
        corners.weights[corner][0][piece] = static_cast<float>(i) / static_cast<float>(rows);
        corners.weights[corner][1][piece] = static_cast<float>(j) / static_cast<float>(rows);
    };
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i + j < rows; ++i) {
            set(0, i, j);
            set(1, i + 1, j);
            set(2, i, j + 1);
            ++piece;
            if (i + j + 1 == rows) continue;
            set(0, i + 1, j + 1);
            set(1, i, j + 1);
            set(2, i + 1, j);
            ++piece;
        }
    }
    return corners;
}
inline constexpr PieceCorners piece_corners = make_piece_corners();

/// The same triangle in all lanes.
struct WholeTriangle {
    std::array<Triple<float>, 3> positions, normals;
    float max_slope = 0.0F;
};

/// A linear function on the triangle at the pieces' corner `corner`, lanes `first` on.
inline Triple<FloatV> at_piece_corner(const std::array<Triple<float>, 3>& values, size_t corner, size_t first) {
    const FloatV b1 = load_lanes<FloatV>(piece_corners.weights[corner][0], first);
    const FloatV b2 = load_lanes<FloatV>(piece_corners.weights[corner][1], first);
    return broadcast(values[0]) + broadcast(values[1] - values[0]) * b1 + broadcast(values[2] - values[0]) * b2;
}

inline TriangleLanes<FloatV> pieces_of(const WholeTriangle& triangle, size_t first) {
    TriangleLanes<FloatV> pieces;
    for (size_t corner = 0; corner < 3; ++corner) {
        pieces.positions[corner] = at_piece_corner(triangle.positions, corner, first);
        pieces.normals[corner] = normalized(at_piece_corner(triangle.normals, corner, first));
    }
    pieces.max_slope = FloatV(triangle.max_slope);
    return pieces;
}

/// Directions between the corners' directions `wi`.
inline IncomingDirections<FloatV> piece_directions(const std::array<Triple<float>, 3>& wi, size_t first) {
    IncomingDirections<FloatV> directions;
    Triple<FloatV> sum{FloatV(0.0F), FloatV(0.0F), FloatV(0.0F)};
    for (size_t corner = 0; corner < 3; ++corner) {
        const Triple<FloatV> linear = at_piece_corner(wi, corner, first);
        directions.at_corner[corner] = normalized(linear);
        sum = sum + linear;
    }
    directions.at_centroid = normalized(sum);
    return directions;
}

/// Barycentric coordinates of the whole triangle, from those of one of its pieces.
inline Vec2 weights_in_whole(size_t piece, const Vec2& weights) {
    Vec2 result(0.0F);
    const std::array<float, 3> share{1.0F - weights.x - weights.y, weights.x, weights.y};
    for (size_t corner = 0; corner < 3; ++corner) {
        const auto& w = piece_corners.weights[corner];
        result += Vec2(w[0][piece], w[1][piece]) * share[corner];
    }
    return result;
}

}  // namespace nephroid

// What a search hands on: for each receiver the specular paths that stand for all near-specular light.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pathcut/newton_solver.h"
#include "pathcut/path_light.h"
#include "pathcut/reflector_tree.h"

namespace nephroid {

/// Slopes may change over an edge's far side so many times faster than over the near one (the determinants of their
/// Jacobians) before the edge counts as a crease of curvature: where a flat wall ends in a round rim. What is linear on
/// one side says nothing of the other, so each has paths of its own.
inline constexpr double crease_ratio = 4.0;

/// Where a path meets a reflector.
struct ReflectorVertex {
    uint32_t triangle = 0;  ///< In the reflector tree's order.
    float b1 = 0.0F;        ///< Barycentric weights of corners 1 and 2.
    float b2 = 0.0F;
};

struct RepresentativePath {
    uint32_t first_vertex = 0;  ///< Of `length` vertices in RepresentativePaths::vertices, the receiver's side first.
    float residual = 0.0F;      ///< Largest |C| of its vertices; see half_vector_constraint.h.
    uint16_t light = 0;         ///< Index into the lights that were searched.
    uint8_t length = 0;
    bool exact = false;     ///< An exact specular path; else the smallest slopes that are possible.
    bool mirrored = false;  ///< The Jacobian's determinant is negative: on the other side of a caustic fold.
    bool occluded = false;  ///< Something is in the way, as far as that was tested.
};

struct SearchStatistics {
    uint64_t nodes_visited = 0;   ///< Path cuts whose children were tested.
    uint64_t leaf_cuts = 0;       ///< Triangle tuples of single receivers that no bound rejected.
    uint64_t solves = 0;          ///< Of these, what the linear test left for the solver.
    uint64_t exact = 0;           ///< Solves that ended in an exact path,
    uint64_t relaxed = 0;         ///< or in an accepted smallest slope.
    uint64_t iterations = 0;      ///< Linear systems solved by all solves.
    uint64_t continued = 0;       ///< Relaxed paths dropped because the neighbouring triangle goes on downhill.
    uint64_t merged = 0;          ///< Paths dropped for a better one close by.
    uint64_t occluded = 0;        ///< Paths dropped because something is in the way.
    uint64_t dropped_cuts = 0;    ///< Path cuts left unvisited when the budget was used up.
    uint64_t dropped_beams = 0;   ///< Beams left out; see SearchOptions::max_beams.
    uint64_t cut_short = 0;       ///< Receivers that such cuts belong to.
    double solver_seconds = 0.0;  ///< Of all solves, summed over the threads.

    SearchStatistics& operator+=(const SearchStatistics& other);
};

struct RepresentativePaths {
    std::vector<uint32_t> first_path;  ///< Per receiver, in the order given, and one more: paths of receiver i are
                                       ///< first_path[i] .. first_path[i + 1] - 1.
    std::vector<RepresentativePath> paths;
    std::vector<ReflectorVertex> vertices;
    SearchStatistics statistics;
    size_t beam_bytes = 0;  ///< Most memory that beams took.

    std::span<const RepresentativePath> of_receiver(size_t i) const {
        return std::span(paths).subspan(first_path[i], first_path[i + 1] - first_path[i]);
    }
    std::span<const ReflectorVertex> vertices_of(const RepresentativePath& path) const {
        return std::span(vertices).subspan(path.first_vertex, path.length);
    }
    size_t bytes() const;
};

}  // namespace nephroid

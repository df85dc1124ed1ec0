// What the tests of the path-cut search's extremes share: running a search, checking that a result is well-formed, and
// comparing two of them.
#pragma once

#include <span>
#include <vector>

#include "pathcut/path_cut_search.h"
#include "tests/reflector_shapes.h"

namespace nephroid::testing {

/// A search and all that went into it.
struct Search {
    std::vector<ReflectorTriangle> reflectors;
    std::vector<Vec3> receivers;
    std::vector<PathLight> lights;
    SearchOptions options;
    AcceptanceOptions acceptance;
};

struct SearchResult {
    ReflectorTree tree;
    RepresentativePaths paths;

    Vec3d position(const ReflectorVertex& vertex) const {
        return evaluate(tree.patch(vertex.triangle), Vec2d(vertex.b1, vertex.b2)).position;
    }
    size_t count_exact() const;
    size_t count_exact(size_t receiver) const;
};

/// Runs the search, and checks that its result is well-formed: paths for all receivers in order, every number finite,
/// every vertex inside of an existing triangle, no path for a receiver that is not finite, and slopes at all vertices,
/// measured afresh, within the acceptance.
SearchResult run_checked(const Search& search);

/// Paths of two results, receiver by receiver, are equal in every field but for where their vertices are stored.
bool same_paths(const RepresentativePaths& a, size_t receiver_a, const RepresentativePaths& b, size_t receiver_b);
bool same_statistics(const SearchStatistics& a, const SearchStatistics& b);

inline constexpr std::array<Selection, 2> both_selections{Selection::local_minima, Selection::every_triangle};

/// A sphere above a bumpy plane of about `triangles` each, a point light above, receivers all around.
Search sphere_and_plane(int triangles, float alpha, size_t receivers);

PathLight point_light_at(const Vec3& point);
PathLight light_from(const Vec3& direction);

}  // namespace nephroid::testing

#include "tests/pathcut_searches.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "tests/pathcut_chains.h"

namespace nephroid::testing {

namespace {

bool is_finite(const Vec3& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

struct MeasuredSlope {
    double slope;          ///< tan of the angle between the half vector and the normal's line.
    double amplification;  ///< By how much more it changes than the directions do: large at grazing incidence.
};

MeasuredSlope slope_at(const SearchResult& result, const RepresentativePath& path, size_t i, const Vec3d& receiver,
                       const PathLight& light) {
    const auto vertices = result.paths.vertices_of(path);
    const PatchPoint point = evaluate(result.tree.patch(vertices[i].triangle), Vec2d(vertices[i].b1, vertices[i].b2));
    const Vec3d viewer = i == 0 ? receiver : result.position(vertices[i - 1]);
    Vec3d wi = Vec3d(light.point);
    if (i + 1 < vertices.size()) {
        wi = result.position(vertices[i + 1]) - point.position;
    } else if (!light.at_infinity) {
        wi -= point.position;
    }
    const Vec3d h = glm::normalize(viewer - point.position) + glm::normalize(wi);
    const double along = std::abs(glm::dot(h, point.normal)), slope = glm::length(glm::cross(h, point.normal)) / along;
    return {slope, (1.0 + slope) / along};
}

/// How well slopes are known from barycentric coordinates in float: these move a vertex by a part of its triangle's
/// size, and the directions between vertices by that over their distance.
double slope_tolerance(const SearchResult& result, const RepresentativePath& path, const Vec3d& receiver,
                       const PathLight& light) {
    const auto vertices = result.paths.vertices_of(path);
    double largest = 0.0, shortest = std::numeric_limits<double>::infinity();
    Vec3d last = receiver;
    for (const ReflectorVertex& vertex : vertices) {
        const Vec3d here = result.position(vertex);
        shortest = std::min(shortest, glm::length(here - last));
        largest = std::max(largest, result.tree.patch(vertex.triangle).size);
        last = here;
    }
    if (!light.at_infinity) shortest = std::min(shortest, glm::length(Vec3d(light.point) - last));
    return 1e-5 * (1.0 + largest / shortest);
}

bool has_ordered_paths(const RepresentativePaths& paths, size_t receiver) {
    const auto key = [&](const RepresentativePath& p) {
        std::vector<uint32_t> result{p.light, p.length};
        for (const ReflectorVertex& v : paths.vertices_of(p)) result.push_back(v.triangle);
        return result;
    };
    const auto all = paths.of_receiver(receiver);
    return std::is_sorted(all.begin(), all.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
}

bool has_good_vertices(const SearchResult& result, const RepresentativePath& path) {
    if (size_t{path.first_vertex} + path.length > result.paths.vertices.size()) return false;
    const auto vertices = result.paths.vertices_of(path);
    return std::all_of(vertices.begin(), vertices.end(), [&](const ReflectorVertex& v) {
        return v.triangle < result.tree.size() && is_inside(Vec2d(v.b1, v.b2), 1e-6);
    });
}

/// Slopes are checked where a straight definition of them exists: not next to a light or receiver on the reflector.
bool reflects(const Search& search, const SearchResult& result, const RepresentativePath& path, const Vec3d& receiver) {
    const PathLight& light = search.lights[path.light];
    const double tolerance = slope_tolerance(result, path, receiver, light);
    if (!(tolerance < 1e-3)) return true;
    const auto vertices = result.paths.vertices_of(path);
    for (size_t i = 0; i < vertices.size(); ++i) {
        const bool widened = light.radius > 0.0F && i + 1 == vertices.size();
        const double limit = path.exact ? 0.0 : double{result.tree.max_slope(vertices[i].triangle)};
        const MeasuredSlope measured = slope_at(result, path, i, receiver, light);
        if (!widened && measured.slope > limit + tolerance * measured.amplification) return false;
    }
    return true;
}

auto fields(const SearchStatistics& s) {
    return std::tuple(s.nodes_visited, s.leaf_cuts, s.solves, s.exact, s.relaxed, s.iterations, s.continued, s.merged,
                      s.occluded, s.dropped_cuts, s.dropped_beams, s.cut_short);
}

}  // namespace

size_t SearchResult::count_exact() const {
    return static_cast<size_t>(
        std::count_if(paths.paths.begin(), paths.paths.end(), [](const RepresentativePath& p) { return p.exact; }));
}

size_t SearchResult::count_exact(size_t receiver) const {
    const auto all = paths.of_receiver(receiver);
    return static_cast<size_t>(
        std::count_if(all.begin(), all.end(), [](const RepresentativePath& p) { return p.exact; }));
}

SearchResult run_checked(const Search& search) {
    SearchResult result;
    result.tree = build_reflector_tree(search.reflectors, search.acceptance);
    const ReceiverTree receivers = build_receiver_tree(search.receivers);
    result.paths = find_representative_paths(result.tree, receivers, search.lights, search.options);
    const RepresentativePaths& paths = result.paths;
    REQUIRE(paths.first_path.size() == search.receivers.size() + 1);
    REQUIRE(std::is_sorted(paths.first_path.begin(), paths.first_path.end()));
    REQUIRE(paths.first_path.front() == 0);
    REQUIRE(paths.first_path.back() == paths.paths.size());
    size_t malformed = 0, not_reflecting = 0;
    for (size_t i = 0; i < search.receivers.size(); ++i) {
        if (!is_finite(search.receivers[i])) CHECK(paths.of_receiver(i).empty());
        malformed += has_ordered_paths(paths, i) ? 0 : 1;
        for (const RepresentativePath& path : paths.of_receiver(i)) {
            const bool good = path.length >= 1 && path.length <= search.options.bounces &&
                              path.light < search.lights.size() && path.residual >= 0.0F &&
                              std::isfinite(path.residual) && has_good_vertices(result, path);
            malformed += good ? 0 : 1;
            if (good && search.options.solver.newton) {
                not_reflecting += reflects(search, result, path, Vec3d(search.receivers[i])) ? 0 : 1;
            }
        }
    }
    CHECK(malformed == 0);
    CHECK(not_reflecting == 0);
    return result;
}

bool same_paths(const RepresentativePaths& a, size_t receiver_a, const RepresentativePaths& b, size_t receiver_b) {
    const auto of_a = a.of_receiver(receiver_a), of_b = b.of_receiver(receiver_b);
    return std::equal(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(), [&](const auto& p, const auto& q) {
        const auto key = [](const RepresentativePath& r) {
            return std::tuple(r.residual, r.light, r.length, r.exact, r.mirrored, r.occluded);
        };
        const auto v = a.vertices_of(p), w = b.vertices_of(q);
        return key(p) == key(q) && std::equal(v.begin(), v.end(), w.begin(), w.end(), [](const auto& x, const auto& y) {
                   return x.triangle == y.triangle && x.b1 == y.b1 && x.b2 == y.b2;
               });
    });
}

bool same_statistics(const SearchStatistics& a, const SearchStatistics& b) {
    return fields(a) == fields(b);
}

Search sphere_and_plane(int triangles, float alpha, size_t receivers) {
    Generator generator(5);
    Search search;
    add_shape(search.reflectors, sphere_shape(Vec3d(0.1, 0.6, 0.0), 0.4), triangles, 2.0, alpha);
    add_shape(search.reflectors, bumpy_plane_shape(Vec3d(0.0), 1.0, 0.03, 1.5), triangles, 1.0, alpha);
    for (size_t i = 0; i < receivers; ++i) search.receivers.emplace_back(random_point(generator, 1.5));
    search.lights = {point_light_at(Vec3(0.7F, 2.1F, 0.4F))};
    return search;
}

PathLight point_light_at(const Vec3& point) {
    PathLight light;
    light.point = point;
    return light;
}

PathLight light_from(const Vec3& direction) {
    PathLight light;
    light.point = glm::normalize(direction);
    light.at_infinity = true;
    return light;
}

}  // namespace nephroid::testing

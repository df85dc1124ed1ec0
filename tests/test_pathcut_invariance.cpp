// What the path-cut search must not depend on: scale and place of the scene, threads, the order of receivers; and what
// becomes of its results under budgets.
#include <doctest/doctest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "tests/pathcut_chains.h"
#include "tests/pathcut_searches.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

void place(Search& search, double scale, const Vec3d& offset) {
    const auto move = [&](Vec3& p) { p = Vec3(Vec3d(p) * scale + offset); };
    for (ReflectorTriangle& t : search.reflectors) std::for_each(t.positions.begin(), t.positions.end(), move);
    std::for_each(search.receivers.begin(), search.receivers.end(), move);
    for (PathLight& light : search.lights) move(light.point);
}

/// Places of the exact paths' vertices, by receiver and in an order that does not depend on the tree's.
std::vector<std::vector<Vec3d>> exact_places(const Search& search, const SearchResult& result) {
    std::vector<std::vector<Vec3d>> places;
    for (size_t i = 0; i < search.receivers.size(); ++i) {
        for (const RepresentativePath& path : result.paths.of_receiver(i)) {
            if (!path.exact) continue;
            std::vector<Vec3d>& place = places.emplace_back(1, Vec3d(static_cast<double>(i), 0.0, 0.0));
            for (const ReflectorVertex& v : result.paths.vertices_of(path)) place.push_back(result.position(v));
        }
    }
    return places;
}

/// How many exact paths of one scene the other, scaled and moved, lacks.
size_t count_unmatched(const std::vector<std::vector<Vec3d>>& from, const std::vector<std::vector<Vec3d>>& to,
                       double scale, const Vec3d& offset, double tolerance) {
    return static_cast<size_t>(std::count_if(from.begin(), from.end(), [&](const auto& a) {
        return std::none_of(to.begin(), to.end(), [&](const auto& b) {
            if (a.size() != b.size() || a[0] != b[0]) return false;
            for (size_t i = 1; i < a.size(); ++i) {
                if (glm::length(a[i] * scale + offset - b[i]) > tolerance * scale) return false;
            }
            return true;
        });
    }));
}

}  // namespace

TEST_CASE("results scale with the scene") {
    Search base = sphere_and_plane(400, 0.001F, 30);
    base.options.bounces = 2;
    const auto expected = exact_places(base, run_checked(base));
    REQUIRE(expected.size() > 100);
    for (const double scale : {1e-4, 1024.0, 1e5}) {
        CAPTURE(scale);
        Search search = base;
        place(search, scale, Vec3d(0.0));
        const auto places = exact_places(search, run_checked(search));
        // Factors that are no powers of two round positions differently (by 1e-7): paths at the end of a surface or on
        // a fold may come or go with that.
        const size_t allowed = scale == 1024.0 ? 0 : expected.size() / 100;
        CHECK(count_unmatched(expected, places, scale, Vec3d(0.0), 1e-4) <= allowed);
        CHECK(count_unmatched(places, expected, 1.0 / scale, Vec3d(0.0), 1e-4 * scale) <= allowed);
    }
}

TEST_CASE("results move with the scene") {
    // Positions are rounded to multiples of 1/128 there, about a tenth of the triangles' size. Moved back, the scene
    // keeps that shape to the last bit, so that the two differ by nothing but the search.
    const Vec3d offset(1e5, -1e5, 1e5);
    for (const int bounces : {1, 2}) {
        CAPTURE(bounces);
        Search base = sphere_and_plane(600, 0.001F, bounces == 1 ? 100 : 25);
        base.options.bounces = bounces;
        Search moved = base;
        place(moved, 1.0, offset);
        Search back = moved;
        place(back, 1.0, -offset);
        const auto base_places = exact_places(base, run_checked(base));
        const auto moved_places = exact_places(moved, run_checked(moved));
        const auto back_places = exact_places(back, run_checked(back));
        REQUIRE(back_places.size() > 100);
        MESSAGE(base_places.size() << " exact paths, " << moved_places.size() << " moved, " << back_places.size()
                                   << " moved back");
        // One reflection is searched with differences of positions, which are exact. Beams hold points that are rounded
        // to float once more: they may miss a few.
        const size_t allowed = bounces == 1 ? 0 : back_places.size() / 25;
        CHECK(count_unmatched(back_places, moved_places, 1.0, offset, 1e-5) <= allowed);
        CHECK(count_unmatched(moved_places, back_places, 1.0, -offset, 1e-5) <= allowed);
        // Normals are not rounded, so that paths stay about where they were.
        CHECK(count_unmatched(base_places, moved_places, 1.0, offset, 0.05) <= base_places.size() / 20);
        CHECK(count_unmatched(moved_places, base_places, 1.0, -offset, 0.05) <= base_places.size() / 20);
    }
}

TEST_CASE("results depend neither on threads nor on the receivers' order") {
    for (const int bounces : {1, 2}) {
        CAPTURE(bounces);
        Search search = sphere_and_plane(bounces == 1 ? 600 : 150, 0.01F, bounces == 1 ? 2500 : 200);
        search.options.bounces = bounces;
        search.lights.push_back(light_from(Vec3(0.3F, 1.0F, -0.2F)));
        const auto run_with_threads = [&](size_t threads) {
            const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
            return run_checked(search);
        };
        const SearchResult one = run_with_threads(1), two = run_with_threads(2);
        REQUIRE(one.paths.paths.size() > search.receivers.size());
        CHECK(one.paths.first_path == two.paths.first_path);
        CHECK(same_statistics(one.paths.statistics, two.paths.statistics));
        CHECK(one.paths.beam_bytes == two.paths.beam_bytes);
        REQUIRE(one.paths.vertices.size() == two.paths.vertices.size());
        size_t different = 0;
        for (size_t i = 0; i < search.receivers.size(); ++i) {
            different += same_paths(one.paths, i, two.paths, i) ? 0 : 1;
        }
        for (size_t i = 0; i < one.paths.paths.size(); ++i) {
            different += one.paths.paths[i].first_vertex == two.paths.paths[i].first_vertex ? 0 : 1;
        }
        CHECK(different == 0);

        std::vector<size_t> order(search.receivers.size());
        std::iota(order.begin(), order.end(), size_t{0});
        std::shuffle(order.begin(), order.end(), Generator(9));
        Search permuted = search;
        for (size_t i = 0; i < order.size(); ++i) permuted.receivers[i] = search.receivers[order[i]];
        const SearchResult result = run_checked(permuted);
        different = 0;
        for (size_t i = 0; i < order.size(); ++i) different += same_paths(one.paths, order[i], result.paths, i) ? 0 : 1;
        CHECK(different == 0);
        CHECK(same_statistics(one.paths.statistics, result.paths.statistics));
    }
}

namespace {

/// Paths of one result that another lacks; relaxed ones only if they count.
size_t count_paths_not_in(const SearchResult& result, const SearchResult& all, size_t receivers, bool exact_only) {
    size_t missing = 0;
    for (size_t i = 0; i < receivers; ++i) {
        for (const RepresentativePath& p : result.paths.of_receiver(i)) {
            if (exact_only && !p.exact) continue;
            const auto v = result.paths.vertices_of(p);
            const auto others = all.paths.of_receiver(i);
            missing += std::none_of(others.begin(), others.end(), [&](const RepresentativePath& q) {
                const auto w = all.paths.vertices_of(q);
                return p.light == q.light && std::equal(v.begin(), v.end(), w.begin(), w.end(), [](auto& x, auto& y) {
                           return x.triangle == y.triangle && x.b1 == y.b1 && x.b2 == y.b2;
                       });
            });
        }
    }
    return missing;
}

}  // namespace

TEST_CASE("a search stops when its budget is used up, and says so") {
    for (const Selection selection : both_selections) {
        for (const int bounces : {1, 2}) {
            CAPTURE(static_cast<int>(selection));
            CAPTURE(bounces);
            const bool all_pairs = bounces == 2 && selection == Selection::every_triangle;
            Search search = sphere_and_plane(all_pairs ? 30 : 200, 0.01F, all_pairs ? 3 : 100);
            search.options.selection = selection;
            search.options.bounces = bounces;
            search.options.merge_distance = -1.0;  // A path may owe its being dropped to a better one.
            const SearchResult all = run_checked(search);
            CHECK(all.paths.statistics.dropped_cuts == 0);
            CHECK(all.paths.statistics.cut_short == 0);
            size_t last = 0;
            for (const uint64_t budget : {1, 10, 40, 1000000}) {
                CAPTURE(budget);
                search.options.max_nodes_per_receiver = budget;
                const SearchResult some = run_checked(search);
                CHECK(count_paths_not_in(some, all, search.receivers.size(), false) == 0);
                CHECK(some.paths.paths.size() >= last);
                last = some.paths.paths.size();
                const SearchStatistics& s = some.paths.statistics;
                CHECK((s.dropped_cuts > 0) == (s.cut_short > 0));
                CHECK(s.cut_short <= search.receivers.size());
                if (budget <= 10) CHECK(s.dropped_cuts > 0);
                if (budget == 1000000) CHECK(last == all.paths.paths.size());
                // The beams are made before there are receivers; of the rest one receiver may overstep.
                if (bounces == 1) CHECK(s.nodes_visited <= budget * search.receivers.size());
                size_t incomplete = 0;
                for (size_t i = 0; i < search.receivers.size(); ++i) {
                    incomplete += some.paths.of_receiver(i).size() < all.paths.of_receiver(i).size() ? 1 : 0;
                }
                CHECK(incomplete <= s.cut_short);
            }
        }
    }
}

TEST_CASE("beams beyond their limit are dropped, and counted") {
    Search search = sphere_and_plane(300, 0.01F, 60);
    search.options.bounces = 2;
    search.options.merge_distance = -1.0;
    const SearchResult all = run_checked(search);
    CHECK(all.paths.statistics.dropped_beams == 0);
    for (const size_t limit : {size_t{0}, size_t{1}, size_t{100}}) {
        CAPTURE(limit);
        search.options.max_beams = limit;
        const SearchResult some = run_checked(search);
        CHECK(some.paths.statistics.dropped_beams > 0);
        CHECK(count_paths_not_in(some, all, search.receivers.size(), true) == 0);
        CHECK(some.count_exact() < all.count_exact());
    }
}

TEST_CASE("a flat wall that ends in a round rim has paths on both sides of the seam") {
    // Slopes fall from the wall to an exact path behind the seam, where they change tens of times as fast: what lobe is
    // right there covers nothing of the wall.
    constexpr double top = 0.48, radius = 0.03;
    const Shape shape = [](double u, double v) -> ShapePoint {
        const double z = u - 0.5;
        if (v <= 0.5) return {{0.0, 2.0 * v * top, z}, {1.0, 0.0, 0.0}};
        const double turn = 3.14159265 * (v - 0.5);
        const Vec3d normal(std::cos(turn), std::sin(turn), 0.0);
        return {Vec3d(-radius, top, z) + radius * normal, normal};
    };
    Search wall;
    add_shape(wall.reflectors, shape, 12, 12, 0.02F);
    wall.receivers = {Vec3(1.0F, 0.0F, 0.01F)};
    wall.lights = {point_light_at({3.0F, 2.0F, 0.02F})};
    wall.acceptance.alpha_multiple = 6.0;
    for (const double scale : {1e-4, 1.0, 1e5}) {
        CAPTURE(scale);
        Search scaled = wall;
        place(scaled, scale, Vec3d(0.0));
        const SearchResult found = run_checked(scaled);
        bool on_wall = false, on_rim = false;
        for (const RepresentativePath& path : found.paths.of_receiver(0)) {
            const ReflectorVertex& vertex = found.paths.vertices_of(path)[0];
            double highest = 0.0;
            for (const Vec3d& corner : found.tree.patch(vertex.triangle).positions) {
                highest = std::max(highest, corner.y);
            }
            const bool in_rim = highest > scale * (top + 1e-6);
            if (in_rim && path.exact) on_rim = true;
            if (!in_rim && !path.exact && std::abs(found.position(vertex).y - scale * top) < scale * 1e-6) {
                on_wall = true;
            }
        }
        CHECK(on_rim);
        CHECK(on_wall);
    }
}

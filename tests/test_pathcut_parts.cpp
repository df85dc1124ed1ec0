// The parts of the path-cut search one by one: merging, adjacency, trees, the tests that reject cuts, lit triangles.
#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "pathcut/beam.h"
#include "pathcut/bounding.h"
#include "pathcut/mesh_adjacency.h"
#include "pathcut/path_merging.h"
#include "tests/pathcut_chains.h"
#include "tests/pathcut_searches.h"
#include "tests/test_scenes.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

FoundPath found_path(uint32_t triangle, const Vec3& position, bool exact = true, float residual = 0.0F) {
    FoundPath found;
    found.path.length = 1;
    found.path.exact = exact;
    found.path.residual = residual;
    found.vertices[0].triangle = triangle;
    found.positions.fill(position);
    found.edges.fill(1.0F);
    return found;
}

std::vector<uint32_t> triangles_of(const std::vector<FoundPath>& paths) {
    std::vector<uint32_t> triangles;
    for (const FoundPath& path : paths) triangles.push_back(path.vertices[0].triangle);
    return triangles;
}

}  // namespace

TEST_CASE("paths merge by distance, the better one stays") {
    const Vec3 p(1.0F, 2.0F, 3.0F);
    std::vector<FoundPath> paths;
    SUBCASE("equal paths become one at any distance from zero on") {
        for (const double distance : {0.0, 0.1, 10.0}) {
            paths = {found_path(1, p), found_path(2, p), found_path(7, p)};
            CHECK(merge_paths(paths, distance) == 2);
            CHECK(paths.size() == 1);
        }
        paths = {found_path(1, p), found_path(2, p)};
        CHECK(merge_paths(paths, -1.0) == 0);
        CHECK(paths.size() == 2);
    }
    SUBCASE("only as close as the smaller of the two triangles says") {
        paths = {found_path(1, p), found_path(2, p + Vec3(0.09F, 0.0F, 0.0F)),
                 found_path(3, p + Vec3(0.0F, 0.2F, 0.0F))};
        CHECK(merge_paths(paths, 0.0) == 0);
        paths[1].edges[0] = 0.5F;
        CHECK(merge_paths(paths, 0.1) == 0);
        paths[1].edges[0] = 1.0F;
        CHECK(merge_paths(paths, 0.1) == 1);
        CHECK(triangles_of(paths) == std::vector<uint32_t>{1, 3});
    }
    SUBCASE("exact before relaxed, then by residual; the order stays") {
        paths = {found_path(1, p, false, 0.0F), found_path(2, p, true, 1e-9F), found_path(3, p, true, 1e-10F),
                 found_path(4, p + Vec3(5.0F), false, 0.3F), found_path(5, p + Vec3(5.0F), false, 0.2F)};
        CHECK(merge_paths(paths, 0.1) == 3);
        CHECK(triangles_of(paths) == std::vector<uint32_t>{3, 5});
    }
    SUBCASE("two exact paths on the two sides of a fold stay both") {
        paths = {found_path(1, p), found_path(2, p)};
        paths[1].path.mirrored = true;
        CHECK(merge_paths(paths, 0.1) == 0);
        paths = {found_path(1, p), found_path(2, p), found_path(3, p, false, 0.1F)};
        paths[1].path.mirrored = true;
        paths[2].path.mirrored = true;
        CHECK(merge_paths(paths, 0.1) == 1);  // A relaxed one gives way to either.
        CHECK(triangles_of(paths) == std::vector<uint32_t>{1, 2});
    }
    SUBCASE("paths on the two sides of a crease stay both") {
        paths = {found_path(1, p), found_path(2, p, false, 0.1F)};
        paths[0].steepness = 100.0F;
        paths[1].steepness = 1.0F;
        CHECK(merge_paths(paths, 0.1) == 0);
        paths[1].steepness = 90.0F;
        CHECK(merge_paths(paths, 0.1) == 1);
    }
    SUBCASE("never across receivers, lights or lengths") {
        paths = {found_path(1, p), found_path(1, p), found_path(1, p), found_path(1, p)};
        paths[1].path.length = 2;
        paths[2].path.light = 1;
        paths[3].receiver = 1;
        CHECK(merge_paths(paths, 10.0) == 0);
    }
    SUBCASE("all vertices must be close") {
        paths = {found_path(1, p), found_path(2, p)};
        for (FoundPath& path : paths) path.path.length = 2;
        paths[1].positions[1] = p + Vec3(0.0F, 0.2F, 0.0F);
        CHECK(merge_paths(paths, 0.1) == 0);
        paths[1].positions[1] = p + Vec3(0.0F, 0.05F, 0.0F);
        CHECK(merge_paths(paths, 0.1) == 1);
    }
    SUBCASE("nothing") {
        CHECK(merge_paths(paths, 0.1) == 0);
        CHECK(paths.empty());
    }
}

TEST_CASE("merging leaves a path next to every one it drops, and no two that are close") {
    Generator generator(3);
    std::vector<FoundPath> paths;
    for (uint32_t i = 0; i < 3000; ++i) {
        FoundPath path = found_path(i, Vec3(random_point(generator, 1.0)), i % 3 != 0, 0.0F);
        path.path.residual = static_cast<float>(uniform(generator, 0.0, 1.0));
        path.path.mirrored = i % 2 == 0;
        paths.push_back(path);
    }
    const std::vector<FoundPath> before = paths;
    const size_t dropped = merge_paths(paths, 0.1);
    CHECK(dropped > 500);
    CHECK(paths.size() + dropped == before.size());
    CHECK(std::is_sorted(paths.begin(), paths.end(), comes_before));
    const auto merges = [](const FoundPath& a, const FoundPath& b) {
        const bool both_sides = a.path.exact && b.path.exact && a.path.mirrored != b.path.mirrored;
        return !both_sides && glm::length(a.positions[0] - b.positions[0]) <= 0.1F;
    };
    const std::vector<uint32_t> kept = triangles_of(paths);
    size_t wrong = 0;
    for (const FoundPath& path : before) {
        const bool stays = std::binary_search(kept.begin(), kept.end(), path.vertices[0].triangle);
        const bool has_better = std::any_of(paths.begin(), paths.end(), [&](const FoundPath& other) {
            return other.vertices[0].triangle != path.vertices[0].triangle && merges(other, path) &&
                   (other.path.exact != path.path.exact ? other.path.exact : other.path.residual < path.path.residual);
        });
        wrong += stays == has_better ? 1 : 0;
    }
    CHECK(wrong == 0);
}

TEST_CASE("a path on the edge between two triangles is found in both, and merged") {
    Search search;
    add_shape(search.reflectors, flat_shape(Vec3d(-1.0, 0.0, -1.0), Vec3d(0.0, 0.0, 2.0), Vec3d(2.0, 0.0, 0.0)), 1, 1,
              0.001F);
    search.receivers = {Vec3(0.5F, 1.0F, 0.0F)};
    search.lights = {point_light_at(Vec3(-0.5F, 1.0F, 0.0F))};
    search.options.merge_distance = -1.0;
    CHECK(run_checked(search).count_exact() == 2);
    search.options.merge_distance = 1e-6;  // The two differ by rounding, or not at all.
    CHECK(run_checked(search).count_exact() == 1);
    search.options.merge_distance = 0.1;
    const SearchResult merged = run_checked(search);
    CHECK(merged.count_exact() == 1);
    CHECK(merged.paths.statistics.merged == 1);
}

namespace {

ReflectorTriangle triangle_of_points(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& n) {
    return {{a, b, c}, {n, n, n}, 0.01F, {}};
}

size_t count_twins(const std::vector<Twins>& twins) {
    size_t count = 0;
    for (const Twins& t : twins) count += static_cast<size_t>(3 - std::count(t.begin(), t.end(), no_half_edge));
    return count;
}

}  // namespace

TEST_CASE("a closed sphere has a twin at every edge") {
    const Shape open = sphere_shape(Vec3d(0.3, 0.2, 0.1), 0.7);
    // The same positions at both ends of u: a sine of a full turn is not quite zero.
    const Shape closed = [&](double u, double v) { return open(u >= 1.0 ? 0.0 : u, v); };
    std::vector<ReflectorTriangle> triangles;
    add_shape(triangles, closed, 24, 12, 0.01F);
    const ReflectorTree tree = build_reflector_tree(triangles, {});
    REQUIRE(tree.size() == 24 * 22);
    size_t missing = 0, wrong = 0;
    for (uint32_t t = 0; t < tree.size(); ++t) {
        for (uint32_t edge = 0; edge < 3; ++edge) {
            const HalfEdge twin = tree.twins[t][edge];
            const size_t from = edge, to = (edge + 1) % 3;
            if (twin == no_half_edge) {
                const bool at_pole =
                    std::max(std::abs(tree.normal(t, from).y), std::abs(tree.normal(t, to).y)) > 0.9999F;
                missing += at_pole ? 0 : 1;
                continue;
            }
            const uint32_t other = triangle_of(twin), back = edge_of(twin);
            const bool matches = tree.twins[other][back] == make_half_edge(t, edge) &&
                                 tree.position(other, back) == tree.position(t, to) &&
                                 tree.position(other, (back + 1) % 3) == tree.position(t, from);
            wrong += matches && other != t ? 0 : 1;
        }
    }
    CHECK(missing == 0);
    CHECK(wrong == 0);
}

TEST_CASE("creases, edges of three triangles and inconsistent winding have no twins") {
    const Vec3 a(0.0F), b(1.0F, 0.0F, 0.0F), c(0.0F, 0.0F, 1.0F), d(1.0F, 0.0F, 1.0F), e(0.5F, 1.0F, 0.5F);
    const Vec3 up(0.0F, 1.0F, 0.0F), tilted = glm::normalize(Vec3(0.1F, 1.0F, 0.0F));
    const ReflectorTriangle first = triangle_of_points(a, c, b, up), second = triangle_of_points(b, c, d, up);
    CHECK(count_twins(find_neighbours(std::vector{first, second})) == 2);
    SUBCASE("negative zero is zero") {
        ReflectorTriangle negative = second;
        for (Vec3& p : negative.positions) p.y = -0.0F;
        CHECK(count_twins(find_neighbours(std::vector{first, negative})) == 2);
    }
    SUBCASE("crease") {
        CHECK(count_twins(find_neighbours(std::vector{first, triangle_of_points(b, c, d, tilted)})) == 0);
        ReflectorTriangle half = second;
        half.normals[0] = tilted;
        CHECK(count_twins(find_neighbours(std::vector{first, half})) == 0);
        half = second;
        half.normals[2] = tilted;  // Away from the edge: smooth across it.
        CHECK(count_twins(find_neighbours(std::vector{first, half})) == 2);
    }
    SUBCASE("three triangles") {
        CHECK(count_twins(find_neighbours(std::vector{first, second, triangle_of_points(b, c, e, up)})) == 0);
        CHECK(count_twins(find_neighbours(std::vector{first, second, triangle_of_points(c, b, e, up)})) == 0);
        CHECK(count_twins(find_neighbours(std::vector{first, second, first, second})) == 0);
    }
    SUBCASE("winding") {
        CHECK(count_twins(find_neighbours(std::vector{first, triangle_of_points(c, b, d, up)})) == 0);
        CHECK(count_twins(find_neighbours(std::vector{first, first})) == 0);
    }
    SUBCASE("back to back") {
        const ReflectorTriangle back = triangle_of_points(a, b, c, up);
        const std::vector<Twins> twins = find_neighbours(std::vector{first, back});
        CHECK(count_twins(twins) == 6);
        // Such a pair ends walks around its corners, and has paths like any other.
        Search search;
        search.reflectors = {first, back};
        search.receivers = {Vec3(0.2F, 1.0F, 0.3F), Vec3(3.0F, 1.0F, 3.0F)};
        search.lights = {point_light_at(Vec3(0.3F, 1.0F, 0.2F))};
        CHECK(run_checked(search).count_exact(0) >= 1);
    }
    SUBCASE("none, or without area") {
        CHECK(find_neighbours({}).empty());
        CHECK(count_twins(find_neighbours(std::vector{triangle_of_points(a, a, a, up)})) == 0);
    }
}

namespace {

template <class Block, class Visit>
void for_all_items(const BlockTree<Block>& tree, TreeItem item, std::vector<TreeItem>& above, const Visit& visit) {
    above.push_back(item);
    for (size_t lane = 0; lane < tree.child_count(item); ++lane) {
        const TreeItem child = BlockTree<Block>::child(item, lane);
        if (child.level == 0) {
            visit(child.index, above);
        } else {
            for_all_items(tree, child, above, visit);
        }
    }
    above.pop_back();
}

template <class Block>
auto bound_of(const BlockTree<Block>& tree, TreeItem item) {
    return extract(tree.levels[item.level][item.index / block_size], item.index % block_size);
}

bool holds(const PointBound<float>& bound, const Vec3& p) {
    const Vec3d centre(double{bound.centre.x}, double{bound.centre.y}, double{bound.centre.z});
    return glm::length(Vec3d(p) - centre) <= double{bound.radius};
}

}  // namespace

TEST_CASE("a block tree has every item once, and its bounds hold their members") {
    Generator generator(8);
    for (const size_t size :
         {size_t{1}, size_t{15}, size_t{16}, size_t{17}, size_t{255}, size_t{256}, size_t{257}, size_t{5000}}) {
        CAPTURE(size);
        for (const double distance : {0.0, 1e5}) {
            std::vector<Vec3> points;
            // Some coincide, so that medians are shared.
            for (size_t i = 0; i < size; ++i) {
                points.emplace_back(random_point(generator, 1.0) * (i % 5 == 0 ? 0.0 : 1.0) + Vec3d(distance));
            }
            const ReceiverTree receivers = build_receiver_tree(points);
            std::vector<int> seen(size, 0), at(size, 0);
            size_t outside = 0;
            std::vector<TreeItem> above;
            for_all_items(receivers.tree, receivers.tree.root(), above, [&](uint32_t i, const auto& parents) {
                ++at[i];
                ++seen[receivers.order[i]];
                const Vec3& point = points[receivers.order[i]];
                const PointBound<float> leaf = bound_of(receivers.tree, {0, i});
                outside += leaf.radius == 0.0F && to_vec3(leaf.centre) == point ? 0 : 1;
                for (size_t k = 1; k < parents.size(); ++k) {
                    outside += holds(bound_of(receivers.tree, parents[k]), point) ? 0 : 1;
                }
            });
            CHECK(outside == 0);
            CHECK(std::count(seen.begin(), seen.end(), 1) == static_cast<std::ptrdiff_t>(size));
            CHECK(std::count(at.begin(), at.end(), 1) == static_cast<std::ptrdiff_t>(size));
        }
    }
}

TEST_CASE("bounds of reflectors hold their triangles and all accepted half vectors") {
    Generator generator(12);
    for (const float alpha : {1e-4F, 0.05F, 1.0F}) {
        std::vector<ReflectorTriangle> triangles;
        add_shape(triangles, torus_shape(Vec3d(10.0, 0.0, 0.0), 0.5, 0.2), 3000, 2.0, alpha);
        add_shape(triangles, bumpy_plane_shape(Vec3d(10.0, -1.0, 0.0), 1.0, 0.02, 2.0), 2000, 1.0, alpha);
        const ReflectorTree tree = build_reflector_tree(triangles, {});
        size_t outside = 0, visited = 0;
        std::vector<TreeItem> above;
        for_all_items(tree.tree, tree.tree.root(), above, [&](uint32_t t, std::vector<TreeItem> nodes) {
            ++visited;
            nodes.push_back({0, t});
            const double u = uniform(generator, 0.0, 1.0), v = uniform(generator, 0.0, 1.0 - u);
            const Vec3d normal = evaluate(tree.patch(t), Vec2d(u, v)).normal;
            const Vec3d across = glm::normalize(glm::cross(normal, random_point(generator, 1.0)));
            const double slope = std::min(double{tree.max_slope(t)}, 1e9);
            const Vec3d accepted = normal + across * slope;
            for (size_t k = 1; k < nodes.size(); ++k) {
                const MirrorBound<float> bound = bound_of(tree.tree, nodes[k]);
                for (size_t corner = 0; corner < 3; ++corner) {
                    outside += holds(bound.points, tree.position(t, corner)) ? 0 : 1;
                }
                const Vec3d axis(double{bound.axis.x}, double{bound.axis.y}, double{bound.axis.z});
                const double sine = glm::length(glm::cross(axis, glm::normalize(accepted)));
                outside += bound.cos_spread == 0.0F || sine <= double{bound.sin_spread} + 4e-6 ? 0 : 1;
            }
        });
        CHECK(visited == tree.size());
        CHECK(outside == 0);
    }
}

TEST_CASE("slopes count up to a multiple of alpha, of rough surfaces up to what is enough") {
    const AcceptanceOptions options{.alpha_multiple = 6.0, .enough_slope = 0.12};
    CHECK(options.max_slope(0.0) == options.max_slope(1e-4));
    CHECK(options.max_slope(1e-4) == doctest::Approx(6e-4));
    CHECK(options.max_slope(0.02) == doctest::Approx(0.12));
    CHECK(options.max_slope(0.05) == doctest::Approx(0.12));
    CHECK(options.max_slope(0.1) == doctest::Approx(0.2));
    CHECK(options.max_slope(1.0) == doctest::Approx(2.0));
    CHECK(AcceptanceOptions{.alpha_multiple = 1.0, .enough_slope = 0.12}.max_slope(1.0) == doctest::Approx(1.0));
    CHECK(AcceptanceOptions{.alpha_multiple = 6.0}.max_slope(1.0) == doctest::Approx(6.0));
    // Eq. 1 knows no such limit.
    CHECK(AcceptanceOptions{.epsilon = 0.01, .enough_slope = 0.12}.max_slope(0.1) ==
          AcceptanceOptions{.epsilon = 0.01}.max_slope(0.1));
}

TEST_CASE("keys that are not numbers, or infinite, are ordered like others") {
    Generator generator(2);
    constexpr float inf = std::numeric_limits<float>::infinity();
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    for (const size_t size : {size_t{20}, size_t{300}, size_t{6000}}) {
        std::vector<OrderKey> keys(size);
        for (OrderKey& key : keys) {
            for (float& k : key) {
                const double which = uniform(generator, 0.0, 1.0);
                k = which < 0.3 ? nan : which < 0.35 ? inf : which < 0.4 ? -inf : static_cast<float>(which);
            }
        }
        std::vector<uint32_t> order = compact_order(keys);
        CHECK(order == compact_order(keys));
        std::sort(order.begin(), order.end());
        bool complete = order.size() == size;
        for (size_t i = 0; i < size; ++i) complete = complete && order[i] == i;
        CHECK(complete);
    }
}

namespace {

float random_size(Generator& generator, double low, double high) {
    return static_cast<float>(std::exp(uniform(generator, std::log(low), std::log(high))));
}

Vec3d random_direction(Generator& generator) {
    std::normal_distribution<double> gauss;
    Vec3d d;
    do d = Vec3d(gauss(generator), gauss(generator), gauss(generator));
    while (!(glm::length(d) > 1e-3));
    return glm::normalize(d);
}

/// A unit vector turned by some angle up to `angle`, rounded to float; `angle` itself often.
Vec3 turned(Generator& generator, const Vec3d& direction, double angle) {
    const Vec3d across = glm::normalize(glm::cross(direction, random_direction(generator)));
    const double by = angle * std::min(1.0, uniform(generator, 0.0, 1.3));
    return Vec3(direction * std::cos(by) + across * std::sin(by));
}

struct Ball {
    PointBound<float> bound;
    Vec3d inside;  ///< On the surface often.
};
Ball random_ball(Generator& generator, double extent) {
    const Vec3 centre(random_point(generator, extent));
    const float radius = uniform(generator, 0.0, 1.0) < 0.1 ? 0.0F : random_size(generator, 1e-5, 1.0);
    const double part = std::min(1.0, uniform(generator, 0.0, 1.5));
    return {{to_triple(centre), radius}, Vec3d(centre) + random_direction(generator) * (double{radius} * part)};
}

struct Rejections {
    size_t wrong = 0;
    size_t wrong_in_lanes = 0;
};

}  // namespace

TEST_CASE("no mirror that reflects is rejected") {
    Generator generator(21);
    Rejections rejections;
    size_t tested = 0, rejected_others = 0;
    while (tested < 1000000) {
        // Sixteen mirrors that share their viewer and light, as the search tests them.
        const Ball viewer = random_ball(generator, 1.5), light_ball = random_ball(generator, 1.5);
        PathLight light = point_light_at(to_vec3(light_ball.bound.centre));
        light.radius = light_ball.bound.radius;
        if (uniform(generator, 0.0, 1.0) < 0.1) light = light_from(Vec3(light_ball.inside));
        MirrorBlock block;
        std::array<MirrorBound<float>, block_size> mirrors;
        uint32_t reflecting = 0;
        for (size_t lane = 0; lane < block_size; ++lane) {
            const Ball ball = random_ball(generator, 1.5);
            const Vec3d wo = glm::normalize(viewer.inside - ball.inside);
            const Vec3d wi = light.at_infinity ? Vec3d(light.point) : glm::normalize(light_ball.inside - ball.inside);
            const double spread = std::exp(uniform(generator, std::log(1e-5), std::log(1.5)));
            const Vec3d h = wo + wi;
            const double side = uniform(generator, 0.0, 1.0) < 0.5 ? 1.0 : -1.0;
            const Vec3 axis = turned(generator, glm::normalize(h) * side, spread);
            MirrorBound<float> mirror{ball.bound, to_triple(axis), static_cast<float>(std::cos(spread)),
                                      static_cast<float>(std::sin(spread))};
            // Rounding of the axis is what the bounds' slack is for, and the test's: only exact members count.
            const double sine = glm::length(glm::cross(glm::normalize(Vec3d(axis)), glm::normalize(h)));
            if (glm::length(h) > 1e-6 && sine <= std::sin(spread)) reflecting |= 1U << lane;
            mirrors[lane] = mirror;
            store(block, lane, mirror);
            const Leg<float> to_viewer = make_leg(mirror.points, viewer.bound),
                             to_light = make_leg(mirror.points, light);
            if (cannot_reflect(mirror, to_viewer, to_light)) rejections.wrong += reflecting >> lane & 1U;
            mirror.axis = to_triple(Vec3(random_direction(generator)));
            rejected_others += cannot_reflect(mirror, to_viewer, to_light) ? 1 : 0;
        }
        for (size_t first = 0; first < block_size; first += simd_width) {
            const MirrorBound<FloatV> lanes = load(block, first);
            const uint32_t rejected = lane_bits(cannot_reflect<FloatV>(
                lanes, make_leg<FloatV>(lanes.points, broadcast(viewer.bound)), make_leg<FloatV>(lanes.points, light)));
            rejections.wrong_in_lanes += static_cast<size_t>(std::popcount((rejected << first) & reflecting));
        }
        tested += static_cast<size_t>(std::popcount(reflecting));
    }
    CHECK(rejections.wrong == 0);
    CHECK(rejections.wrong_in_lanes == 0);
    CHECK(rejected_others > tested / 10);  // And it does reject what does not reflect.
}

TEST_CASE("no beam that arrives is missed") {
    Generator generator(22);
    size_t wrong = 0, wrong_in_lanes = 0, missed_others = 0;
    constexpr size_t count = 300000;
    for (size_t n = 0; n < count; ++n) {
        const Ball start = random_ball(generator, 1.5), viewer = random_ball(generator, 1.5);
        const double spread = std::exp(uniform(generator, std::log(1e-5), std::log(1.5)));
        const double deviation = n % 3 == 0 ? 0.0 : std::exp(uniform(generator, std::log(1e-5), std::log(1.0)));
        const Vec3d leaving(
            turned(generator, glm::normalize(viewer.inside - start.inside), 2.0 * std::asin(deviation / 2.0)));
        const Vec3 axis = turned(generator, glm::normalize(leaving), spread * (1.0 - 1e-6) - 1e-7);
        MirrorBound<float> beams{start.bound, to_triple(axis), static_cast<float>(std::cos(spread)),
                                 static_cast<float>(std::sin(spread))};
        const Leg<float> leg = make_leg(start.bound, viewer.bound);
        const auto chord = static_cast<float>(deviation);
        wrong += misses(beams, leg, chord) ? 1 : 0;
        const Leg<FloatV> wide = make_leg<FloatV>(broadcast(start.bound), broadcast(viewer.bound));
        wrong_in_lanes += lane_bits(misses<FloatV>(broadcast(beams), wide, FloatV(chord))) != 0 ? 1 : 0;
        beams.axis = to_triple(Vec3(random_direction(generator)));
        missed_others += misses(beams, leg, chord) ? 1 : 0;
    }
    CHECK(wrong == 0);
    CHECK(wrong_in_lanes == 0);
    CHECK(missed_others > count / 10);
}

TEST_CASE("no point inside a spot light's cone counts as outside") {
    Generator generator(23);
    size_t wrong = 0, outside_others = 0;
    constexpr size_t count = 300000;
    for (size_t n = 0; n < count; ++n) {
        const Ball ball = random_ball(generator, 1.5);
        PathLight light = point_light_at(Vec3(random_point(generator, 1.5)));
        const double cone = uniform(generator, 0.001, 3.1);
        light.cos_cone = static_cast<float>(std::cos(cone));
        light.axis = turned(generator, glm::normalize(ball.inside - Vec3d(light.point)), cone);
        const Leg<float> to_light = make_leg(ball.bound, light);
        if (light.shines_on(ball.inside)) wrong += outside_light_cone(light, to_light) ? 1 : 0;
        light.axis = -light.axis;
        outside_others += outside_light_cone(light, to_light) ? 1 : 0;
    }
    CHECK(wrong == 0);
    CHECK(outside_others > count / 10);
}

namespace {

bool is_lit(const LitTriangles& lit, uint32_t triangle) {
    return (lit[triangle / block_size] >> (triangle % block_size) & 1U) != 0;
}

}  // namespace

TEST_CASE("triangles behind a blocker are dark, and those outside of a spot's cone") {
    std::vector<ReflectorTriangle> triangles;
    add_shape(triangles, flat_shape(Vec3d(-1.0, 0.0, -1.0), Vec3d(0.0, 0.0, 2.0), Vec3d(2.0, 0.0, 0.0)), 30, 30, 0.01F);
    const ReflectorTree tree = build_reflector_tree(triangles, {});
    Scene scene;
    scene.materials.push_back(lambert(Rgb(0.5F)));
    add_mesh(scene, quad(Vec3(-1.0F, 0.0F, -1.0F), Vec3(0.0F, 0.0F, 2.0F), Vec3(2.0F, 0.0F, 0.0F), 0));
    add_mesh(scene, quad(Vec3(-3.0F, 0.5F, -3.0F), Vec3(0.0F, 0.0F, 6.0F), Vec3(3.0F, 0.0F, 0.0F), 0));
    const Accelerator accelerator(scene, 1);
    const auto centre_of = [&](uint32_t t) {
        return (tree.position(t, 0) + tree.position(t, 1) + tree.position(t, 2)) / 3.0F;
    };
    std::vector<PathLight> lights{light_from(Vec3(0.0F, 1.0F, 0.0F)), point_light_at(Vec3(0.0F, 2.0F, 0.0F)),
                                  point_light_at(Vec3(0.0F, 2.0F, 0.0F))};
    lights[2].radius = 0.1F;
    for (const PathLight& light : lights) {
        const LitTriangles lit = find_lit_triangles(tree, light, &accelerator);
        const LitTriangles all = find_lit_triangles(tree, light, nullptr);
        REQUIRE(lit.size() == tree.blocks.size());
        size_t wrong = 0;
        for (uint32_t t = 0; t < tree.size(); ++t) {
            wrong += is_lit(lit, t) == (centre_of(t).x > 0.0F) && is_lit(all, t) ? 0 : 1;
        }
        CHECK(wrong == 0);
    }
    // Both sides of a surface reflect: light from below reaches all of it.
    const LitTriangles below = find_lit_triangles(tree, point_light_at(Vec3(0.1F, -1.0F, 0.0F)), &accelerator);
    for (uint32_t t = 0; t < tree.size(); ++t) REQUIRE(is_lit(below, t));

    PathLight spot = point_light_at(Vec3(0.0F, 2.0F, 0.0F));
    spot.axis = Vec3(0.0F, -1.0F, 0.0F);
    spot.cos_cone = std::cos(0.2F);
    const LitTriangles in_cone = find_lit_triangles(tree, spot, nullptr);
    size_t dark = 0, wrong = 0;
    for (uint32_t t = 0; t < tree.size(); ++t) {
        bool touched = spot.shines_on(Vec3d(centre_of(t)));
        for (size_t corner = 0; corner < 3; ++corner) {
            touched = touched || spot.shines_on(Vec3d(tree.position(t, corner)));
        }
        dark += is_lit(in_cone, t) ? 0 : 1;
        wrong += touched && !is_lit(in_cone, t) ? 1 : 0;
        // Nor is much more lit than the cone: two triangles' width at most.
        wrong += is_lit(in_cone, t) && glm::length(centre_of(t)) > 2.0F * std::tan(0.2F) + 0.2F ? 1 : 0;
    }
    CHECK(wrong == 0);
    CHECK(dark > tree.size() / 2);
    CHECK(find_lit_triangles(build_reflector_tree({}, {}), spot, &accelerator).empty());
}

// The path-cut search where its input is extreme: roughness, coinciding points, caustic folds, degenerate and
// non-finite input, scales, threads and budgets.
#include <doctest/doctest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "tests/pathcut_chains.h"
#include "tests/pathcut_searches.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

constexpr double pi_double = 3.14159265358979323846;
constexpr float nan_float = std::numeric_limits<float>::quiet_NaN();
constexpr float inf_float = std::numeric_limits<float>::infinity();
constexpr std::array<Selection, 2> both_selections{Selection::local_minima, Selection::every_triangle};

std::vector<Vec3> random_receivers(Generator& generator, size_t count, double extent) {
    std::vector<Vec3> receivers;
    for (size_t i = 0; i < count; ++i) receivers.emplace_back(random_point(generator, extent));
    return receivers;
}

/// A sphere above a bumpy plane: `triangles` each.
Search sphere_and_plane(int triangles, float alpha, size_t receivers) {
    Generator generator(5);
    Search search;
    add_shape(search.reflectors, sphere_shape(Vec3d(0.1, 0.6, 0.0), 0.4), triangles, 2.0, alpha);
    add_shape(search.reflectors, bumpy_plane_shape(Vec3d(0.0), 1.0, 0.03, 1.5), triangles, 1.0, alpha);
    search.receivers = random_receivers(generator, receivers, 1.5);
    search.lights = {point_light_at(Vec3(0.7F, 2.1F, 0.4F))};
    return search;
}

/// Runs the search for all combinations of one and two reflections and both selections.
template <class Check>
void for_all_modes(Search search, const Check& check) {
    for (const Selection selection : both_selections) {
        for (const int bounces : {1, 2}) {
            CAPTURE(bounces);
            CAPTURE(static_cast<int>(selection));
            search.options.selection = selection;
            search.options.bounces = bounces;
            check(run_checked(search));
        }
    }
}
void run_all_modes(const Search& search) {
    for_all_modes(search, [](const SearchResult&) {});
}

/// Receiver and triangles of each path, and where it meets the first reflector.
using Tuples = std::map<std::array<uint32_t, 3>, Vec3d>;

Tuples tuples_of(const SearchResult& result, size_t receivers, int length) {
    Tuples tuples;
    for (uint32_t receiver = 0; receiver < receivers; ++receiver) {
        for (const RepresentativePath& path : result.paths.of_receiver(receiver)) {
            if (path.length != length) continue;
            const auto v = result.paths.vertices_of(path);
            tuples[{receiver, v[0].triangle, length == 2 ? v[1].triangle : 0}] = result.position(v[0]);
        }
    }
    return tuples;
}

Tuples brute_force(const ReflectorTree& tree, const Search& search, int length, Selection selection) {
    SolverOptions thorough;
    thorough.rejection_margin = INFINITY;
    Tuples tuples;
    const auto count = static_cast<uint32_t>(tree.size());
    for (uint32_t receiver = 0; receiver < search.receivers.size(); ++receiver) {
        for (uint32_t a = 0; a < count; ++a) {
            for (uint32_t b = 0; b < (length == 2 ? count : 1); ++b) {
                if (length == 2 && a == b) continue;
                const std::array<uint32_t, 2> triangles{a, b};
                const TupleSolution solution =
                    solve_tuple(tree, std::span(triangles).first(static_cast<size_t>(length)),
                                search.receivers[receiver], search.lights[0], selection, thorough);
                if (solution.accepted) tuples[{receiver, a, b}] = solution.path.vertices[0].position;
            }
        }
    }
    return tuples;
}

/// How many paths of one set the other lacks. A minimum on an edge belongs to all triangles there: if `anywhere`, one
/// in the same place will do.
size_t count_missing(const Tuples& from, const Tuples& in, bool anywhere) {
    return static_cast<size_t>(std::count_if(from.begin(), from.end(), [&](const auto& path) {
        if (in.contains(path.first)) return false;
        return !anywhere || std::none_of(in.begin(), in.end(), [&](const auto& other) {
            return other.first[0] == path.first[0] && glm::length(other.second - path.second) < 1e-4;
        });
    }));
}

void compare_with_brute_force(Search search, int length) {
    search.options.bounces = length;
    search.options.merge_distance = -1.0;
    for (const Selection selection : both_selections) {
        CAPTURE(static_cast<int>(selection));
        search.options.selection = selection;
        const SearchResult result = run_checked(search);
        // Pairs of local minima go by beams, which the search's own tests measure.
        if (length == 2 && selection == Selection::local_minima) continue;
        const Tuples found = tuples_of(result, search.receivers.size(), length);
        const Tuples expected = brute_force(result.tree, search, length, selection);
        CHECK(count_missing(found, expected, false) == 0);
        CHECK(count_missing(expected, found, selection == Selection::local_minima) == 0);
        CHECK((!expected.empty() || length == 2));
    }
}

}  // namespace

TEST_CASE("the narrowest and the widest acceptance agree with brute force") {
    for (const float alpha : {1e-4F, 1.0F}) {
        CAPTURE(alpha);
        for (const int length : {1, 2}) {
            CAPTURE(length);
            const int triangles = length == 1 ? 300 : 40;
            const size_t receivers = length == 1 ? 6 : 2;
            Search sphere = sphere_and_plane(triangles, alpha, receivers), plane = sphere;
            const auto half = static_cast<std::ptrdiff_t>(sphere.reflectors.size() / 2);
            sphere.reflectors.erase(sphere.reflectors.begin() + half, sphere.reflectors.end());
            plane.reflectors.erase(plane.reflectors.begin(), plane.reflectors.begin() + half);
            // Two reflections need something to reflect between: the convex sphere alone has none that is not relaxed.
            compare_with_brute_force(length == 1 ? sphere : sphere_and_plane(triangles, alpha, receivers), length);
            compare_with_brute_force(plane, length);
        }
    }
}

TEST_CASE("roughness outside of its range has defined results") {
    for (const float alpha : {0.0F, -1.0F, 10.0F, 1e30F, inf_float, nan_float}) {
        CAPTURE(alpha);
        run_all_modes(sphere_and_plane(24, alpha, 2));
    }
}

TEST_CASE("lights and receivers on the reflectors") {
    Search search = sphere_and_plane(30, 0.01F, 2);
    const ReflectorTriangle& t = search.reflectors[search.reflectors.size() - 7];
    const Vec3 centroid = (t.positions[0] + t.positions[1] + t.positions[2]) / 3.0F;
    const Vec3 middle = (t.positions[0] + t.positions[1]) / 2.0F;
    const std::vector<Vec3> places{t.positions[0], t.positions[1], middle, centroid};
    SUBCASE("light") {
        for (const Vec3& place : places) {
            search.lights = {point_light_at(place)};
            run_all_modes(search);
            search.lights[0].radius = 0.01F;
            run_all_modes(search);
            search.lights[0] = point_light_at(place);
            search.lights[0].axis = Vec3(0.0F, 1.0F, 0.0F);
            search.lights[0].cos_cone = 0.5F;
            run_all_modes(search);
        }
    }
    SUBCASE("receiver") {
        search.receivers.insert(search.receivers.end(), places.begin(), places.end());
        for (size_t i = 0; i < search.reflectors.size(); i += 9) {
            search.receivers.push_back(search.reflectors[i].positions[1]);
        }
        run_all_modes(search);
    }
    SUBCASE("both, at the same place") {
        for (const Vec3& place : places) {
            search.receivers = {place, places[0]};
            search.lights = {point_light_at(place)};
            run_all_modes(search);
        }
    }
    SUBCASE("within a sphere light") {
        search.lights = {point_light_at(centroid)};
        search.lights[0].radius = 0.5F;
        search.receivers.push_back(centroid);
        run_all_modes(search);
    }
}

TEST_CASE("a receiver at the light sees it where the surface faces both") {
    Search search;
    const Vec3d centre(0.1, 0.2, 0.3);
    add_shape(search.reflectors, sphere_shape(centre, 0.5), 4000, 2.0, 0.001F);
    const Vec3d out = glm::normalize(Vec3d(1.0, 0.7, 0.4));
    search.receivers = {Vec3(centre + out * 2.0)};
    search.lights = {point_light_at(search.receivers[0])};
    const SearchResult result = run_checked(search);
    size_t facing = 0;
    for (const RepresentativePath& path : result.paths.of_receiver(0)) {
        const Vec3d at = result.position(result.paths.vertices_of(path)[0]);
        facing += path.exact && glm::length(at - (centre + out * 0.5)) < 1e-3 ? 1 : 0;
    }
    CHECK(facing == 1);
}

TEST_CASE("solutions merge at the caustic of a circle") {
    // Parallel light along x in a half circle of radius 1: its rays cross the axis at 1 / (2 cos angle). Beyond the
    // cusp at 1/2 three of them meet, before it one.
    Search search;
    add_shape(search.reflectors, cylinder_shape(Vec3d(0.0), 1.0, 0.4, -1.4, 1.4), 401, 21, 1e-4F);
    search.lights = {light_from(Vec3(-1.0F, 0.0F, 0.0F))};
    const float z = 0.0137F;
    search.receivers = {Vec3(0.48F, 0.0F, z), Vec3(0.52F, 0.0F, z), Vec3(0.5F, 0.0F, z)};
    // On the caustic itself, and around it by as little as float allows.
    for (const double angle : {0.2, 0.5, 0.9}) {
        const Vec3d on_fold(std::cos(angle) * (1.0 + 2.0 * std::sin(angle) * std::sin(angle)) / 2.0,
                            std::pow(std::sin(angle), 3.0), double{z});
        for (const double offset : {0.0, 1e-7, -1e-7, 1e-5, -1e-5, 0.002, -0.002}) {
            search.receivers.emplace_back(on_fold + Vec3d(std::sin(2.0 * angle), -std::cos(2.0 * angle), 0.0) * offset);
        }
    }
    search.options.merge_distance = 0.01;
    const SearchResult result = run_checked(search);
    CHECK(result.count_exact(0) == 1);
    CHECK(result.count_exact(1) == 3);
    const auto at_cusp = result.count_exact(2);
    CHECK(at_cusp >= 1);
    CHECK(at_cusp <= 3);
    size_t mirrored = 0;
    for (const RepresentativePath& path : result.paths.of_receiver(1)) mirrored += path.exact && path.mirrored ? 1 : 0;
    CHECK((mirrored == 1 || mirrored == 2));  // The one in the middle is on the other side of the fold.
    for (size_t fold = 0; fold < 3; ++fold) {
        const size_t first = 3 + 7 * fold;
        std::string counts;
        for (size_t i = 0; i < 7; ++i) counts += std::to_string(result.count_exact(first + i)) + " ";
        CAPTURE(counts);
        // Two solutions, at least, on one side of the fold, and two less on the other.
        const size_t one = result.count_exact(first + 5), other = result.count_exact(first + 6);
        CHECK(std::max(one, other) == std::min(one, other) + 2);
        for (size_t i = 0; i < 5; ++i) {
            CHECK(result.count_exact(first + i) <= std::max(one, other));
            CHECK(!result.paths.of_receiver(first + i).empty());
        }
    }
}

TEST_CASE("grazing incidence on a flat mirror") {
    Search search;
    add_shape(search.reflectors, flat_shape(Vec3d(-1.0, 0.0, -1.0), Vec3d(0.0, 0.0, 2.0), Vec3d(2.0, 0.0, 0.0)), 8, 8,
              0.001F);
    search.receivers = {Vec3(1.5F, 0.4F, 0.0F), Vec3(1.5F, 0.0F, 0.01F), Vec3(0.013F, 0.0F, 0.017F),
                        Vec3(0.013F, 0.5F, 0.017F)};
    for (const float x : {-2.0F, -1.0F, -0.513F, -0.5F}) {
        search.lights = {point_light_at(Vec3(x, 0.0F, 0.021F))};
        run_all_modes(search);
        search.options = {};
        CHECK(run_checked(search).count_exact() == 0);
    }
    search.lights = {light_from(Vec3(1.0F, 0.0F, 0.0F))};
    run_all_modes(search);
    // Just above the plane there is one path, to where the receiver's mirror image is in line.
    for (const float height : {1e-1F, 1e-2F, 1e-3F, 1e-4F}) {
        CAPTURE(height);
        search.lights = {point_light_at(Vec3(-2.0F, height, 0.021F))};
        search.receivers = {Vec3(2.01F, height, 0.033F)};
        const SearchResult result = run_checked(search);
        CHECK(result.count_exact() == 1);
        for (const RepresentativePath& path : result.paths.paths) {
            if (!path.exact) continue;
            CHECK(glm::length(result.position(result.paths.vertices_of(path)[0]) - Vec3d(0.005, 0.0, 0.027)) < 1e-4);
        }
    }
}

TEST_CASE("triangles without area and with numbers that are none are left out") {
    const Search clean = sphere_and_plane(40, 0.01F, 3);
    Search search = clean;
    const ReflectorTriangle good = clean.reflectors[clean.reflectors.size() / 2];
    const auto add = [&](const auto& change) {
        ReflectorTriangle t = good;
        t.id = {99, 0};
        change(t);
        search.reflectors.push_back(t);
        search.reflectors.insert(search.reflectors.begin() + 5, t);
    };
    add([](ReflectorTriangle& t) { t.positions[1] = t.positions[0]; });
    add([](ReflectorTriangle& t) { t.positions = {Vec3(0.5F), Vec3(0.5F), Vec3(0.5F)}; });
    add([](ReflectorTriangle& t) { t.positions = {Vec3(0.0F), Vec3(1.0F), Vec3(2.0F)}; });
    for (const float bad : {nan_float, inf_float, -inf_float}) {
        for (int k = 0; k < 3; ++k) {
            for (size_t corner = 0; corner < 3; ++corner) {
                add([&](ReflectorTriangle& t) { t.positions[corner][k] = bad; });
                add([&](ReflectorTriangle& t) { t.normals[corner][k] = bad; });
            }
        }
    }
    add([](ReflectorTriangle& t) { t.positions = {Vec3(inf_float), Vec3(-inf_float), Vec3(0.0F)}; });
    CHECK(build_reflector_tree(search.reflectors, {}).size() == build_reflector_tree(clean.reflectors, {}).size());
    Search tested = clean;
    for_all_modes(search, [&](const SearchResult& result) {
        for (const TriangleId& id : result.tree.ids) REQUIRE(id.object != 99);
    });
    search.options.bounces = tested.options.bounces = 2;
    const SearchResult with = run_checked(search), without = run_checked(tested);
    for (size_t i = 0; i < clean.receivers.size(); ++i) CHECK(same_paths(with.paths, i, without.paths, i));
}

TEST_CASE("needles, far-away corners and disturbed normals") {
    const Search clean = sphere_and_plane(30, 0.01F, 3);
    Search search = clean;
    SUBCASE("needles of aspect 1e6") {
        add_shape(search.reflectors, flat_shape(Vec3d(-1.0, 0.3, -1.0), Vec3d(2.0, 0.1, 0.0), Vec3d(0.0, 0.0, 2e-5)), 2,
                  10, 0.01F);
        search.reflectors.front().positions[0] =
            search.reflectors.front().positions[1] +
            (search.reflectors.front().positions[2] - search.reflectors.front().positions[1]) * 0.4F + Vec3(1e-7F);
    }
    SUBCASE("corners far away") {
        search.reflectors[3].positions[1] = Vec3(1e15F, 1.0F, -1e14F);
        search.reflectors[9].positions[0] = Vec3(-1e18F, 1e18F, 0.0F);
    }
    SUBCASE("corners at the end of float's range") {
        search.reflectors[3].positions[1] = Vec3(1e38F, 1.0F, -1e38F);
        search.reflectors[9].positions[0] = Vec3(-1e38F, 1e38F, 0.0F);
        search.reflectors[11].positions = {Vec3(1e38F, 0.0F, 0.0F), Vec3(0.0F, 1e38F, 0.0F), Vec3(0.0F, 0.0F, 1e38F)};
    }
    SUBCASE("some zero normals") {
        for (size_t i = 0; i < search.reflectors.size(); i += 3) search.reflectors[i].normals[i % 2] = Vec3(0.0F);
    }
    SUBCASE("some normals turned over") {
        for (size_t i = 0; i < search.reflectors.size(); i += 3) search.reflectors[i].normals[i % 2] *= -1.0F;
    }
    SUBCASE("normals in the triangles' planes") {
        for (ReflectorTriangle& t : search.reflectors) {
            t.normals.fill(glm::normalize(t.positions[1] - t.positions[0] + Vec3(1e-9F)));
        }
    }
    SUBCASE("huge and tiny normals") {
        for (size_t i = 0; i < search.reflectors.size(); ++i) {
            search.reflectors[i].normals[i % 3] *= i % 2 == 0 ? 1e30F : 1e-30F;
        }
    }
    run_all_modes(search);
}

TEST_CASE("normals' sides and lengths do not matter, duplicates merge") {
    Search search = sphere_and_plane(200, 0.001F, 12);
    search.options.bounces = 2;
    const SearchResult expected = run_checked(search);
    REQUIRE(expected.count_exact() > 12);
    SUBCASE("all normals opposite to the geometry") {
        for (ReflectorTriangle& t : search.reflectors) {
            for (Vec3& n : t.normals) n = -n;
        }
        const SearchResult result = run_checked(search);
        for (size_t i = 0; i < 12; ++i) CHECK(result.count_exact(i) == expected.count_exact(i));
    }
    SUBCASE("normals of other lengths") {
        for (ReflectorTriangle& t : search.reflectors) {
            for (Vec3& n : t.normals) n *= 16.0F;
        }
        const SearchResult result = run_checked(search);
        for (size_t i = 0; i < 12; ++i) CHECK(result.count_exact(i) == expected.count_exact(i));
    }
    SUBCASE("every triangle twice") {
        const std::vector<ReflectorTriangle> once = search.reflectors;
        search.reflectors.insert(search.reflectors.end(), once.begin(), once.end());
        const SearchResult result = run_checked(search);
        for (size_t i = 0; i < 12; ++i) CHECK(result.count_exact(i) == expected.count_exact(i));
        CHECK(result.paths.statistics.merged > expected.paths.statistics.merged);
    }
    SUBCASE("all normals zero: the flat triangles'") {
        for (ReflectorTriangle& t : search.reflectors) t.normals.fill(Vec3(0.0F));
        const SearchResult zero = run_checked(search);
        for (ReflectorTriangle& t : search.reflectors) {
            t.normals.fill(glm::cross(t.positions[1] - t.positions[0], t.positions[2] - t.positions[0]));
        }
        const SearchResult flat = run_checked(search);
        for (size_t i = 0; i < 12; ++i) CHECK(zero.count_exact(i) == flat.count_exact(i));
    }
}

TEST_CASE("receivers that are no points have no paths, and do not disturb the others") {
    const Search clean = sphere_and_plane(100, 0.01F, 30);
    Search search = clean;
    std::vector<size_t> place;
    search.receivers.clear();
    for (size_t i = 0; i < clean.receivers.size(); ++i) {
        Vec3 bad(0.0F);
        bad[static_cast<int>(i % 3)] = i % 2 == 0 ? nan_float : i % 4 == 1 ? inf_float : -inf_float;
        search.receivers.push_back(bad);
        place.push_back(search.receivers.size());
        search.receivers.push_back(clean.receivers[i]);
    }
    search.receivers.push_back(Vec3(nan_float));
    search.options.bounces = 2;
    Search only = clean;
    only.options.bounces = 2;
    const SearchResult with = run_checked(search), without = run_checked(only);
    REQUIRE(without.paths.paths.size() > 30);
    CHECK(with.paths.paths.size() == without.paths.paths.size());
    for (size_t i = 0; i < place.size(); ++i) CHECK(same_paths(with.paths, place[i], without.paths, i));
    search.receivers = {Vec3(nan_float), Vec3(inf_float, 0.0F, 0.0F)};
    run_all_modes(search);
    search.receivers = {Vec3(3e38F, 3e38F, 3e38F), Vec3(1e30F, 0.0F, 0.0F), Vec3(-1e19F, 1e-30F, 0.0F), Vec3(1e-38F)};
    run_all_modes(search);
}

TEST_CASE("nothing to search") {
    const Search full = sphere_and_plane(40, 0.01F, 3);
    Search search = full;
    const auto is_empty = [](const SearchResult& result) { CHECK(result.paths.paths.empty()); };
    search.reflectors.clear();
    for_all_modes(search, is_empty);
    search = full;
    search.receivers.clear();
    for_all_modes(search, is_empty);
    search = full;
    search.lights.clear();
    for_all_modes(search, is_empty);
    search.reflectors.clear();
    search.receivers.clear();
    for_all_modes(search, is_empty);
    // A light that shines nowhere near.
    search = full;
    search.lights[0].axis = Vec3(0.0F, 1.0F, 0.0F);
    search.lights[0].cos_cone = 0.99F;
    for_all_modes(search, is_empty);
}

TEST_CASE("lights that are no points") {
    Search search = sphere_and_plane(30, 0.01F, 2);
    for (const float bad : {nan_float, inf_float, 1e25F}) {
        CAPTURE(bad);
        search.lights = {point_light_at(Vec3(0.0F, bad, 0.0F)), point_light_at(Vec3(0.7F, 2.1F, 0.4F))};
        run_all_modes(search);
    }
}

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
    Search base = sphere_and_plane(600, 0.001F, 50);
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
        Search base = sphere_and_plane(1200, 0.001F, 50);
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

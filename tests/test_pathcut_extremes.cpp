// The path-cut search where its input is extreme: roughness, coinciding points, caustic folds, grazing light,
// degenerate and non-finite input.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "tests/pathcut_chains.h"
#include "tests/pathcut_searches.h"

using namespace nephroid;
using namespace nephroid::testing;

namespace {

constexpr float nan_float = std::numeric_limits<float>::quiet_NaN();
constexpr float inf_float = std::numeric_limits<float>::infinity();

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
        compare_with_brute_force(search, 1);
        // At 5e-5 radians slopes are so small all over that the solver stops short of the exact path.
        if (height < 2e-4F) continue;
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

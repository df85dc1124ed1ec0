// The look-up of cached points, against brute force.
#include <doctest/doctest.h>

#include <array>
#include <random>

#include "guiding/cached_points.h"

using namespace nephroid;

namespace {

/// Points of a floor, both sides of a thin wall and a ball on the floor, which all touch.
std::vector<CachedPoint> mixed_points(int count, float scale, float reach) {
    std::mt19937 generator(7);
    std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
    std::vector<CachedPoint> points;
    for (int i = 0; i < count; ++i) {
        CachedPoint point;
        const float u = uniform(generator), v = uniform(generator);
        if (i % 4 == 0) {
            point.normal = glm::normalize(Vec3(u, v, uniform(generator)));
            point.position = 0.3F * point.normal + Vec3(0.0F, 0.3F, 0.0F);
        } else if (i % 4 == 1) {
            point.normal = Vec3(0.0F, 0.0F, i % 8 == 1 ? 1.0F : -1.0F);
            point.position = Vec3(u, 0.5F + 0.5F * v, 1e-4F * point.normal.z);
        } else {
            point.position = Vec3(u, 0.0F, v);
        }
        point.position *= scale;
        point.reach = reach * scale;
        points.push_back(point);
    }
    return points;
}

}  // namespace

TEST_CASE("the point found is of a similar normal, in reach, and the nearest or nearly so") {
    for (const float scale : {1e-4F, 1.0F, 1e5F}) {
        const std::vector<CachedPoint> points = mixed_points(4000, scale, 0.2F);
        const CachedPointLookup lookup(points);
        int found = 0, nearest = 0, missed = 0;
        double excess = 0.0;
        for (const CachedPoint& query : mixed_points(7000, scale, 0.0F)) {
            float best = 1e30F;
            for (const CachedPoint& point : points) {
                if (glm::dot(point.normal, query.normal) <= similar_normal_cosine) continue;
                best = std::min(best, glm::length(point.position - query.position));
            }
            std::array<FoundPoint, 3> near;
            const size_t count = lookup.find(query.position, query.normal, near);
            for (size_t k = 1; k < count; ++k) {
                CHECK(near[k].squared_distance >= near[k - 1].squared_distance);
                CHECK(near[k].index != near[k - 1].index);
            }
            if (count == 0) {
                missed += best <= 0.2F * scale ? 1 : 0;
                continue;
            }
            const CachedPoint& point = points[near[0].index];
            const float distance = glm::length(point.position - query.position);
            CHECK(glm::dot(point.normal, query.normal) > similar_normal_cosine);
            CHECK(distance <= point.reach * 1.0001F);
            ++found;
            nearest += distance <= best ? 1 : 0;
            excess += distance - best;
        }
        INFO("scale ", scale, ": found ", found, ", nearest ", nearest, ", missed ", missed);
        CHECK(found > 6500);
        CHECK(nearest > found * 8 / 10);
        CHECK(missed < found / 100);
        CHECK(excess / found < 0.01 * double{scale});
    }
}

TEST_CASE("no points, one point, equal points") {
    std::array<FoundPoint, 3> found;
    const Vec3 up(0.0F, 1.0F, 0.0F);
    CHECK(CachedPointLookup().find(Vec3(0.0F), up, found) == 0);
    CHECK(CachedPointLookup(std::vector<CachedPoint>()).find(Vec3(0.0F), up, found) == 0);
    CachedPoint point;
    point.reach = 1.0F;
    for (const size_t count : {size_t{1}, size_t{2}, size_t{100}}) {
        const CachedPointLookup lookup(std::vector<CachedPoint>(count, point));
        CHECK(lookup.find(Vec3(0.5F, 0.0F, 0.0F), up, found) == std::min<size_t>(count, 3));
        CHECK(lookup.find(Vec3(1.5F, 0.0F, 0.0F), up, found) == 0);
        CHECK(lookup.find(Vec3(0.5F, 0.0F, 0.0F), -up, found) == 0);
    }
}

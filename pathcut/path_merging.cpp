#include "pathcut/path_merging.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <tuple>

namespace nephroid {

namespace {

using Ranks = std::vector<uint32_t>;

bool same_group(const FoundPath& a, const FoundPath& b) {
    return a.receiver == b.receiver && a.path.light == b.path.light && a.path.length == b.path.length;
}

bool is_better(const FoundPath& a, const FoundPath& b) {
    return a.path.exact != b.path.exact ? a.path.exact : a.path.residual < b.path.residual;
}

float reach(const FoundPath& path, size_t vertex, double distance) {
    return static_cast<float>(distance) * path.edges[vertex];
}

bool is_same_path(const FoundPath& a, const FoundPath& b, double distance) {
    if (a.path.exact && b.path.exact && a.path.mirrored != b.path.mirrored) return false;
    constexpr auto ratio = static_cast<float>(crease_ratio);
    if (a.steepness > ratio * b.steepness || b.steepness > ratio * a.steepness) return false;
    for (size_t i = 0; i < a.path.length; ++i) {
        const float limit = std::min(reach(a, i, distance), reach(b, i, distance));
        if (glm::length(a.positions[i] - b.positions[i]) > limit) return false;
    }
    return true;
}

/// Marks the paths to drop of one group. Candidates are neighbours along x of their first vertices, within reach.
void mark_duplicates(std::span<const FoundPath> group, double distance, std::span<uint8_t> drop) {
    Ranks along_x(group.size()), by_quality(group.size()), place(group.size());
    std::iota(along_x.begin(), along_x.end(), 0U);
    by_quality = along_x;
    const auto x_of = [&](uint32_t i) { return group[i].positions[0].x; };
    std::stable_sort(along_x.begin(), along_x.end(), [&](uint32_t a, uint32_t b) { return x_of(a) < x_of(b); });
    std::stable_sort(by_quality.begin(), by_quality.end(),
                     [&](uint32_t a, uint32_t b) { return is_better(group[a], group[b]); });
    for (uint32_t i = 0; i < along_x.size(); ++i) place[along_x[i]] = i;

    std::vector<uint8_t> kept(group.size(), 0);
    const auto duplicates = [&](uint32_t candidate, int step) {
        const float limit = reach(group[candidate], 0, distance);
        for (int64_t i = int64_t{place[candidate]} + step; i >= 0 && i < static_cast<int64_t>(along_x.size());
             i += step) {
            const uint32_t other = along_x[static_cast<size_t>(i)];
            if (std::abs(x_of(other) - x_of(candidate)) > limit) return false;
            if (kept[other] != 0 && is_same_path(group[other], group[candidate], distance)) return true;
        }
        return false;
    };
    for (const uint32_t candidate : by_quality) {
        drop[candidate] = duplicates(candidate, 1) || duplicates(candidate, -1) ? 1 : 0;
        kept[candidate] = drop[candidate] == 0 ? 1 : 0;
    }
}

}  // namespace

FoundPath make_found_path(const ReflectorTree& reflectors, std::span<const uint32_t> triangles,
                          const SpecularPath& path) {
    FoundPath result;
    result.path.residual = static_cast<float>(path.residual);
    result.path.length = static_cast<uint8_t>(triangles.size());
    result.path.exact = path.status == SolveStatus::exact;
    result.path.mirrored = determinant(path.jacobian, static_cast<int>(triangles.size())) < 0.0;
    if (triangles.size() == 1) {
        result.steepness = static_cast<float>(std::abs(glm::determinant(path.jacobian.by_own[0])));
    }
    for (size_t i = 0; i < triangles.size(); ++i) {
        const PathVertex& vertex = path.vertices[i];
        result.vertices[i] = {triangles[i], static_cast<float>(vertex.barycentrics.x),
                              static_cast<float>(vertex.barycentrics.y)};
        result.positions[i] = Vec3(vertex.position);
        result.edges[i] = static_cast<float>(reflectors.patch(triangles[i]).size);
    }
    return result;
}

bool comes_before(const FoundPath& a, const FoundPath& b) {
    const auto key = [](const FoundPath& f) { return std::tuple(f.receiver, f.path.light, f.path.length); };
    if (key(a) != key(b)) return key(a) < key(b);
    for (size_t i = 0; i < a.path.length; ++i) {
        if (a.vertices[i].triangle != b.vertices[i].triangle) return a.vertices[i].triangle < b.vertices[i].triangle;
    }
    return false;
}

size_t merge_paths(std::vector<FoundPath>& paths, double distance) {
    std::vector<uint8_t> drop(paths.size(), 0);
    for (size_t begin = 0, end = 0; begin < paths.size(); begin = end) {
        while (end < paths.size() && same_group(paths[begin], paths[end])) ++end;
        if (end - begin == 1) continue;
        mark_duplicates(std::span(paths).subspan(begin, end - begin), distance,
                        std::span(drop).subspan(begin, end - begin));
    }
    size_t kept = 0;
    for (size_t i = 0; i < paths.size(); ++i) {
        if (drop[i] == 0) paths[kept++] = paths[i];
    }
    const size_t dropped = paths.size() - kept;
    paths.resize(kept);
    return dropped;
}

}  // namespace nephroid

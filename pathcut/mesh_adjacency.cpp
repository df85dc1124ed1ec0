#include "pathcut/mesh_adjacency.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <bit>
#include <numeric>

namespace nephroid {

namespace {

/// A corner's position and normal, comparable bit by bit.
struct Corner {
    std::array<uint32_t, 6> bits;
    uint32_t corner;  ///< 3 triangle + corner.
};

uint32_t bits_of(float x) {
    return std::bit_cast<uint32_t>(x + 0.0F);  // Negative zero becomes zero.
}

/// Equal numbers for equal corners.
std::vector<uint32_t> weld(std::span<const ReflectorTriangle> triangles) {
    std::vector<Corner> corners(3 * triangles.size());
    for (size_t i = 0; i < corners.size(); ++i) {
        const Vec3 &p = triangles[i / 3].positions[i % 3], &n = triangles[i / 3].normals[i % 3];
        corners[i] = {{bits_of(p.x), bits_of(p.y), bits_of(p.z), bits_of(n.x), bits_of(n.y), bits_of(n.z)},
                      static_cast<uint32_t>(i)};
    }
    tbb::parallel_sort(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
        return a.bits < b.bits || (a.bits == b.bits && a.corner < b.corner);
    });
    std::vector<uint32_t> welded(corners.size());
    uint32_t number = 0;
    for (size_t i = 0; i < corners.size(); ++i) {
        if (i > 0 && corners[i].bits != corners[i - 1].bits) ++number;
        welded[corners[i].corner] = number;
    }
    return welded;
}

struct Edge {
    uint32_t low, high;  ///< Welded corners.
    uint32_t edge;       ///< 3 triangle + edge.
    bool ascending;      ///< Runs from low to high.
};

}  // namespace

std::vector<Twins> find_neighbours(std::span<const ReflectorTriangle> triangles) {
    const std::vector<uint32_t> welded = weld(triangles);
    std::vector<Edge> edges(welded.size());
    for (size_t i = 0; i < edges.size(); ++i) {
        const uint32_t a = welded[i], b = welded[i % 3 == 2 ? i - 2 : i + 1];
        edges[i] = {std::min(a, b), std::max(a, b), static_cast<uint32_t>(i), a < b};
    }
    const auto same = [](const Edge& a, const Edge& b) { return a.low == b.low && a.high == b.high; };
    tbb::parallel_sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
        if (a.low != b.low) return a.low < b.low;
        return a.high != b.high ? a.high < b.high : a.edge < b.edge;
    });
    std::vector<Twins> neighbours(triangles.size(), {no_half_edge, no_half_edge, no_half_edge});
    for (size_t i = 0; i + 1 < edges.size(); ++i) {
        if (!same(edges[i], edges[i + 1]) || edges[i].ascending == edges[i + 1].ascending) continue;
        if ((i > 0 && same(edges[i - 1], edges[i])) || (i + 2 < edges.size() && same(edges[i + 1], edges[i + 2]))) {
            continue;
        }
        const uint32_t a = edges[i].edge, b = edges[i + 1].edge;
        neighbours[a / 3][a % 3] = make_half_edge(b / 3, b % 3);
        neighbours[b / 3][b % 3] = make_half_edge(a / 3, a % 3);
    }
    return neighbours;
}

}  // namespace nephroid

#include "pathcut/reflector_tree.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "pathcut/acceptance.h"
#include "pathcut/bounding.h"
#include "pathcut/mesh_adjacency.h"

namespace nephroid {

namespace {

bool is_finite(const ReflectorTriangle& t) {
    const Vec3 sum = t.positions[0] + t.positions[1] + t.positions[2] + t.normals[0] + t.normals[1] + t.normals[2];
    return std::isfinite(sum.x + sum.y + sum.z);
}

/// Makes all normals unit, zero ones the geometric normal; false for a triangle that reflects nothing.
bool prepare(ReflectorTriangle& t) {
    if (!is_finite(t)) return false;
    const SurfacePatch patch = make_surface_patch({t.positions[0], t.positions[1], t.positions[2]},
                                                  {t.normals[0], t.normals[1], t.normals[2]});
    for (size_t i = 0; i < 3; ++i) t.normals[i] = Vec3(patch.normals[i]);
    return !patch.degenerate;
}

std::vector<ReflectorTriangle> usable_triangles(const std::vector<ReflectorTriangle>& given) {
    std::vector<ReflectorTriangle> triangles = given;
    std::vector<uint8_t> usable(given.size());
    tbb::parallel_for(tbb::blocked_range<size_t>(0, given.size(), 1024), [&](const tbb::blocked_range<size_t>& range) {
        for (size_t i = range.begin(); i != range.end(); ++i) usable[i] = prepare(triangles[i]) ? 1 : 0;
    });
    size_t count = 0;
    for (size_t i = 0; i < triangles.size(); ++i) {
        if (usable[i] != 0) triangles[count++] = triangles[i];
    }
    triangles.resize(count);
    return triangles;
}

/// Positions in units of the casters' size, so that crossing a reflector counts as much as turning its normal about.
std::vector<OrderKey> order_keys(const std::vector<ReflectorTriangle>& triangles) {
    Bounds bounds;
    for (const ReflectorTriangle& t : triangles) {
        for (const Vec3& p : t.positions) bounds.extend(p);
    }
    const float size = std::max(max_component(bounds.max - bounds.min), std::numeric_limits<float>::min());
    constexpr float position_weight = 2.0F;
    std::vector<OrderKey> keys;
    keys.reserve(triangles.size());
    for (const ReflectorTriangle& t : triangles) {
        const Vec3 p =
            (t.positions[0] + t.positions[1] + t.positions[2] - 3.0F * bounds.min) * (position_weight / (3.0F * size));
        const Vec3 n = (t.normals[0] + t.normals[1] + t.normals[2]) / 3.0F;
        keys.push_back({p.x, p.y, p.z, n.x, n.y, n.z});
    }
    return keys;
}

void store_triangle(TriangleBlock& block, size_t lane, const ReflectorTriangle& t, const AcceptanceOptions& options) {
    for (size_t corner = 0; corner < 3; ++corner) {
        for (size_t k = 0; k < 3; ++k) {
            block.positions[corner][k][lane] = t.positions[corner][static_cast<int>(k)];
            block.normals[corner][k][lane] = t.normals[corner][static_cast<int>(k)];
        }
    }
    block.alpha[lane] = t.alpha;
    block.max_slope[lane] = static_cast<float>(options.max_slope(double{t.alpha}));
}

}  // namespace

double AcceptanceOptions::max_slope(double alpha) const {
    const double a = std::max(alpha, smallest_alpha);
    if (!(alpha_multiple > 0.0)) return acceptance_slope(a, epsilon);
    return std::min(alpha_multiple * a, std::max(enough_slope, 2.0 * a));
}

SurfacePatch ReflectorTree::patch(uint32_t triangle) const {
    const TriangleBlock& block = blocks[triangle / block_size];
    const size_t lane = triangle % block_size;
    std::array<Vec3d, 3> p, n;
    for (size_t corner = 0; corner < 3; ++corner) {
        for (size_t k = 0; k < 3; ++k) {
            p[corner][static_cast<int>(k)] = double{block.positions[corner][k][lane]};
            n[corner][static_cast<int>(k)] = double{block.normals[corner][k][lane]};
        }
    }
    return make_surface_patch(p, n);
}

size_t ReflectorTree::bytes() const {
    return tree.bytes() + blocks.size() * sizeof(TriangleBlock) + ids.size() * sizeof(TriangleId) +
           twins.size() * sizeof(Twins);
}

std::vector<ReflectorTriangle> reflector_triangles(const Scene& scene, const CasterReport& casters) {
    std::vector<ReflectorTriangle> triangles;
    for (size_t i = 0; i < scene.objects.size(); ++i) {
        if (casters.is_caster[i] == 0) continue;
        const Object& object = scene.objects[i];
        const Mesh& mesh = scene.meshes[static_cast<size_t>(object.mesh)];
        const float roughness = scene.materials[static_cast<size_t>(mesh.material)].roughness;
        const Mat3 normal_to_world = glm::transpose(glm::inverse(Mat3(object.to_world)));
        for (size_t primitive = 0; primitive < mesh.triangles.size(); ++primitive) {
            ReflectorTriangle t;
            t.alpha = roughness * roughness;
            t.id = {static_cast<uint32_t>(i), static_cast<uint32_t>(primitive)};
            for (size_t corner = 0; corner < 3; ++corner) {
                const uint32_t vertex = mesh.triangles[primitive][corner];
                t.positions[corner] = Vec3(object.to_world * Vec4(mesh.positions[vertex], 1.0F));
                t.normals[corner] =
                    mesh.normals.empty() ? Vec3(0.0F) : glm::normalize(normal_to_world * mesh.normals[vertex]);
            }
            triangles.push_back(t);
        }
    }
    return triangles;
}

ReflectorTree build_reflector_tree(const std::vector<ReflectorTriangle>& given, const AcceptanceOptions& options) {
    const std::vector<ReflectorTriangle> usable = usable_triangles(given);
    std::vector<ReflectorTriangle> triangles;
    triangles.reserve(usable.size());
    for (const uint32_t i : compact_order(order_keys(usable))) triangles.push_back(usable[i]);

    ReflectorTree result;
    result.blocks.resize((triangles.size() + block_size - 1) / block_size);
    result.ids.resize(triangles.size());
    std::vector<Vec3> positions(3 * triangles.size()), normals(3 * triangles.size());
    for (size_t i = 0; i < triangles.size(); ++i) {
        store_triangle(result.blocks[i / block_size], i % block_size, triangles[i], options);
        result.ids[i] = triangles[i].id;
        std::copy_n(triangles[i].positions.begin(), 3, positions.begin() + static_cast<std::ptrdiff_t>(3 * i));
        std::copy_n(triangles[i].normals.begin(), 3, normals.begin() + static_cast<std::ptrdiff_t>(3 * i));
    }
    result.tree = build_block_tree<MirrorBlock>(triangles.size(), [&](size_t begin, size_t end) {
        float steepest = 0.0F;
        for (size_t i = begin; i < end; ++i) steepest = std::max(steepest, result.max_slope(static_cast<uint32_t>(i)));
        const size_t first = 3 * begin, count = 3 * (end - begin);
        return bound_mirror(std::span<const Vec3>(positions).subspan(first, count),
                            std::span<const Vec3>(normals).subspan(first, count), std::atan(double{steepest}));
    });
    float smallest = infinity, largest = 0.0F;
    for (uint32_t i = 0; i < triangles.size(); ++i) {
        smallest = std::min(smallest, result.max_slope(i));
        largest = std::max(largest, result.max_slope(i));
    }
    result.smallest_spread = static_cast<float>(std::sin(std::atan(double{smallest})));
    result.widest_deviation = static_cast<float>(2.0 * std::sin(std::atan(double{largest})));
    result.twins = find_neighbours(triangles);
    return result;
}

}  // namespace nephroid

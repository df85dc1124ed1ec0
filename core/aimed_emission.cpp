#include "core/aimed_emission.h"

#include <algorithm>
#include <cmath>

#include "core/frame.h"
#include "core/warp.h"

namespace nephroid {

namespace {

/// World-space vertices of casters that lie close together.
struct Group {
    Bounds bounds;
    std::vector<Vec3> vertices;
};

Group group_of_object(const Scene& scene, const Object& object) {
    Group group;
    for (const Vec3& p : scene.meshes[static_cast<size_t>(object.mesh)].positions) {
        group.vertices.push_back(Vec3(object.to_world * Vec4(p, 1.0F)));
        group.bounds.extend(group.vertices.back());
    }
    return group;
}

Vec3 centre_of(const Bounds& bounds) {
    return 0.5F * (bounds.min + bounds.max);
}

/// Splits groups [begin, end) by the median of their centres along the widest axis until `most` remain, then joins
/// each part.
void join(std::vector<Group>& groups, size_t begin, size_t end, size_t most, std::vector<Group>& joined) {
    if (begin == end) return;
    if (most == 1 || end - begin == 1) {
        Group all;
        for (size_t i = begin; i < end; ++i) {
            all.bounds.extend(groups[i].bounds.min);
            all.bounds.extend(groups[i].bounds.max);
            all.vertices.insert(all.vertices.end(), groups[i].vertices.begin(), groups[i].vertices.end());
        }
        joined.push_back(std::move(all));
        return;
    }
    Bounds centres;
    for (size_t i = begin; i < end; ++i) centres.extend(centre_of(groups[i].bounds));
    const Vec3 extent = centres.max - centres.min;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : (extent.y >= extent.z ? 1 : 2);
    const auto first = groups.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = groups.begin() + static_cast<std::ptrdiff_t>(end);
    std::stable_sort(first, last, [axis](const Group& a, const Group& b) {
        return centre_of(a.bounds)[axis] < centre_of(b.bounds)[axis];
    });
    const size_t middle = begin + (end - begin) / 2;
    join(groups, begin, middle, most / 2, joined);
    join(groups, middle, end, most - most / 2, joined);
}

std::vector<Group> caster_groups(const Scene& scene, const CasterReport& casters) {
    std::vector<Group> groups;
    for (size_t i = 0; i < scene.objects.size(); ++i) {
        if (casters.is_caster[i] != 0) groups.push_back(group_of_object(scene, scene.objects[i]));
    }
    std::erase_if(groups, [](const Group& group) { return group.bounds.empty(); });
    std::vector<Group> joined;
    join(groups, 0, groups.size(), AimedEmission::most_groups, joined);
    return joined;
}

/// Cones and discs about vertices are narrower than those about boxes, but every light looks at every vertex: with many
/// lights, boxes have to do.
void limit_work(std::vector<Group>& groups, size_t lights) {
    constexpr size_t most_tests = size_t{1} << 28U;
    size_t vertices = 0;
    for (const Group& group : groups) vertices += group.vertices.size();
    if (vertices * lights <= most_tests) return;
    for (Group& group : groups) {
        const Bounds& box = group.bounds;
        group.vertices.clear();
        for (int corner = 0; corner < 8; ++corner) {
            group.vertices.emplace_back((corner & 1) != 0 ? box.max.x : box.min.x,
                                        (corner & 2) != 0 ? box.max.y : box.min.y,
                                        (corner & 4) != 0 ? box.max.z : box.min.z);
        }
    }
}

/// 1 - cos of the angle between unit vectors, by the chord: exact where the angle is small.
float one_minus_cos(const Vec3& a, const Vec3& b) {
    const Vec3 chord = a - b;
    return 0.5F * glm::dot(chord, chord);
}

/// Bounds grow by this share, so that rounding leaves no vertex outside.
constexpr float margin = 1.0F + 1e-4F;

}  // namespace

AimedEmission::AimedEmission(const Scene& scene, const CasterReport& casters) : targets_(scene.lights.size()) {
    if (casters.small_lights.empty()) return;
    std::vector<Group> groups = caster_groups(scene, casters);
    limit_work(groups, casters.small_lights.size());
    for (const uint32_t light_index : casters.small_lights) {
        const PunctualLight& light = scene.lights[light_index];
        Targets& targets = targets_[light_index];
        for (const Group& group : groups) {
            const Vec3 centre = centre_of(group.bounds);
            float size = 0.0F;
            if (light.kind == LightKind::directional) {
                targets.across = light.direction;
                for (const Vec3& p : group.vertices) {
                    const Vec3 offset = glm::cross(p - centre, light.direction);
                    size = std::max(size, glm::dot(offset, offset));
                }
                add_region(targets, {centre, size * margin * margin});
                continue;
            }
            const Vec3 to_centre = centre - light.position;
            const float distance = glm::length(to_centre);
            const Vec3 axis = distance > 0.0F ? to_centre / distance : Vec3(0.0F, 1.0F, 0.0F);
            for (const Vec3& p : group.vertices) {
                const Vec3 to_vertex = p - light.position;
                const float length = glm::length(to_vertex);
                size = std::max(size, length > 0.0F ? one_minus_cos(axis, to_vertex / length) : 2.0F);
            }
            // A cone of less than a right angle is convex: with the vertices it holds the triangles. Others are taken
            // as the whole sphere.
            add_region(targets, {axis, size * margin * margin < 1.0F ? size * margin * margin : 2.0F});
        }
    }
}

void AimedEmission::add_region(Targets& targets, const Region& region) {
    if (!(region.size > 0.0F) || !std::isfinite(region.size)) return;
    targets.regions.push_back(region);
    targets.total_size += region.size;
}

const AimedEmission::Region& AimedEmission::choose(const Targets& targets, float u) {
    float rest = u * targets.total_size;
    size_t i = 0;
    while (i + 1 < targets.regions.size() && rest >= targets.regions[i].size) rest -= targets.regions[i++].size;
    return targets.regions[i];
}

Vec3 AimedEmission::sample_direction(uint32_t light, float u_choice, Vec2 u) const {
    const Region& cone = choose(targets_[light], u_choice);
    const Frame<float> frame = make_frame(to_triple(cone.centre));
    return to_vec3(frame.to_world(square_to_uniform_cone(u.x, u.y, cone.size)));
}

float AimedEmission::direction_pdf(uint32_t light, const Vec3& direction) const {
    const Targets& targets = targets_[light];
    float count = 0.0F;
    for (const Region& cone : targets.regions) {
        // Everything is inside a whole sphere, whatever rounding says.
        count += one_minus_cos(cone.centre, direction) <= cone.size || cone.size >= 2.0F ? 1.0F : 0.0F;
    }
    return count * 0.5F * inv_pi / targets.total_size;
}

Vec3 AimedEmission::sample_point(uint32_t light, float u_choice, Vec2 u) const {
    const Targets& targets = targets_[light];
    const Region& disc = choose(targets, u_choice);
    const Frame<float> frame = make_frame(to_triple(targets.across));
    float sine, cosine;
    sincos_turn(u.y, sine, cosine);
    const float radius = std::sqrt(u.x * disc.size);
    return disc.centre + to_vec3(frame.to_world({radius * cosine, radius * sine, 0.0F}));
}

float AimedEmission::point_pdf(uint32_t light, const Vec3& point) const {
    const Targets& targets = targets_[light];
    float count = 0.0F;
    for (const Region& disc : targets.regions) {
        const Vec3 offset = glm::cross(point - disc.centre, targets.across);
        count += glm::dot(offset, offset) <= disc.size ? 1.0F : 0.0F;
    }
    return count * inv_pi / targets.total_size;
}

}  // namespace nephroid

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

/// Of a point from the line through `centre` along the unit vector `axis`.
float squared_distance(const Vec3& axis, const Vec3& centre, const Vec3& point) {
    const Vec3 across = glm::cross(point - centre, axis);
    return glm::dot(across, across);
}

/// Bounds grow by this share, so that rounding leaves no vertex outside.
constexpr float margin = 1.0F + 1e-4F;

/// Cells of a region's grid.
constexpr uint32_t cells_across = 32, cells_of_region = cells_across * cells_across;

/// Share of the rays that are spread evenly whatever was learned.
constexpr float spread_share = 0.25F;

uint32_t cell_at(const Vec2& place) {
    const auto index = [](float x) {
        return static_cast<uint32_t>(std::clamp(x * cells_across, 0.0F, static_cast<float>(cells_across - 1)));
    };
    return index(place.y) * cells_across + index(place.x);
}

/// In turns, to 2e-6 (Abramowitz and Stegun 1964, 4.4.49); NaN on the axis.
float rough_turn_of(const Triple<float>& local) {
    const float x = std::abs(local.x), y = std::abs(local.y);
    const float r = std::min(x, y) / std::max(x, y), r2 = r * r;
    const float angle =
        r * (0.9998660F + r2 * (-0.3302995F + r2 * (0.1801410F + r2 * (-0.0851330F + r2 * 0.0208351F))));
    const float eighth = angle * (0.5F * inv_pi);
    const float quarter = x >= y ? eighth : 0.25F - eighth;
    const float half = local.x >= 0.0F ? quarter : 0.5F - quarter;
    return local.y >= 0.0F ? half : 1.0F - half;
}

/// In turns, [0, 1]: so far from the cells' bounds that the cell is the right one, or exact.
float turn_of(const Triple<float>& local) {
    constexpr float least_distance = 1e-3F;  // In cells.
    const float rough = rough_turn_of(local), cells = rough * cells_across;
    if (std::abs(cells - std::floor(cells) - 0.5F) < 0.5F - least_distance) return rough;
    const float turn = std::atan2(local.y, local.x) * (0.5F * inv_pi);
    return turn < 0.0F ? turn + 1.0F : turn;
}

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
                targets.is_directional = true;
                for (const Vec3& p : group.vertices) {
                    size = std::max(size, squared_distance(light.direction, centre, p));
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

const AimedEmission::Region& AimedEmission::choose(const Targets& targets, float u_choice, Vec2& u) {
    if (targets.cells.size() > 0) {
        const auto cell = static_cast<uint32_t>(targets.cells.sample(u_choice));
        const uint32_t column = cell % cells_across, row = cell % cells_of_region / cells_across;
        u = (Vec2(static_cast<float>(column), static_cast<float>(row)) + u) / static_cast<float>(cells_across);
        return targets.regions[cell / cells_of_region];
    }
    float rest = u_choice * targets.total_size;
    size_t i = 0;
    while (i + 1 < targets.regions.size() && rest >= targets.regions[i].size) rest -= targets.regions[i++].size;
    return targets.regions[i];
}

bool AimedEmission::holds(const Targets& targets, const Region& region, const Vec3& to) {
    if (targets.is_directional) return squared_distance(targets.across, region.centre, to) <= region.size;
    // Everything is inside a whole sphere, whatever rounding says.
    return one_minus_cos(region.centre, to) <= region.size || region.size >= 2.0F;
}

Vec2 AimedEmission::place_in(const Targets& targets, const Region& region, const Vec3& to) {
    if (targets.is_directional) {
        const Triple<float> local = make_frame(to_triple(targets.across)).to_local(to_triple(to - region.centre));
        return {squared_distance(targets.across, region.centre, to) / region.size, turn_of(local)};
    }
    const Triple<float> local = make_frame(to_triple(region.centre)).to_local(to_triple(to));
    return {one_minus_cos(region.centre, to) / region.size, turn_of(local)};
}

float AimedEmission::density(const Targets& targets, const Vec3& to) {
    const bool has_learned = targets.cells.size() > 0;
    float sum = 0.0F;
    for (size_t i = 0; i < targets.regions.size(); ++i) {
        const Region& region = targets.regions[i];
        if (!holds(targets, region, to)) continue;
        if (!has_learned) {
            sum += 1.0F / targets.total_size;
            continue;
        }
        const size_t cell = i * cells_of_region + cell_at(place_in(targets, region, to));
        sum += targets.cells.probability(cell) * cells_of_region / region.size;
    }
    return sum;
}

void AimedEmission::learn(std::span<const AimedRay> rays) {
    std::vector<std::vector<double>> worth(targets_.size());
    for (const AimedRay& ray : rays) {
        if (!aims(ray.light) || !(ray.weight > 0.0F) || !std::isfinite(ray.weight)) continue;
        const Targets& targets = targets_[ray.light];
        worth[ray.light].resize(targets.regions.size() * cells_of_region);
        for (size_t i = 0; i < targets.regions.size(); ++i) {
            const Region& region = targets.regions[i];
            if (!holds(targets, region, ray.to)) continue;
            const uint32_t cell = cell_at(place_in(targets, region, ray.to));
            worth[ray.light][i * cells_of_region + cell] += double{ray.weight};
        }
    }
    for (size_t light = 0; light < targets_.size(); ++light) {
        double total = 0.0;
        for (const double cell : worth[light]) total += cell;
        if (!(total > 0.0)) continue;
        Targets& targets = targets_[light];
        std::vector<float> weights;
        for (size_t i = 0; i < worth[light].size(); ++i) {
            const float even = targets.regions[i / cells_of_region].size / (targets.total_size * cells_of_region);
            weights.push_back((1.0F - spread_share) * static_cast<float>(worth[light][i] / total) +
                              spread_share * even);
        }
        targets.cells = AliasTable(weights);
    }
}

Vec3 AimedEmission::sample_direction(uint32_t light, float u_choice, Vec2 u) const {
    const Region& cone = choose(targets_[light], u_choice, u);
    const Frame<float> frame = make_frame(to_triple(cone.centre));
    return to_vec3(frame.to_world(square_to_uniform_cone(u.x, u.y, cone.size)));
}

float AimedEmission::direction_pdf(uint32_t light, const Vec3& direction) const {
    return 0.5F * inv_pi * density(targets_[light], direction);
}

Vec3 AimedEmission::sample_point(uint32_t light, float u_choice, Vec2 u) const {
    const Targets& targets = targets_[light];
    const Region& disc = choose(targets, u_choice, u);
    const Frame<float> frame = make_frame(to_triple(targets.across));
    float sine, cosine;
    sincos_turn(u.y, sine, cosine);
    const float radius = std::sqrt(u.x * disc.size);
    return disc.centre + to_vec3(frame.to_world({radius * cosine, radius * sine, 0.0F}));
}

float AimedEmission::point_pdf(uint32_t light, const Vec3& point) const {
    return inv_pi * density(targets_[light], point);
}

}  // namespace nephroid

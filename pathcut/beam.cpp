#include "pathcut/beam.h"

#include <cmath>

#include "pathcut/bounding.h"

namespace nephroid {

namespace {

Vec3 reflect(const Vec3& wi, const Vec3& n) {
    return n * (2.0F * glm::dot(wi, n)) - wi;
}

/// Where a beam starts, where it goes, and how far light in between corners may go beyond that.
struct Outgoing {
    std::array<Vec3, 3> positions;
    std::array<Vec3, 3> directions;
    double margin = 0.0;  ///< Radians.
};

Outgoing outgoing_of(const ReflectorTree& reflectors, const Beam& beam) {
    Outgoing out;
    Vec3 mean_direction(0.0F), mean_wi(0.0F), mean_normal(0.0F);
    for (size_t corner = 0; corner < 3; ++corner) {
        const Vec3 n = reflectors.normal(beam.triangle, corner);
        out.positions[corner] = reflectors.position(beam.triangle, corner);
        out.directions[corner] = reflect(beam.wi[corner], n);
        mean_direction += out.directions[corner];
        mean_wi += beam.wi[corner];
        mean_normal += n;
    }
    const Vec3 centre = reflect(glm::normalize(mean_wi), glm::normalize(mean_normal));
    const double bend = angle_between(Vec3d(centre), Vec3d(mean_direction));
    double extent = 0.0;
    for (const Vec3& d : out.directions) extent = std::max(extent, angle_between(Vec3d(d), Vec3d(centre)));
    out.margin = 2.0 * bend + 0.05 * extent + 2.0 * double{beam.error};
    if (beam.leaving_angle >= 0.0F) {
        out.directions.fill(beam.leaving);
        out.margin = double{beam.leaving_angle};
    }
    // Directions that cancel have no mean: nothing is known.
    if (!std::isfinite(out.margin)) out.margin = 4.0;
    return out;
}

void store_beam(BeamBlock& block, size_t lane, const Beam& beam) {
    for (size_t corner = 0; corner < 3; ++corner) {
        for (size_t k = 0; k < 3; ++k) block.wi[corner][k][lane] = beam.wi[corner][static_cast<int>(k)];
        for (size_t k = 0; k < 2; ++k) {
            block.parent_weights[corner][k][lane] = beam.parent_weights[corner][static_cast<int>(k)];
        }
    }
    block.error[lane] = beam.error;
    block.parent_error[lane] = beam.parent_error;
    block.triangle[lane] = beam.triangle;
    block.parent[lane] = beam.parent;
}

/// Positions in units of the casters' size, and mean directions of leaving.
std::vector<OrderKey> order_keys(const ReflectorTree& reflectors, const std::vector<Outgoing>& outgoing) {
    const MirrorBlock& top = reflectors.tree.levels.back()[0];
    Bounds bounds;
    for (size_t lane = 0; lane < reflectors.tree.child_count(reflectors.tree.root()); ++lane) {
        bounds.extend(to_vec3(extract(top, lane).points.centre));
    }
    const float size = std::max(max_component(bounds.max - bounds.min), std::numeric_limits<float>::min());
    std::vector<OrderKey> keys;
    keys.reserve(outgoing.size());
    for (const Outgoing& out : outgoing) {
        const Vec3 p =
            (out.positions[0] + out.positions[1] + out.positions[2] - 3.0F * bounds.min) * (2.0F / (3.0F * size));
        const Vec3 d = (out.directions[0] + out.directions[1] + out.directions[2]) / 3.0F;
        keys.push_back({p.x, p.y, p.z, d.x, d.y, d.z});
    }
    return keys;
}

}  // namespace

BeamSet make_beam_set(const ReflectorTree& reflectors, const std::vector<Beam>& beams) {
    std::vector<Outgoing> outgoing;
    outgoing.reserve(beams.size());
    for (const Beam& beam : beams) outgoing.push_back(outgoing_of(reflectors, beam));
    const std::vector<uint32_t> order = compact_order(order_keys(reflectors, outgoing));

    BeamSet set;
    set.blocks.resize((beams.size() + block_size - 1) / block_size);
    std::vector<Vec3> positions, directions;
    positions.reserve(3 * beams.size());
    directions.reserve(3 * beams.size());
    for (size_t i = 0; i < order.size(); ++i) {
        store_beam(set.blocks[i / block_size], i % block_size, beams[order[i]]);
        const Outgoing& out = outgoing[order[i]];
        positions.insert(positions.end(), out.positions.begin(), out.positions.end());
        directions.insert(directions.end(), out.directions.begin(), out.directions.end());
    }
    set.tree = build_block_tree<MirrorBlock>(beams.size(), [&](size_t begin, size_t end) {
        double margin = 0.0;
        for (size_t i = begin; i < end; ++i) margin = std::max(margin, outgoing[order[i]].margin);
        const size_t first = 3 * begin, count = 3 * (end - begin);
        return bound_mirror(std::span<const Vec3>(positions).subspan(first, count),
                            std::span<const Vec3>(directions).subspan(first, count), margin);
    });
    return set;
}

std::vector<Beam> direct_beams(const ReflectorTree& reflectors, const PathLight& light, const LitTriangles& lit) {
    std::vector<Beam> beams;
    for (uint32_t triangle = 0; triangle < reflectors.size(); ++triangle) {
        if ((lit[triangle / block_size] >> (triangle % block_size) & 1U) == 0) continue;
        Beam beam;
        beam.triangle = triangle;
        const MirrorBound<float> bound = reflectors.bound(triangle);
        const Leg<float> to_light = make_leg(bound.points, light);
        for (size_t corner = 0; corner < 3; ++corner) {
            beam.wi[corner] = to_vec3(direction_to(light, to_triple(reflectors.position(triangle, corner))));
        }
        if (light.radius > 0.0F) beam.error = light.radius * to_light.inverse_distance;
        beams.push_back(beam);
    }
    return beams;
}

TriangleLanes<FloatV> load_triangles(const ReflectorTree& reflectors, const BeamBlock& block, size_t first,
                                     const FloatV::mask_type& exists) {
    const UintV triangle(block.triangle.data() + first, stdx::vector_aligned);
    TriangleLanes<FloatV> t;
    for (uint32_t corner = 0; corner < 3; ++corner) {
        const CornerLanes c = gather_corner(reflectors, triangle, UintV(corner), exists);
        t.positions[corner] = c.position;
        t.normals[corner] = c.normal;
    }
    constexpr auto max_slope = static_cast<uint32_t>(offsetof(TriangleBlock, max_slope) / sizeof(TriangleBlock::Lanes));
    t.max_slope = gather_field(reflectors, triangle, UintV(max_slope), exists);
    return t;
}

IncomingDirections<FloatV> load_directions(const BeamBlock& block, size_t first) {
    IncomingDirections<FloatV> wi;
    for (size_t corner = 0; corner < 3; ++corner) {
        wi.at_corner[corner] = load_lanes<FloatV>(block.wi[corner][0], block.wi[corner][1], block.wi[corner][2], first);
    }
    wi.at_centroid = normalized(wi.at_corner[0] + wi.at_corner[1] + wi.at_corner[2]);
    return wi;
}

}  // namespace nephroid

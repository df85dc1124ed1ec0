// Beams: light that a chain of triangles reflects, as it leaves the last of them.
//
// For two and more reflections a search of all tuples repeats for every receiver what does not depend on it: how light
// gets from reflector to reflector. A beam is the result of that for one chain of triangles: the directions from which
// light reaches the corners of the chain's last triangle, linear in between. To a receiver a beam is a triangle with a
// light of its own, and paths of k reflections are found as paths of one are. Beams of k reflections are made from
// those of k - 1 by taking the corners of all triangles for receivers.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "pathcut/lit_triangles.h"
#include "pathcut/slope_triangle.h"

namespace nephroid {

inline constexpr uint32_t no_beam = std::numeric_limits<uint32_t>::max();

/// One beam, while it is made.
struct Beam {
    uint32_t triangle = 0;      ///< The chain's last triangle, on the viewer's side.
    uint32_t parent = no_beam;  ///< The beam that lights it, in the previous set; none if the light itself does.
    std::array<Vec3, 3> wi;     ///< Unit directions of incoming light at the corners.
    std::array<Vec2, 3>
        parent_weights{};         ///< Where on the parent's triangle it comes from: barycentric; may be outside.
    float error = 0.0F;           ///< Of wi, as a slope.
    float parent_error = 0.0F;    ///< Of parent_weights, beyond what is linear between the corners.
    Vec3 leaving{0.0F};           ///< Unit: axis of a cone that the light leaves in,
    float leaving_angle = -1.0F;  ///< and half its opening, radians; negative where wi and its error say more.
};

/// Sixteen beams, field by field.
struct alignas(simd_alignment) BeamBlock {
    using Lanes = std::array<float, block_size>;
    std::array<std::array<Lanes, 3>, 3> wi{};              ///< [corner][coordinate]
    std::array<std::array<Lanes, 2>, 3> parent_weights{};  ///< [corner][coordinate]
    Lanes error{};
    Lanes parent_error{};
    alignas(simd_alignment) std::array<uint32_t, block_size> triangle{};
    alignas(simd_alignment) std::array<uint32_t, block_size> parent{};
};

/// All beams of chains of one length, from one light.
struct BeamSet {
    /// Bounds of where the beams start and of the directions in which specular light leaves: oriented cones.
    BlockTree<MirrorBlock> tree;
    std::vector<BeamBlock> blocks;

    size_t size() const { return tree.size; }
    uint32_t triangle(uint32_t beam) const { return blocks[beam / block_size].triangle[beam % block_size]; }
    uint32_t parent(uint32_t beam) const { return blocks[beam / block_size].parent[beam % block_size]; }
    size_t bytes() const { return tree.bytes() + blocks.size() * sizeof(BeamBlock); }
};

/// Orders the beams and builds the tree over them.
BeamSet make_beam_set(const ReflectorTree& reflectors, const std::vector<Beam>& beams);

/// One beam for each lit triangle.
std::vector<Beam> direct_beams(const ReflectorTree& reflectors, const PathLight& light, const LitTriangles& lit);

/// True where no specular light of a cone of beams leaves along the leg, though it may leave up to `deviation` (a
/// chord) off.
template <class F>
MaskOf<F> misses(const MirrorBound<F>& beams, const Leg<F>& to_viewer, const F& deviation) {
    const Triple<F> across = cross(to_viewer.direction, beams.axis);
    const F reach =
        to_viewer.chord + deviation + F(leg::slack) + dot(to_viewer.direction, beams.axis) * beams.sin_spread;
    return beams.cos_spread > F(0.0F) &&
           (reach < F(0.0F) || dot(across, across) * (beams.cos_spread * beams.cos_spread) > reach * reach);
}

/// The triangles of sixteen beams, or as many as a vector holds, gathered from the reflectors.
TriangleLanes<FloatV> load_triangles(const ReflectorTree& reflectors, const BeamBlock& block, size_t first,
                                     const FloatV::mask_type& exists);
IncomingDirections<FloatV> load_directions(const BeamBlock& block, size_t first);

}  // namespace nephroid

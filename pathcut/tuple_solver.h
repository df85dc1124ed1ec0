// From a receiver, a tuple of triangles and a light to the representative path through them, or to none.
#pragma once

#include <span>

#include "pathcut/representative_path.h"

namespace nephroid {

enum class Selection : uint8_t {
    local_minima,  ///< One path for each exact solution and each smallest slope that no neighbouring triangle betters.
    every_triangle,  ///< One path for every accepted tuple of triangles, as in the paper.
};

struct TupleSolution {
    SpecularPath path;
    bool accepted = false;
    bool continued = false;      ///< Not accepted, because slopes fall further in a neighbouring triangle:
    size_t next_vertex = 0;      ///< that of this vertex,
    uint32_t next_triangle = 0;  ///< and this is it.
};

/// The chain that the solver sees. Small sphere lights are points at their centre; acceptance is widened by the half of
/// their angular size that reaches the half vector.
struct TuplePatches {
    PerVertex<SurfacePatch> patches;
    SpecularChain chain;
};
void make_tuple_chain(const ReflectorTree& reflectors, std::span<const uint32_t> triangles, const Vec3& receiver,
                      const PathLight& light, TuplePatches& result);

/// `triangles` from the receiver's side to the light's; at most max_chain_length.
TupleSolution solve_tuple(const ReflectorTree& reflectors, std::span<const uint32_t> triangles, const Vec3& receiver,
                          const PathLight& light, Selection selection, const SolverOptions& options = {});

/// Whether slopes of one reflection clearly fall from a triangle's corner into the inside of another triangle around
/// it: so that no smallest slope is there or next to it.
bool falls_away_at_corner(const ReflectorTree& reflectors, uint32_t triangle, uint32_t corner, const Vec3& receiver,
                          const PathLight& light);

/// Follows slopes that fall on into neighbouring triangles, in at most `max_steps` steps, and changes `triangles`
/// accordingly: for starts that are only known to be near a solution. `work` grows by all solves.
TupleSolution walk_to_minimum(const ReflectorTree& reflectors, std::span<uint32_t> triangles, const Vec3& receiver,
                              const PathLight& light, const SolverOptions& options, int max_steps, SolverWork& work);

}  // namespace nephroid

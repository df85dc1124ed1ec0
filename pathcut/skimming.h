// Reflections between neighbouring triangles of one surface: light that skims along it.
//
// Bounds of directions say nothing between triangles that touch. But a triangle sees its neighbours only as far above
// its own plane as the surface bends, and mirrors directions of one elevation into directions of the same: |wi.n| and
// |wo.n| differ by at most |wi - wo| sin(theta_h) for a half vector theta_h off the normal.
#pragma once

#include "pathcut/cut_test.h"
#include "pathcut/reflector_tree.h"

namespace nephroid {

/// True where a triangle and one next to it cannot be consecutive on a path, for all that the elevations at the first
/// say. `mirror` bounds the first, `outer` is the leg from it to the vertex or end on the other side.
///
/// The other's elevation is taken from corners and doubled, which is no proof; the search's tests against brute force
/// cover it.
bool only_skims(const ReflectorTree& reflectors, uint32_t triangle, const MirrorBound<float>& mirror,
                const Leg<float>& outer, uint32_t other);

}  // namespace nephroid

// Reflections between neighbouring triangles of one surface: light that skims along it.
//
// Bounds of directions say nothing between triangles that touch. But a triangle sees its neighbours only as far above
// its own plane as the surface bends, and mirrors directions of one elevation into directions of the same: |wi.n| and
// |wo.n| differ by at most |wi - wo| sin(theta_h) for a half vector theta_h off the normal.
#pragma once

#include "pathcut/cut_test.h"
#include "pathcut/reflector_tree.h"

namespace nephroid {

/// True if a triangle and another one next to it cannot be consecutive on a path, for all that the elevations at the
/// first say. `outer` is the leg from it to the vertex or end on the other side; `sin_acceptance` the sine of the
/// largest accepted theta_h, zero where the first reflects exactly.
///
/// The other's elevation is taken from corners and doubled, which is no proof; the search's tests against brute force
/// cover it.
bool only_skims(const ReflectorTree& reflectors, uint32_t triangle, const Leg<float>& outer, float sin_acceptance,
                uint32_t other);

}  // namespace nephroid

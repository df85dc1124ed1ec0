// Which reflecting triangles a light shines on at all.
#pragma once

#include <cstdint>
#include <vector>

#include "accel/accelerator.h"
#include "pathcut/path_light.h"
#include "pathcut/reflector_tree.h"

namespace nephroid {

/// Sixteen triangles a word, in the reflector tree's order; bit i is triangle i of the block.
using LitTriangles = std::vector<uint16_t>;

/// Without an accelerator nothing is in the way. With one, a triangle counts as dark if neither its centroid nor the
/// points next to its corners see the light (its centre, if it is a sphere): light that gets through a smaller gap is
/// not looked for. Parallel.
LitTriangles find_lit_triangles(const ReflectorTree& reflectors, const PathLight& light,
                                const Accelerator* accelerator);

}  // namespace nephroid

// Which triangles continue each other smoothly across an edge.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "pathcut/reflector_tree.h"

namespace nephroid {

/// For each triangle the twins of its edges: of the only other triangle whose edge has the same positions and normals,
/// bit by bit, and runs the other way; else no_half_edge. Vertices need not be shared.
std::vector<Twins> find_neighbours(std::span<const ReflectorTriangle> triangles);

}  // namespace nephroid

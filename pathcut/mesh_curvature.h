// Normals and curvatures from positions alone, for meshes whose file has no normals or useless ones.
#pragma once

#include <vector>

#include "core/mesh.h"
#include "pathcut/curvature.h"

namespace nephroid {

/// Normal, principal curvatures and directions at each vertex of the mesh, in the space and unit of its positions, by
/// fitting a polynomial of up to fourth degree to the vertices around it. Vertices at the same position get the same.
///
/// Normals point to the side that the triangles' winding says. Where neighbours are too few, lie on a line, or bend
/// away by more than 60 degrees, the normal is the mean of the adjacent triangles' normals, weighted by area, with
/// curvature zero; +Z where these cancel or there are none. Positions that are not finite count as having none. Edges
/// sharper than that are kept apart, others are rounded off by about three edge lengths. Uses all threads of the
/// current TBB arena.
std::vector<PrincipalCurvatures> fit_mesh_curvature(const Mesh& mesh);

}  // namespace nephroid

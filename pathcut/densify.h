// Finer triangles on request: the path-cut solver searches triangle by triangle and wants them small against the
// distances of its paths.
#pragma once

#include "core/scene.h"

namespace nephroid {

/// Most triangles that `densify_objects` may add to a scene.
inline constexpr size_t max_added_triangles = 50'000'000;

/// Splits the meshes of all objects with `Object::densify` > 0 until no edge is longer than that in world space; sets
/// Mesh::coarse_triangles of those that change. Edges that floats are too coarse to shorten stay.
///
/// The surface stays where it is (up to the rounding of new positions to float). Attributes are those of the coarse
/// triangle at each new vertex, normals and tangents normalised. Triangles that meet in an edge get the same vertices
/// there, also across seams, between primitives of one node, and where more than two meet: whether an edge is split,
/// and where, depends on the positions of its ends only.
///
/// A mesh stays shared by all objects that use it: it is split where any of them wishes, the others see it too.
///
/// Throws Error(invalid_input), which names the object, where more than max_added_triangles would come up; wishes that
/// are far beyond it fail before any memory is taken.
void densify_objects(Scene& scene);

}  // namespace nephroid

// Whether anything stands in the way of a path that a search has found.
#pragma once

#include "pathcut/path_light.h"
#include "pathcut/path_merging.h"
#include "pathcut/visibility.h"

namespace nephroid {

/// first_blocked_segment of the whole path, from the receiver to the light.
bool is_visible(const Accelerator& accelerator, const ReflectorTree& reflectors, const SurfacePoint& receiver,
                const FoundPath& path, const PathLight& light);

}  // namespace nephroid

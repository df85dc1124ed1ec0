// Chains that one evaluation shows to be far from specular: most of what a conservative search leaves over.
#pragma once

#include "pathcut/specular_chain.h"

namespace nephroid {

/// Whether no path through the triangles is near to acceptable: the slopes, taken as linear about `centre` (the path
/// through the triangles' centres), stay further above a vertex's max_slope than `margin` times their change over the
/// triangles. The margin stands for what is not linear; false if `centre` is not valid.
bool is_hopeless(const SpecularChain& chain, const ChainEvaluation& centre, double margin);

}  // namespace nephroid

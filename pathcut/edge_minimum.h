// The smallest slope on the border of a triangle, for one reflection.
//
// Where the specular point lies outside of a triangle, the point inside with the smallest error (Fig. 4, Li et al.
// 2022) is generally on an edge. On an edge that is a search in one variable, which can be made robust.
#pragma once

#include "pathcut/slope_descent.h"

namespace nephroid {

/// The state of the smallest merit on the three edges of the patch of a chain of length 1; of infinite merit if no
/// admissible point was found. Does not allocate.
ChainState minimum_on_edges(const SpecularChain& chain, SolverWork& work);

}  // namespace nephroid

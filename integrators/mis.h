// Multiple importance sampling.
#pragma once

#include "core/simd.h"

namespace nephroid {

/// Power heuristic with exponent 2 for one sample of density `pdf` against one other strategy. pdf > 0; an infinite or
/// overflowing ratio gives 0 or 1, never NaN.
template <class F>
F power_heuristic(const F& pdf, const F& other_pdf) {
    const F ratio = other_pdf / pdf;
    return F(1.0F) / (F(1.0F) + ratio * ratio);
}

}  // namespace nephroid

// A slow, obvious path tracer: one recursion, one ray at a time, scalar code. The twin of integrators/path in tests.
#pragma once

#include "integrators/integrator.h"

namespace nephroid::testing {

/// One independent estimate of pixel (x, y); `index` numbers the estimates.
Rgb reference_sample(const RenderContext& context, int x, int y, uint32_t index);

}  // namespace nephroid::testing

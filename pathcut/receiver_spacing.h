// How far apart receivers are.
#pragma once

#include <span>
#include <vector>

#include "pathcut/receiver_sampler.h"

namespace nephroid {

/// Of each receiver: the distance to its `neighbours`-th nearest one on the same side of the same object (normals
/// alike: merge_normal_cosine), metres. Zero where that is not among the 4 `neighbours` nearest of all.
std::vector<float> receiver_spacing(std::span<const Receiver> receivers, uint32_t neighbours);

}  // namespace nephroid

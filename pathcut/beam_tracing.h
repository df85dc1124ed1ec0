// Beams of two and more reflections, made from those of one less: see beam.h.
//
// Most are linear: light for a triangle's corners comes from where the image of the beam's triangle says. Where that
// says too little, points of the triangle are solved for (beam_sampler.h).
#pragma once

#include <functional>

#include "accel/accelerator.h"
#include "pathcut/beam.h"

namespace nephroid {

/// Beams of 1 .. `length` reflections from a light, to be asked for paths.
struct BeamSets {
    std::vector<BeamSet> by_length;  ///< [length - 1]
    uint64_t nodes_visited = 0;
    uint64_t dropped = 0;  ///< Beams left out because there were more than `max_beams` of one length.
    size_t bytes() const;
};

/// With an accelerator, beams that something blocks at all the points that are tested are left out. `should_stop` as in
/// SearchOptions.
BeamSets trace_beams(const ReflectorTree& reflectors, const PathLight& light, const LitTriangles& lit,
                     const Accelerator* accelerator, int length, size_t max_beams,
                     const std::function<bool()>& should_stop);

}  // namespace nephroid

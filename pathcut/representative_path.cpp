#include "pathcut/representative_path.h"

namespace nephroid {

SearchStatistics& SearchStatistics::operator+=(const SearchStatistics& other) {
    nodes_visited += other.nodes_visited;
    leaf_cuts += other.leaf_cuts;
    solves += other.solves;
    exact += other.exact;
    relaxed += other.relaxed;
    iterations += other.iterations;
    continued += other.continued;
    merged += other.merged;
    occluded += other.occluded;
    dropped_cuts += other.dropped_cuts;
    dropped_beams += other.dropped_beams;
    cut_short += other.cut_short;
    solver_seconds += other.solver_seconds;
    return *this;
}

size_t RepresentativePaths::bytes() const {
    return first_path.size() * sizeof(uint32_t) + paths.size() * sizeof(RepresentativePath) +
           vertices.size() * sizeof(ReflectorVertex);
}

}  // namespace nephroid

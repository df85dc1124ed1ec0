#include "pathcut/beam_search.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "pathcut/beam_descent.h"
#include "pathcut/solver_timer.h"

namespace nephroid {

namespace {

constexpr float weight_margin = 0.1F;   // Barycentric: how far outside of the parent's triangle light may come from.
constexpr double furthest_exact = 1.5;  // Barycentric: Newton steps that lead further out lead to other triangles.
constexpr int most_iterations = 12;     // Twice what exact paths take from where beams say.
constexpr int longest_walk = 16;        // Triangles that a relaxed path may be followed through.
constexpr float wide_error = 0.1F;      // Of beams: above it they tell badly where to start.
constexpr float touching = 0.5F;        // Above it they hop to the next triangle, and the start hardly matters.

/// A beam that may bring a path to a receiver.
struct Candidate {
    uint32_t beam = 0;
    float distance = 0.0F;     ///< Smallest slope, as far as linearity goes.
    bool exact = false;        ///< It may vanish,
    bool solved = false;       ///< and does.
    bool known = false;        ///< The smallest slope is known well enough to tell whether it would be accepted.
    bool poor_start = false;   ///< The beam is known badly, and so is `position`.
    ChainPosition position{};  ///< Where, on all triangles.
    PerVertex<uint32_t> triangles{};
};

/// Searches the beams of one length for one receiver.
class ReceiverSearch {
  public:
    ReceiverSearch(const ReflectorTree& reflectors, const BeamSets& beams, int length, const Vec3& receiver,
                   const PathLight& light, const SolverOptions& options, SearchStatistics& statistics)
        : reflectors_(reflectors),
          beams_(beams),
          length_(static_cast<size_t>(length)),
          receiver_(receiver),
          light_(light),
          options_(options),
          statistics_(statistics) {}

    void run(std::vector<FoundPath>& found) {
        const BeamSet& set = beams_.by_length[length_ - 1];
        if (set.size() == 0) return;
        const PointBound<float> point{to_triple(receiver_), 0.0F};
        for_beams_towards(set.tree, set.tree.root(), point, reflectors_.widest_deviation, statistics_.nodes_visited,
                          [&](uint32_t block, uint32_t bits) { examine(set, block, bits); });
        // Best first, so that a candidate is compared with those that may make it superfluous.
        std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
            return a.distance != b.distance ? a.distance < b.distance : a.beam < b.beam;
        });
        for (Candidate& candidate : candidates_) candidate.solved = candidate.exact && solve_exact(candidate, found);
        for (size_t i = 0; i < candidates_.size(); ++i) {
            if (is_local_minimum(i)) solve_relaxed(candidates_[i], found);
        }
    }

  private:
    NEPHROID_FLATTEN void examine(const BeamSet& set, uint32_t index, uint32_t bits) {
        statistics_.leaf_cuts += static_cast<uint64_t>(std::popcount(bits));
        const BeamBlock& block = set.blocks[index];
        for (size_t first = 0; first < block_size; first += simd_width) {
            const uint32_t wanted = (bits >> first) & ((1U << simd_width) - 1U);
            if (wanted == 0) continue;
            const auto exists = first_lanes(set.size() - size_t{index} * block_size - first);
            const TriangleLanes<FloatV> t = load_triangles(reflectors_, block, first, exists);
            const IncomingDirections<FloatV> wi = load_directions(block, first);
            SlopeImage<FloatV> image = slope_image<FloatV>(t, wi, broadcast(to_triple(receiver_)));
            const FloatV error = load_lanes<FloatV>(block.error, first);
            image.error += error;
            const FloatV uncertainty = weight_uncertainty(image);
            const auto reflected = !slopes_too_large<FloatV>(t, image, FloatV(0.0F)) &&
                                   !is_behind<FloatV>(t, wi, error, broadcast(to_triple(receiver_)));
            uint32_t possible = wanted & lane_bits(reflected);
            for (; possible != 0; possible &= possible - 1) {
                const auto lane = static_cast<size_t>(std::countr_zero(possible));
                const Vec2 weights = lowest_point(image, lane);
                Candidate candidate;
                if (!follow_to_light(block, first + lane, weights, uncertainty[lane], candidate.position)) {
                    continue;
                }
                candidate.beam = index * static_cast<uint32_t>(block_size) + static_cast<uint32_t>(first + lane);
                candidate.distance = image.distance[lane];
                candidate.known = image.error[lane] < 0.5F * t.max_slope[lane];
                candidate.poor_start = block.error[first + lane] > wide_error && block.error[first + lane] < touching;
                candidate.exact = !(image.distance[lane] > image.error[lane]);
                candidate.triangles = chain_triangles(beams_, length_, candidate.beam);
                candidates_.push_back(candidate);
            }
        }
    }

    /// Where light that reaches a point of a beam's triangle was reflected before: an affine map from triangle to
    /// triangle. False if that is clearly outside of one of them.
    bool follow_to_light(const BeamBlock& beam_block, size_t beam_lane, const Vec2& weights, float uncertainty,
                         ChainPosition& position) const {
        const BeamBlock* block = &beam_block;
        size_t lane = beam_lane;
        position[0] = Vec2d(weights);
        for (size_t i = 1; i < length_; ++i) {
            const auto& w = block->parent_weights;
            float spread = 0.0F;
            for (int k = 0; k < 2; ++k) {
                const auto c = static_cast<size_t>(k);
                const float w0 = w[0][c][lane], d1 = w[1][c][lane] - w0, d2 = w[2][c][lane] - w0;
                position[i][k] = double{w0} + double{d1} * position[i - 1].x + double{d2} * position[i - 1].y;
                spread = std::max({spread, std::abs(d1), std::abs(d2)});
            }
            uncertainty = uncertainty * spread + 0.1F * spread + block->parent_error[lane];
            if (!is_inside(position[i], double{2.0F * weight_margin + uncertainty})) return false;
            const uint32_t parent = block->parent[lane];
            block = &beams_.by_length[length_ - 1 - i].blocks[parent / block_size];
            lane = parent % block_size;
        }
        return true;
    }

    bool touches(uint32_t a, uint32_t b) const {
        if (a == b) return true;
        const PointBound<float> first = reflectors_.bound(a).points, second = reflectors_.bound(b).points;
        const float distance = glm::length(to_vec3(first.centre) - to_vec3(second.centre));
        return distance <= first.radius + second.radius;
    }

    /// Not solved, and no better candidate, or solved one, runs through triangles that touch this one's.
    bool is_local_minimum(size_t index) const {
        const Candidate& candidate = candidates_[index];
        if (candidate.solved || !candidate.known) return false;
        for (size_t i = 0; i < candidates_.size(); ++i) {
            if (i >= index && !candidates_[i].solved) continue;
            bool adjacent = true;
            for (size_t v = 0; v < length_ && adjacent; ++v) {
                adjacent = touches(candidates_[i].triangles[v], candidate.triangles[v]);
            }
            if (adjacent) return false;
        }
        return true;
    }

    bool solve_exact(const Candidate& candidate, std::vector<FoundPath>& found) {
        return solve_exact(candidate, &candidate.position, found) ||
               (candidate.poor_start && solve_exact(candidate, nullptr, found));
    }

    /// From `start`, or the triangles' centres.
    bool solve_exact(const Candidate& candidate, const ChainPosition* start, std::vector<FoundPath>& found) {
        ++statistics_.solves;
        const SolverTimer timer(statistics_.solver_seconds);
        SolverOptions exact = options_;
        exact.relaxed = false;
        exact.start = start;
        exact.furthest = furthest_exact;
        exact.max_iterations = std::min(options_.max_iterations, most_iterations);
        const auto triangles = std::span(candidate.triangles).first(length_);
        const TupleSolution solution =
            solve_tuple(reflectors_, triangles, receiver_, light_, Selection::local_minima, exact);
        statistics_.iterations += static_cast<uint64_t>(solution.path.work.iterations);
        if (solution.accepted) keep(triangles, solution.path, found);
        return solution.accepted;
    }

    void solve_relaxed(const Candidate& candidate, std::vector<FoundPath>& found) {
        ++statistics_.solves;
        const SolverTimer timer(statistics_.solver_seconds);
        PerVertex<uint32_t> triangles = candidate.triangles;
        const auto chain = std::span(triangles).first(length_);
        SolverWork work;
        const TupleSolution solution =
            walk_to_minimum(reflectors_, chain, receiver_, light_, options_, longest_walk, work);
        statistics_.iterations += static_cast<uint64_t>(work.iterations);
        if (solution.accepted) keep(chain, solution.path, found);
    }

    void keep(std::span<const uint32_t> triangles, const SpecularPath& path, std::vector<FoundPath>& found) {
        ++(path.status == SolveStatus::exact ? statistics_.exact : statistics_.relaxed);
        found.push_back(make_found_path(reflectors_, triangles, path));
    }

    const ReflectorTree& reflectors_;
    const BeamSets& beams_;
    size_t length_;
    Vec3 receiver_;
    const PathLight& light_;
    const SolverOptions& options_;
    SearchStatistics& statistics_;
    std::vector<Candidate> candidates_;
};

}  // namespace

void find_paths_in_beams(const ReflectorTree& reflectors, const BeamSets& beams, int length, const Vec3& receiver,
                         const PathLight& light, const SolverOptions& options, std::vector<FoundPath>& found,
                         SearchStatistics& statistics) {
    ReceiverSearch(reflectors, beams, length, receiver, light, options, statistics).run(found);
}

}  // namespace nephroid

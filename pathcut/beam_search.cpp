#include "pathcut/beam_search.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "pathcut/skimming.h"

namespace nephroid {

namespace {

constexpr float weight_margin = 0.1F;  // Barycentric: how far outside of the parent's triangle light may come from.
constexpr float close_chord = 0.3F;    // Legs wider than this may join neighbours on one surface.
// Points of a triangle, as weights of its corners: the corners first, close to but not on what they may touch.
constexpr std::array<Vec3, 7> receiver_samples{
    Vec3(0.98F, 0.01F, 0.01F), Vec3(0.01F, 0.98F, 0.01F), Vec3(0.01F, 0.01F, 0.98F), Vec3(0.5F, 0.5F, 0.0F),
    Vec3(0.0F, 0.5F, 0.5F),    Vec3(0.5F, 0.0F, 0.5F),    Vec3(1.0F / 3.0F)};
constexpr double furthest_near = 3.0;   // The same for samples of beams, from the triangles' centres.
constexpr int few_iterations = 8;       // Enough from within that distance.
constexpr double furthest_exact = 1.5;  // Barycentric: Newton steps that lead further out lead to other triangles.
constexpr int longest_walk = 16;        // Triangles that a relaxed path may be followed through.

/// Calls visit(block index, lane bits) for all blocks of beams that may reach the points.
template <class Visit>
void for_beams_towards(const BlockTree<MirrorBlock>& tree, TreeItem item, const PointBound<float>& points,
                       float deviation, uint64_t& nodes_visited, const Visit& visit) {
    ++nodes_visited;
    const MirrorBlock& block = tree.children(item);
    uint32_t bits = 0;
    const PointBound<FloatV> viewer = broadcast(points);
    for (size_t first = 0; first < block_size; first += simd_width) {
        const MirrorBound<FloatV> beams = load(block, first);
        const Leg<FloatV> leg = make_leg<FloatV>(beams.points, viewer);
        bits |= lane_bits(!misses<FloatV>(beams, leg, FloatV(deviation))) << first;
    }
    bits &= (1U << tree.child_count(item)) - 1U;
    if (bits == 0) return;
    if (item.level == 1) {
        visit(item.index, bits);
        return;
    }
    for (; bits != 0; bits &= bits - 1) {
        const auto lane = static_cast<size_t>(std::countr_zero(bits));
        for_beams_towards(tree, BlockTree<MirrorBlock>::child(item, lane), points, deviation, nodes_visited, visit);
    }
}

/// The triangles behind a beam of `length` reflections, its own first.
PerVertex<uint32_t> chain_triangles(const BeamSets& sets, size_t length, uint32_t beam) {
    PerVertex<uint32_t> triangles{};
    for (size_t i = 0; i < length; ++i) {
        const BeamSet& set = sets.by_length[length - 1 - i];
        triangles[i] = set.triangle(beam);
        beam = set.parent(beam);
    }
    return triangles;
}

/// Makes the beams that one triangle reflects.
class BeamReflection {
  public:
    BeamReflection(const ReflectorTree& reflectors, const PathLight& light, const BeamSets& sets,
                   const Accelerator* accelerator, uint32_t triangle)
        : reflectors_(reflectors),
          light_(light),
          sets_(sets),
          accelerator_(accelerator),
          incoming_length_(sets.by_length.size()),
          triangle_(triangle),
          bound_(reflectors.bound(triangle)) {
        for (size_t corner = 0; corner < 3; ++corner) corners_[corner] = reflectors.position(triangle, corner);
    }

    void run(std::vector<Beam>& beams, uint64_t& nodes_visited) const {
        for_beams_towards(incoming().tree, incoming().tree.root(), bound_.points, 0.0F, nodes_visited,
                          [&](uint32_t block, uint32_t bits) { reflect_block(block, bits, beams); });
    }

  private:
    /// Where light for one corner comes from, for a vector of beams.
    struct Origins {
        FloatV weight1, weight2;  ///< Barycentric, on the incoming beam's triangle.
        FloatV uncertainty;       ///< Of the weights.
        FloatV shortfall;         ///< By how much the slopes there miss zero, at least.
    };

    NEPHROID_FLATTEN void reflect_block(uint32_t index, uint32_t bits, std::vector<Beam>& beams) const {
        const BeamBlock& block = incoming().blocks[index];
        bits = without_neighbours(index, bits);
        for (size_t first = 0; first < block_size; first += simd_width) {
            const uint32_t wanted = (bits >> first) & ((1U << simd_width) - 1U);
            if (wanted == 0) continue;
            const auto exists = first_lanes(incoming().size() - size_t{index} * block_size - first);
            const TriangleLanes<FloatV> t = load_triangles(reflectors_, block, first, exists);
            const IncomingDirections<FloatV> wi = load_directions(block, first);
            std::array<Origins, 3> origins;
            for (size_t corner = 0; corner < 3; ++corner) {
                SlopeImage<FloatV> image = slope_image<FloatV>(t, wi, broadcast(to_triple(corners_[corner])));
                image.error += load_lanes<FloatV>(block.error, first);
                origins[corner] = {image.weight1, image.weight2, weight_uncertainty(image),
                                   image.distance - image.error};
            }
            uint32_t lit = wanted & lane_bits(may_light(origins));
            const uint32_t doubtful = lane_bits(is_doubtful(origins));
            for (; lit != 0; lit &= lit - 1) {
                const auto lane = static_cast<size_t>(std::countr_zero(lit));
                const uint32_t parent = index * static_cast<uint32_t>(block_size) + static_cast<uint32_t>(first + lane);
                if ((doubtful >> lane & 1U) != 0) {
                    add_solved_beam(parent, beams);
                } else {
                    add_beam(parent, origins, lane, beams);
                }
            }
        }
    }

    /// Whether light of the beam reaches some point between the corners: unless it would come from outside of one edge
    /// of the beam's triangle for all three of them.
    static FloatV::mask_type may_light(const std::array<Origins, 3>& origins) {
        FloatV most1(-1e30F), most2(-1e30F), most0(-1e30F);
        FloatV::mask_type uncertain(false), near(false);
        for (const Origins& o : origins) {
            const FloatV margin = o.uncertainty + FloatV(weight_margin);
            most1 = maximum(most1, o.weight1 + margin);
            most2 = maximum(most2, o.weight2 + margin);
            most0 = maximum(most0, FloatV(1.0F) - o.weight1 - o.weight2 + margin);
            uncertain = uncertain || !(o.uncertainty < FloatV(1.0F));
            near = near || !(o.shortfall > FloatV(0.0F));
        }
        const FloatV zero(0.0F);
        return (most1 >= zero && most2 >= zero && most0 >= zero && !uncertain) || (uncertain && near);
    }

    /// Where linearity says little: near triangles, and folds.
    static FloatV::mask_type is_doubtful(const std::array<Origins, 3>& origins) {
        FloatV::mask_type doubtful(false);
        for (const Origins& o : origins) doubtful = doubtful || !(o.uncertainty < FloatV(1.0F));
        return doubtful;
    }

    void add_beam(uint32_t parent, const std::array<Origins, 3>& origins, size_t lane, std::vector<Beam>& beams) const {
        const uint32_t source = incoming().triangle(parent);
        Beam beam;
        beam.triangle = triangle_;
        beam.parent = parent;
        float uncertainty = 0.0F;
        for (size_t corner = 0; corner < 3; ++corner) {
            const Origins& o = origins[corner];
            set_origin(beam, corner, source, Vec2(o.weight1[lane], o.weight2[lane]));
            uncertainty = std::max(uncertainty, o.uncertainty[lane]);
        }
        beam.error = uncertainty * angular_size(source);
        append(beam, beams);
    }

    /// By solving for the path to each corner and to the centroid: those without one take the mean of the others.
    void add_solved_beam(uint32_t parent, std::vector<Beam>& beams) const {
        const PerVertex<uint32_t> chain = chain_of(parent);
        const auto triangles = std::span(chain).first(incoming_length_);
        SolverOptions exact;
        exact.relaxed = false;
        exact.furthest = furthest_near;
        exact.max_iterations = few_iterations;
        std::array<bool, 3> solved{};
        std::array<Vec2, 3> weights{};
        Vec2 sum(0.0F);
        float count = 0.0F;
        for (size_t sample = 0; sample < receiver_samples.size(); ++sample) {
            const Vec3& at = receiver_samples[sample];
            const Vec3 receiver = corners_[0] * at[0] + corners_[1] * at[1] + corners_[2] * at[2];
            const TupleSolution solution =
                solve_tuple(reflectors_, triangles, receiver, light_, Selection::local_minima, exact);
            if (!solution.accepted) continue;
            const Vec2 b(solution.path.vertices[0].barycentrics);
            if (sample < 3) {
                solved[sample] = true;
                weights[sample] = b;
            }
            sum += b;
            count += 1.0F;
        }
        if (count == 0.0F) return;
        Beam beam;
        beam.triangle = triangle_;
        beam.parent = parent;
        for (size_t corner = 0; corner < 3; ++corner) {
            set_origin(beam, corner, triangles[0], solved[corner] ? weights[corner] : sum / count);
        }
        beam.error = (count == static_cast<float>(receiver_samples.size()) ? 0.2F : 1.0F) * angular_size(triangles[0]);
        append(beam, beams);
    }

    void append(const Beam& beam, std::vector<Beam>& beams) const {
        const Vec3 sum = beam.wi[0] + beam.wi[1] + beam.wi[2];
        if (std::isfinite(sum.x + sum.y + sum.z) && !is_blocked(beam)) beams.push_back(beam);
    }

    /// Whether something is in the way of the beam's light to all corners and to the centroid. Both ends are left out,
    /// so that neither triangle counts.
    bool is_blocked(const Beam& beam) const {
        if (accelerator_ == nullptr) return false;
        constexpr float left_out = 1e-3F, inwards = 0.1F;
        const uint32_t source = incoming().triangle(beam.parent);
        const Vec3 centroid = (corners_[0] + corners_[1] + corners_[2]) / 3.0F;
        const Vec2 mean = (beam.parent_weights[0] + beam.parent_weights[1] + beam.parent_weights[2]) / 3.0F;
        const SurfacePatch patch = reflectors_.patch(source);
        for (size_t i = 0; i < 4; ++i) {
            const Vec3 to = i < 3 ? glm::mix(corners_[i], centroid, inwards) : centroid;
            const Vec2d weights = closest_inside(patch, Vec2d(i < 3 ? beam.parent_weights[i] : mean));
            const Vec3 from(evaluate(patch, glm::mix(weights, triangle_centre, double{inwards})).position);
            const Vec3 between = to - from;
            const Ray ray{from + between * left_out, between * (1.0F - 2.0F * left_out), 1.0F};
            if (!accelerator_->occluded(ray)) return false;
        }
        return true;
    }

    void set_origin(Beam& beam, size_t corner, uint32_t source, const Vec2& weights) const {
        std::array<Vec3, 3> p;
        for (size_t k = 0; k < 3; ++k) p[k] = reflectors_.position(source, k);
        const Vec3 origin = p[0] * (1.0F - weights.x - weights.y) + p[1] * weights.x + p[2] * weights.y;
        beam.parent_weights[corner] = weights;
        beam.wi[corner] = glm::normalize(origin - corners_[corner]);
    }

    /// Of the source as this triangle sees it: radius over distance.
    float angular_size(uint32_t source) const {
        const PointBound<float> points = reflectors_.bound(source).points;
        return points.radius * make_leg(bound_.points, points).inverse_distance;
    }

    /// The triangles behind a beam of the incoming set, itself first.
    PerVertex<uint32_t> chain_of(uint32_t beam) const { return chain_triangles(sets_, incoming_length_, beam); }

    /// Drops beams from triangles that touch this one, and from others close by whose light does not skim.
    uint32_t without_neighbours(uint32_t index, uint32_t bits) const {
        uint32_t kept = bits;
        const BeamBlock& block = incoming().blocks[index];
        for (; bits != 0; bits &= bits - 1) {
            const auto lane = static_cast<size_t>(std::countr_zero(bits));
            const uint32_t source = block.triangle[lane];
            const MirrorBound<float> mirror = reflectors_.bound(source);
            const float chord = make_leg(mirror.points, bound_.points).chord;
            if (chord < close_chord) continue;
            // Hops shorter than a triangle are beyond what triangles can tell: those within one, and to the next.
            if (source == triangle_ || only_skims(reflectors_, source, incoming_leg(block, lane), 0.0F, triangle_)) {
                kept &= ~(1U << lane);
            }
        }
        return kept;
    }

    static Leg<float> incoming_leg(const BeamBlock& block, size_t lane) {
        std::array<Triple<float>, 3> wi;
        for (size_t corner = 0; corner < 3; ++corner) {
            const auto& w = block.wi[corner];
            wi[corner] = {w[0][lane], w[1][lane], w[2][lane]};
        }
        Leg<float> leg{normalized(wi[0] + wi[1] + wi[2]), 0.0F, 0.0F};
        for (const Triple<float>& w : wi) {
            const Triple<float> off = w - leg.direction;
            leg.chord = std::max(leg.chord, std::sqrt(dot(off, off)));
        }
        return leg;
    }

    const BeamSet& incoming() const { return sets_.by_length.back(); }

    const ReflectorTree& reflectors_;
    const PathLight& light_;
    const BeamSets& sets_;
    const Accelerator* accelerator_;
    size_t incoming_length_;
    uint32_t triangle_;
    MirrorBound<float> bound_;
    std::array<Vec3, 3> corners_;
};

/// A beam that may bring a path to a receiver.
struct Candidate {
    uint32_t beam = 0;
    float distance = 0.0F;     ///< Smallest slope, as far as linearity goes.
    bool exact = false;        ///< It may vanish,
    bool solved = false;       ///< and does.
    bool known = false;        ///< The smallest slope is known well enough to tell whether it would be accepted.
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
            image.error += load_lanes<FloatV>(block.error, first);
            const FloatV uncertainty = weight_uncertainty(image);
            uint32_t possible = wanted & lane_bits(!slopes_too_large<FloatV>(t, image, FloatV(0.0F)));
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
            uncertainty = uncertainty * spread + 0.1F * spread;
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
        ++statistics_.solves;
        SolverOptions exact = options_;
        exact.relaxed = false;
        exact.start = &candidate.position;
        exact.furthest = furthest_exact;
        const auto triangles = std::span(candidate.triangles).first(length_);
        const TupleSolution solution =
            solve_tuple(reflectors_, triangles, receiver_, light_, Selection::local_minima, exact);
        statistics_.iterations += static_cast<uint64_t>(solution.path.work.iterations);
        if (solution.accepted) keep(triangles, solution.path, found);
        return solution.accepted;
    }

    void solve_relaxed(const Candidate& candidate, std::vector<FoundPath>& found) {
        ++statistics_.solves;
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

size_t BeamSets::bytes() const {
    size_t sum = 0;
    for (const BeamSet& set : by_length) sum += set.bytes();
    return sum;
}

BeamSets trace_beams(const ReflectorTree& reflectors, const PathLight& light, const LitTriangles& lit,
                     const Accelerator* accelerator, int length, size_t max_beams) {
    BeamSets sets;
    sets.by_length.push_back(make_beam_set(reflectors, direct_beams(reflectors, light, lit)));
    while (sets.by_length.size() < static_cast<size_t>(length)) {
        const BeamSet& incoming = sets.by_length.back();
        if (incoming.size() == 0) {
            sets.by_length.emplace_back();
            continue;
        }
        const size_t blocks = reflectors.blocks.size();
        std::vector<std::vector<Beam>> by_block(blocks);
        std::vector<uint64_t> nodes(blocks);
        tbb::parallel_for(size_t{0}, blocks, [&](size_t block) {
            const size_t end = std::min((block + 1) * block_size, reflectors.size());
            for (size_t triangle = block * block_size; triangle < end; ++triangle) {
                BeamReflection(reflectors, light, sets, accelerator, static_cast<uint32_t>(triangle))
                    .run(by_block[block], nodes[block]);
            }
        });
        std::vector<Beam> beams;
        for (size_t block = 0; block < blocks; ++block) {
            sets.nodes_visited += nodes[block];
            const size_t room = std::min(by_block[block].size(), max_beams - beams.size());
            sets.dropped += by_block[block].size() - room;
            beams.insert(beams.end(), by_block[block].begin(),
                         by_block[block].begin() + static_cast<std::ptrdiff_t>(room));
            by_block[block] = {};
        }
        BeamSet set = make_beam_set(reflectors, beams);
        sets.by_length.push_back(std::move(set));
    }
    return sets;
}

void find_paths_in_beams(const ReflectorTree& reflectors, const BeamSets& beams, int length, const Vec3& receiver,
                         const PathLight& light, const SolverOptions& options, std::vector<FoundPath>& found,
                         SearchStatistics& statistics) {
    ReceiverSearch(reflectors, beams, length, receiver, light, options, statistics).run(found);
}

}  // namespace nephroid

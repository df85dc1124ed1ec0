#include "pathcut/path_cut_search.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "pathcut/beam_search.h"
#include "pathcut/cut_test.h"
#include "pathcut/path_merging.h"
#include "pathcut/path_visibility.h"
#include "pathcut/skimming.h"
#include "pathcut/slope_triangle.h"
#include "pathcut/solver_timer.h"

namespace nephroid {

namespace {

/// A node of receivers and a chain of nodes of reflectors, the receiver's side first.
struct PathCut {
    TreeItem receiver;
    PointBound<float> receiver_bound;
    PerVertex<TreeItem> items;
    PerVertex<MirrorBound<float>> bounds;
    size_t length = 1;
};

/// The legs at each vertex of a cut.
struct CutLegs {
    PerVertex<Leg<float>> to_viewer, to_light;
};

FloatV mask_value(const UintV::mask_type& mask) {
    UintV value(0U);
    stdx::where(mask, value) = UintV(1U);
    return stdx::static_simd_cast<FloatV>(stdx::static_simd_cast<IntV>(value));
}

/// Searches the receivers of one node for all paths to one light.
class GroupSearch {
  public:
    GroupSearch(const ReflectorTree& reflectors, const ReceiverTree& receivers, const PathLight& light,
                const LitTriangles& lit, const BeamSets& beams, const SearchOptions& options)
        : reflectors_(reflectors), receivers_(receivers), light_(light), lit_(lit), beams_(beams), options_(options) {}

    void run(TreeItem group) {
        const size_t begin = size_t{group.index} << (4 * group.level);
        const size_t end = std::min((size_t{group.index} + 1) << (4 * group.level), receivers_.tree.size);
        nodes_left_ =
            options_.max_nodes_per_receiver == 0 ? ~uint64_t{0} : options_.max_nodes_per_receiver * (end - begin);
        const bool all_cuts = options_.selection == Selection::every_triangle || !options_.solver.newton;
        for (int length = options_.shortest; length <= options_.bounces; ++length) {
            if (length == 1 || all_cuts) {
                search_cuts(group, length);
            } else {
                for (size_t i = begin; i < end; ++i) search_beams(i, length);
            }
        }
        std::sort(found.begin(), found.end(), comes_before);
        if (options_.merge_distance >= 0.0) statistics.merged = merge_paths(found, options_.merge_distance);
        if (options_.accelerator != nullptr) remove_occluded();
        std::sort(cut_short_.begin(), cut_short_.end());
        cut_short_.erase(std::unique(cut_short_.begin(), cut_short_.end()), cut_short_.end());
        statistics.cut_short = cut_short_.size();
    }

    std::vector<FoundPath> found;
    SearchStatistics statistics;

  private:
    static constexpr float infinity = std::numeric_limits<float>::infinity();
    static constexpr uint64_t nodes_between_questions = 256;

    const PathLight& light() const { return light_; }

    void search_cuts(TreeItem group, int length) {
        PathCut cut;
        cut.length = static_cast<size_t>(length);
        cut.receiver = group;
        cut.receiver_bound =
            extract(receivers_.tree.levels[group.level][group.index / block_size], group.index % block_size);
        cut.items.fill(reflectors_.tree.root());
        cut.bounds.fill(MirrorBound<float>{{{0.0F, 0.0F, 0.0F}, infinity}, {0.0F, 0.0F, 1.0F}, 0.0F, 1.0F});
        visit(cut);
    }

    void search_beams(size_t receiver, int length) {
        const uint64_t visited_before = statistics.nodes_visited;
        const PointBound<float> bound =
            extract(receivers_.tree.levels[0][receiver / block_size], receiver % block_size);
        stop_if_asked();
        if (nodes_left_ == 0) {
            ++statistics.dropped_cuts;
            cut_short_.push_back(static_cast<uint32_t>(receiver));
            return;
        }
        const size_t found_before = found.size();
        find_paths_in_beams(reflectors_, beams_, length, to_vec3(bound.centre), light_, options_.solver, found,
                            statistics);
        for (size_t i = found_before; i < found.size(); ++i) found[i].receiver = static_cast<uint32_t>(receiver);
        nodes_left_ -= std::min(nodes_left_, statistics.nodes_visited - visited_before);
    }

    CutLegs legs_of(const PathCut& cut) const {
        CutLegs legs;
        for (size_t i = 0; i < cut.length; ++i) {
            const PointBound<float>& points = cut.bounds[i].points;
            legs.to_viewer[i] = i == 0 ? make_leg(points, cut.receiver_bound) : reversed(legs.to_light[i - 1]);
            legs.to_light[i] =
                i + 1 == cut.length ? make_leg(points, light()) : make_leg(points, cut.bounds[i + 1].points);
        }
        return legs;
    }

    /// How much of the uncertainty about half vectors a node brings in; infinite where nothing is known.
    static float thickness(float radius, const Leg<float>& leg, float half_vector) {
        const float t = radius * leg.inverse_distance / half_vector;
        return t < infinity ? t : infinity;  // Also for NaN.
    }

    /// 0: the receivers; i + 1: the i-th reflector; -1: nothing is left to split.
    int thickest(const PathCut& cut, const CutLegs& legs) const {
        PerVertex<float> half_vector{};
        for (size_t i = 0; i < cut.length; ++i) {
            const Triple<float> h = legs.to_viewer[i].direction + legs.to_light[i].direction;
            half_vector[i] = square_root(dot(h, h));
        }
        int best = -1;
        float most = -1.0F;
        const bool one_bounce_leaf = cut.length == 1 && cut.items[0].level == 1;
        if (cut.receiver.level > 0) {
            most = thickness(cut.receiver_bound.radius, legs.to_viewer[0], half_vector[0]);
            best = 0;
            if (one_bounce_leaf) return best;
        }
        for (size_t i = 0; i < cut.length; ++i) {
            if (cut.items[i].level == 0) continue;
            const float radius = cut.bounds[i].points.radius;
            float t = cut.bounds[i].sin_spread - reflectors_.smallest_spread;
            t += thickness(radius, legs.to_viewer[i], half_vector[i]);
            t += thickness(radius, legs.to_light[i], half_vector[i]);
            if (i > 0) t += thickness(radius, legs.to_viewer[i], half_vector[i - 1]);
            if (i + 1 < cut.length) t += thickness(radius, legs.to_light[i], half_vector[i + 1]);
            if (t > most) {
                most = t;
                best = static_cast<int>(i) + 1;
            }
        }
        return best;
    }

    /// Bits of the receivers' children that the first reflector may serve.
    NEPHROID_FLATTEN uint32_t possible_receivers(const PathCut& cut, const CutLegs& legs) const {
        const PointBlock& block = receivers_.tree.children(cut.receiver);
        const MirrorBound<FloatV> mirror = broadcast(cut.bounds[0]);
        const Leg<FloatV> to_light = broadcast(legs.to_light[0]);
        uint32_t bits = 0;
        for (size_t first = 0; first < block_size; first += simd_width) {
            const Leg<FloatV> to_viewer = make_leg<FloatV>(mirror.points, load(block, first));
            bits |= lane_bits(!cannot_reflect<FloatV>(mirror, to_viewer, to_light)) << first;
        }
        return bits & ((1U << receivers_.tree.child_count(cut.receiver)) - 1U);
    }

    /// Bits of reflector i's children that may reflect, and let its neighbours reflect.
    NEPHROID_FLATTEN uint32_t possible_reflectors(const PathCut& cut, const CutLegs& legs, size_t i) const {
        const MirrorBlock& block = reflectors_.tree.children(cut.items[i]);
        const bool last = i + 1 == cut.length;
        const PointBound<FloatV> viewer = broadcast(i == 0 ? cut.receiver_bound : cut.bounds[i - 1].points);
        uint32_t bits = 0;
        for (size_t first = 0; first < block_size; first += simd_width) {
            const MirrorBound<FloatV> mirror = load(block, first);
            const Leg<FloatV> to_viewer = make_leg<FloatV>(mirror.points, viewer);
            const Leg<FloatV> to_light = last ? make_leg<FloatV>(mirror.points, light())
                                              : make_leg<FloatV>(mirror.points, broadcast(cut.bounds[i + 1].points));
            auto rejected = cannot_reflect<FloatV>(mirror, to_viewer, to_light);
            if (last && !light().shines_everywhere()) rejected |= outside_light_cone<FloatV>(light(), to_light);
            if (i > 0) {
                rejected |= cannot_reflect<FloatV>(broadcast(cut.bounds[i - 1]), broadcast(legs.to_viewer[i - 1]),
                                                   reversed<FloatV>(to_viewer));
            }
            if (!last) {
                rejected |= cannot_reflect<FloatV>(broadcast(cut.bounds[i + 1]), reversed<FloatV>(to_light),
                                                   broadcast(legs.to_light[i + 1]));
            }
            bits |= lane_bits(!rejected) << first;
        }
        return bits & ((1U << reflectors_.tree.child_count(cut.items[i])) - 1U);
    }

    /// Of the triangles `bits` of reflector i, those that are not just next to a neighbouring vertex's triangle.
    uint32_t without_skimming(const PathCut& cut, const CutLegs& legs, size_t i, uint32_t bits) const {
        uint32_t kept = bits;
        for (const size_t other : {i - 1, i + 1}) {  // i - 1 wraps around to a number above all lengths.
            if (other >= cut.length || cut.items[other].level != 0) continue;
            const uint32_t first = cut.items[i].index * static_cast<uint32_t>(block_size);
            for (uint32_t left = kept; left != 0; left &= left - 1) {
                const auto lane = static_cast<uint32_t>(std::countr_zero(left));
                const MirrorBound<float> mirror = extract(reflectors_.tree.children(cut.items[i]), lane);
                if (make_leg(mirror.points, cut.bounds[other].points).chord < leg::unbounded) continue;
                if (skims(cut, legs, i, first + lane, mirror, other)) kept &= ~(1U << lane);
            }
        }
        return kept;
    }

    bool skims(const PathCut& cut, const CutLegs& legs, size_t i, uint32_t triangle, const MirrorBound<float>& mirror,
               size_t other) const {
        const uint32_t other_triangle = cut.items[other].index;
        if (triangle == other_triangle) return true;  // Flat: light cannot go from a triangle to itself.
        const bool towards_light = other > i;
        const Leg<float> outer = towards_light
                                     ? (i == 0 ? make_leg(mirror.points, cut.receiver_bound)
                                               : make_leg(mirror.points, cut.bounds[i - 1].points))
                                     : (i + 1 == cut.length ? make_leg(mirror.points, light())
                                                            : make_leg(mirror.points, cut.bounds[i + 1].points));
        const Leg<float>& other_outer = towards_light ? legs.to_light[other] : legs.to_viewer[other];
        const float acceptance = 0.5F * reflectors_.widest_deviation;
        return only_skims(reflectors_, triangle, outer, acceptance, other_triangle) ||
               only_skims(reflectors_, other_triangle, other_outer, acceptance, triangle);
    }

    /// Triangles of a block that may hold accepted paths, as bits.
    struct Candidates {
        uint32_t any = 0;                       ///< All of them.
        uint32_t relaxed = 0;                   ///< Where slopes may be smallest without vanishing.
        uint32_t exact = 0;                     ///< Where they may vanish.
        uint32_t linear = 0;                    ///< Where they are linear enough to tell the place of the smallest.
        uint32_t creased = 0;                   ///< Where a crease may end them.
        std::array<Vec2, block_size> lowest{};  ///< That place, barycentric; of relaxed ones that are not exact.
    };

    static constexpr float nearly_linear = 0.02F;
    static constexpr uint8_t no_corner = 3;
    static uint8_t corner_at(const Vec2& weights) {
        if (weights == Vec2(0.0F)) return 0;
        if (weights.x == 1.0F) return 1;
        return weights.y == 1.0F ? 2 : no_corner;
    }

    NEPHROID_FLATTEN Candidates promising_triangles(const PathCut& cut, uint32_t bits) const {
        const TriangleBlock& block = reflectors_.blocks[cut.items[0].index];
        const Triple<FloatV> receiver = broadcast(cut.receiver_bound.centre);
        Candidates candidates;
        for (size_t first = 0; first < block_size; first += simd_width) {
            const uint32_t wanted = (bits >> first) & ((1U << simd_width) - 1U);
            if (wanted == 0) continue;
            const TriangleLanes<FloatV> triangles = load(block, first);
            const SlopeImage<FloatV> image =
                slope_image<FloatV>(triangles, directions_to<FloatV>(light(), triangles), receiver);
            const auto possible = !slopes_too_large<FloatV>(triangles, image, light_widening(triangles, receiver));
            const uint32_t any = lane_bits(possible) & wanted;
            if (any == 0) continue;
            if (options_.selection == Selection::every_triangle) {
                candidates.any |= any << first;
                candidates.relaxed |= any << first;
                candidates.exact |= any << first;
                continue;
            }
            const size_t triangle = size_t{cut.items[0].index} * block_size + first;
            const EdgeEnds ends = find_ends(triangle, triangles, image, receiver);
            const auto minimum = image.grazing || may_fold<FloatV>(image, image.area) || ends.at_fold || ends.at_crease;
            const uint32_t exact = any & lane_bits(image.distance <= image.error), relaxed = any & lane_bits(minimum);
            candidates.any |= (exact | relaxed) << first;
            candidates.relaxed |= relaxed << first;
            candidates.exact |= exact << first;
            candidates.creased |= lane_bits(ends.at_crease) << first;
            candidates.linear |= lane_bits(image.error < FloatV(nearly_linear) * longest_edge(image)) << first;
            for (uint32_t left = relaxed & ~exact; left != 0; left &= left - 1) {
                const auto lane = static_cast<size_t>(std::countr_zero(left));
                candidates.lowest[first + lane] = lowest_point(image, lane);
            }
        }
        return candidates;
    }

    /// What is across the edge towards which slopes fall, where they do not go on falling behind that edge.
    struct EdgeEnds {
        FloatV::mask_type at_fold{false};    ///< A border, or a triangle of opposite orientation in slope space.
        FloatV::mask_type at_crease{false};  ///< See crease_ratio.
    };

    EdgeEnds find_ends(size_t first_triangle, const TriangleLanes<FloatV>& triangles, const SlopeImage<FloatV>& image,
                       const Triple<FloatV>& receiver) const {
        const uint32_t* twins = reflectors_.twins.data()->data() + 3 * first_triangle;
        const auto exists = first_lanes(reflectors_.size() - first_triangle);
        EdgeEnds ends;
        for (uint32_t edge = 0; edge < 3; ++edge) {
            const UintV twin = gather(twins, lane_numbers() * 3U + edge, exists);
            const auto is_border = twin == UintV(no_half_edge);
            const FloatV border = mask_value(is_border);
            const auto has_twin = exists && border == FloatV(0.0F);
            const UintV triangle = twin >> 2, corner_of_edge = twin & 3U;
            UintV corner = corner_of_edge + 2U;
            stdx::where(corner >= 3U, corner) = corner - 3U;
            const CornerLanes third = gather_corner(reflectors_, triangle, corner, has_twin);
            const Triple<FloatV> wi = direction_to<FloatV>(light(), third.position);
            const SlopePoint<FloatV> apex =
                slope_at<FloatV>(third.position, third.normal, image.frame, receiver, wi).slope;
            const auto is_lowest = image.edge_distances[edge] <= image.distance + image.error;
            const FloatV across = area_across<FloatV>(image, edge, apex);
            // Half of the ratio, for all that linearity neglects: the solver decides.
            const auto is_crease =
                is_steeper<FloatV>(triangles, image, edge, third.position, across, 0.5 * crease_ratio);
            ends.at_fold |= is_lowest && (!has_twin || may_fold<FloatV>(image, across));
            ends.at_crease |= is_lowest && has_twin && is_crease;
        }
        return ends;
    }

    /// What a sphere light adds to slopes that count, from above; zero for other lights.
    FloatV light_widening(const TriangleLanes<FloatV>& t, const Triple<FloatV>& receiver) const {
        if (!(light().radius > 0.0F)) return FloatV(0.0F);
        const PointBound<FloatV> point{centroid_of(t), FloatV(0.0F)};
        const Leg<FloatV> to_light = make_leg<FloatV>(point, light());
        const Leg<FloatV> to_viewer = make_leg<FloatV>(point, PointBound<FloatV>{receiver, FloatV(0.0F)});
        const Triple<FloatV> h = to_light.direction + to_viewer.direction;
        const FloatV angle = to_light.chord * reciprocal_square_root(dot(h, h)) * FloatV(1.1F);
        const FloatV widening = angle * FloatV(2.0F) * (FloatV(1.0F) + t.max_slope * t.max_slope);
        return select(angle < FloatV(0.3F), widening, FloatV(infinity));
    }

    void stop_if_asked() {
        if (options_.should_stop && options_.should_stop()) nodes_left_ = 0;
    }

    void visit(PathCut& cut) {
        if (statistics.nodes_visited % nodes_between_questions == 0) stop_if_asked();
        if (nodes_left_ == 0) {
            drop(cut);
            return;
        }
        --nodes_left_;
        ++statistics.nodes_visited;
        const CutLegs legs = legs_of(cut);
        const int split = thickest(cut, legs);
        if (split < 0) {
            solve_chain(cut);
        } else if (split == 0) {
            descend_receivers(cut, possible_receivers(cut, legs));
        } else {
            const auto i = static_cast<size_t>(split) - 1;
            uint32_t bits = possible_reflectors(cut, legs, i);
            if (cut.items[i].level == 1 && i + 1 == cut.length) bits &= lit_[cut.items[i].index];
            if (cut.items[i].level == 1) bits = without_skimming(cut, legs, i, bits);
            if (cut.length == 1 && cut.items[0].level == 1) {
                solve_block(cut, bits);
            } else {
                descend_reflectors(cut, i, bits);
            }
        }
    }

    void descend_receivers(PathCut& cut, uint32_t bits) {
        const TreeItem parent = cut.receiver;
        const PointBound<float> parent_bound = cut.receiver_bound;
        const PointBlock& block = receivers_.tree.children(parent);
        for (; bits != 0; bits &= bits - 1) {
            const auto lane = static_cast<size_t>(std::countr_zero(bits));
            cut.receiver = BlockTree<PointBlock>::child(parent, lane);
            cut.receiver_bound = extract(block, lane);
            visit(cut);
        }
        cut.receiver = parent;
        cut.receiver_bound = parent_bound;
    }

    void descend_reflectors(PathCut& cut, size_t i, uint32_t bits) {
        const TreeItem parent = cut.items[i];
        const MirrorBound<float> parent_bound = cut.bounds[i];
        const MirrorBlock& block = reflectors_.tree.children(parent);
        for (; bits != 0; bits &= bits - 1) {
            const auto lane = static_cast<size_t>(std::countr_zero(bits));
            cut.items[i] = BlockTree<MirrorBlock>::child(parent, lane);
            cut.bounds[i] = extract(block, lane);
            visit(cut);
        }
        cut.items[i] = parent;
        cut.bounds[i] = parent_bound;
    }

    /// One reflection at triangles of a block, for a single receiver.
    void solve_block(const PathCut& cut, uint32_t bits) {
        if (bits == 0) return;
        statistics.leaf_cuts += static_cast<uint64_t>(std::popcount(bits));
        const Candidates candidates = promising_triangles(cut, bits);
        SolverOptions solver = options_.solver;
        solver.rejection_margin = INFINITY;  // The triangles' images have said as much, and better.
        for (uint32_t left = candidates.any; left != 0; left &= left - 1) {
            const uint32_t lane = static_cast<uint32_t>(std::countr_zero(left));
            const uint32_t triangle = cut.items[0].index * static_cast<uint32_t>(block_size) + lane;
            solver.relaxed = (candidates.relaxed >> lane & 1U) != 0;
            const Vec2& lowest = candidates.lowest[lane];
            solver.local = options_.selection == Selection::local_minima &&
                           (candidates.linear & ~candidates.exact & 1U << lane) != 0;
            // Next to a corner, too, slopes may end at a crease.
            if (solver.local && corner_at(lowest) != no_corner && (candidates.creased >> lane & 1U) == 0 &&
                falls_away_at_corner(reflectors_, triangle, corner_at(lowest), to_vec3(cut.receiver_bound.centre),
                                     light_)) {
                ++statistics.continued;
                continue;
            }
            const ChainPosition start{Vec2d(lowest)};
            solver.start = solver.local ? &start : nullptr;
            solve(cut, {triangle}, solver);
        }
    }

    /// A chain of single triangles.
    void solve_chain(const PathCut& cut) {
        PerVertex<uint32_t> triangles{};
        for (size_t i = 0; i < cut.length; ++i) triangles[i] = cut.items[i].index;
        ++statistics.leaf_cuts;
        solve(cut, triangles, options_.solver);
    }

    void solve(const PathCut& cut, const PerVertex<uint32_t>& triangles, const SolverOptions& solver) {
        ++statistics.solves;
        const SolverTimer timer(statistics.solver_seconds);
        const TupleSolution solution =
            solve_tuple(reflectors_, std::span(triangles).first(cut.length), to_vec3(cut.receiver_bound.centre),
                        light(), options_.selection, solver);
        statistics.iterations += static_cast<uint64_t>(solution.path.work.iterations);
        statistics.continued += solution.continued ? 1 : 0;
        if (!solution.accepted) return;
        ++(solution.path.status == SolveStatus::exact ? statistics.exact : statistics.relaxed);
        found.push_back(make_found_path(reflectors_, std::span(triangles).first(cut.length), solution.path));
        found.back().receiver = cut.receiver.index;
    }

    void remove_occluded() {
        size_t kept = 0;
        for (FoundPath& path : found) {
            const SurfacePoint& receiver = options_.receiver_points[receivers_.order[path.receiver]];
            path.path.occluded = !is_visible(*options_.accelerator, reflectors_, receiver, path, light_);
            statistics.occluded += path.path.occluded ? 1 : 0;
            if (!path.path.occluded || options_.keep_occluded) found[kept++] = path;
        }
        found.resize(kept);
    }

    void drop(const PathCut& cut) {
        ++statistics.dropped_cuts;
        const uint32_t shift = 4 * cut.receiver.level;
        const size_t begin = size_t{cut.receiver.index} << shift;
        const size_t end = std::min((size_t{cut.receiver.index} + 1) << shift, receivers_.tree.size);
        for (size_t i = begin; i < end; ++i) cut_short_.push_back(static_cast<uint32_t>(i));
    }

    const ReflectorTree& reflectors_;
    const ReceiverTree& receivers_;
    const PathLight& light_;
    const LitTriangles& lit_;
    const BeamSets& beams_;
    const SearchOptions& options_;
    uint64_t nodes_left_ = 0;
    std::vector<uint32_t> cut_short_;
};

/// The paths of a group in the form in which they are handed on.
struct GroupResult {
    std::vector<uint32_t> receivers;  ///< Of each path, in the order of the receiver tree.
    std::vector<RepresentativePath> paths;
    std::vector<ReflectorVertex> vertices;
    SearchStatistics statistics;
};

GroupResult pack(const std::vector<FoundPath>& found, const SearchStatistics& statistics) {
    GroupResult result;
    result.statistics = statistics;
    result.receivers.reserve(found.size());
    result.paths.reserve(found.size());
    size_t vertices = 0;
    for (const FoundPath& f : found) vertices += f.path.length;
    result.vertices.reserve(vertices);
    for (const FoundPath& f : found) {
        result.receivers.push_back(f.receiver);
        result.paths.push_back(f.path);
        result.paths.back().first_vertex = static_cast<uint32_t>(result.vertices.size());
        result.vertices.insert(result.vertices.end(), f.vertices.begin(), f.vertices.begin() + f.path.length);
    }
    return result;
}

/// Puts the groups' paths, of each light after the other, into the order in which the receivers were given. Frees each
/// group as it goes.
void collect(std::vector<GroupResult>& groups, const ReceiverTree& receivers, RepresentativePaths& result) {
    size_t vertices = 0;
    for (const GroupResult& group : groups) {
        result.statistics += group.statistics;
        vertices += group.vertices.size();
        for (const uint32_t receiver : group.receivers) ++result.first_path[receivers.order[receiver] + 1];
    }
    for (size_t i = 1; i < result.first_path.size(); ++i) result.first_path[i] += result.first_path[i - 1];
    std::vector<uint32_t> next(result.first_path.begin(), result.first_path.end() - 1);
    result.paths.resize(result.first_path.back());
    result.vertices.reserve(vertices);
    for (GroupResult& group : groups) {
        const auto first = static_cast<uint32_t>(result.vertices.size());
        result.vertices.insert(result.vertices.end(), group.vertices.begin(), group.vertices.end());
        for (size_t i = 0; i < group.paths.size(); ++i) {
            group.paths[i].first_vertex += first;
            result.paths[next[receivers.order[group.receivers[i]]]++] = group.paths[i];
        }
        group = {};
    }
}

/// The level at which there are enough nodes of receivers to keep all threads busy to the end.
uint32_t group_level(const ReceiverTree& receivers) {
    constexpr size_t enough_groups = 128;
    auto level = static_cast<uint32_t>(receivers.tree.levels.size() - 1);
    while (level > 0 && receivers.tree.items_at(level) < enough_groups) --level;
    return level;
}

/// About the golden section of `count`, without a common factor: groups in this order lie scattered over the receivers,
/// so that a search that is stopped has seen something of everything.
size_t scattering_stride(size_t count) {
    auto stride = static_cast<size_t>(0.618 * static_cast<double>(count)) | 1U;
    while (std::gcd(stride, count) != 1) ++stride;
    return stride;
}

}  // namespace

RepresentativePaths find_representative_paths(const ReflectorTree& reflectors, const ReceiverTree& receivers,
                                              std::span<const PathLight> lights, const SearchOptions& given) {
    SearchOptions options = given;
    options.bounces = std::clamp(options.bounces, 1, max_chain_length);
    options.shortest = std::clamp(options.shortest, 1, options.bounces);
    RepresentativePaths result;
    result.first_path.assign(receivers.given + 1, 0);
    if (receivers.tree.size == 0 || reflectors.size() == 0) return result;
    const uint32_t level = group_level(receivers);
    const size_t groups = receivers.tree.items_at(level);
    const size_t stride = scattering_stride(groups);
    std::vector<GroupResult> results(groups * lights.size());
    for (size_t l = 0; l < lights.size(); ++l) {
        const LitTriangles lit = find_lit_triangles(reflectors, lights[l], options.accelerator);
        BeamSets beams;
        if (options.bounces > 1 && options.selection == Selection::local_minima && options.solver.newton) {
            beams = trace_beams(reflectors, lights[l], lit, options.accelerator, options.bounces, options.max_beams,
                                options.should_stop);
        }
        result.beam_bytes = std::max(result.beam_bytes, beams.bytes());
        result.statistics.nodes_visited += beams.nodes_visited;
        result.statistics.dropped_beams += beams.dropped;
        tbb::parallel_for(size_t{0}, groups, [&](size_t i) {
            const size_t g = i * stride % groups;
            GroupSearch search(reflectors, receivers, lights[l], lit, beams, options);
            search.run({level, static_cast<uint32_t>(g)});
            for (FoundPath& path : search.found) path.path.light = static_cast<uint16_t>(l);
            results[l * groups + g] = pack(search.found, search.statistics);
        });
    }
    collect(results, receivers, result);
    return result;
}

}  // namespace nephroid

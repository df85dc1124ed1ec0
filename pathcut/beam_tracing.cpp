#include "pathcut/beam_tracing.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "pathcut/beam_descent.h"
#include "pathcut/beam_sampler.h"
#include "pathcut/skimming.h"

namespace nephroid {

namespace {

constexpr float weight_margin = 0.1F;    // Barycentric: how far outside of the parent's triangle light may come from.
constexpr float close_chord = 0.3F;      // Legs wider than this may join neighbours on one surface.
constexpr float unknown_weights = 0.5F;  // Barycentric: of light from anywhere on the parent's triangle.
constexpr float wide_error = 0.05F;      // Beams less certain than this are worth the samples that say where they go.

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
            const FloatV error = load_lanes<FloatV>(block.error, first);
            std::array<Triple<FloatV>, 3> corners;
            FloatV::mask_type behind(true);
            for (size_t corner = 0; corner < 3; ++corner) {
                corners[corner] = broadcast(to_triple(corners_[corner]));
                behind = behind && is_behind<FloatV>(t, wi, error, corners[corner]);
            }
            const uint32_t in_front = wanted & ~lane_bits(behind);
            if (in_front == 0) continue;
            std::array<Origins, 3> origins;
            for (size_t corner = 0; corner < 3; ++corner) {
                SlopeImage<FloatV> image = slope_image<FloatV>(t, wi, corners[corner]);
                image.error += error;
                origins[corner] = {image.weight1, image.weight2, weight_uncertainty(image),
                                   image.distance - image.error};
            }
            uint32_t lit = in_front & lane_bits(may_light(origins));
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
        if (!is_blocked(beam)) append(beam, beams);
    }

    /// By solving for the light at points of this triangle.
    void add_solved_beam(uint32_t parent, std::vector<Beam>& beams) const {
        const uint32_t source = incoming().triangle(parent);
        if (lies_in_plane(source)) return;
        BeamSampler sampler(reflectors_, light_, sampled_source(parent), sampled_target());
        const BeamSamples samples = sampler.run();
        if (!samples.reached) return;
        Beam beam;
        beam.triangle = triangle_;
        beam.parent = parent;
        const std::array<std::optional<Vec2>, 3> weights{samples.at_corner(0), samples.at_corner(1),
                                                         samples.at_corner(2)};
        const bool complete = weights[0] && weights[1] && weights[2];
        for (size_t corner = 0; corner < 3; ++corner) {
            set_origin(beam, corner, source, complete ? *weights[corner] : samples.mean_inside());
        }
        if (complete && !samples.folded) {
            measure_errors(beam, source, samples);
            if (!samples.all_solved()) allow_for_unsolved(beam, source);
        } else {
            beam.error = angular_size(source);
            beam.parent_error = unknown_weights;
            if (beam.error > wide_error) bound_leaving(beam, sampler, samples);
        }
        if (!is_blocked(beam) || !is_blocked(source, samples)) append(beam, beams);
    }

    /// Not even the other way round can light get to a triangle in this one's plane.
    bool lies_in_plane(uint32_t source) const {
        constexpr float in_plane = 1e-5F;  // Sine.
        const Vec3 normal = glm::normalize(glm::cross(corners_[1] - corners_[0], corners_[2] - corners_[0]));
        for (size_t k = 0; k < 3; ++k) {
            const Vec3 to = reflectors_.position(source, k) - corners_[0];
            if (std::abs(glm::dot(to, normal)) > in_plane * glm::length(to)) return false;
        }
        return true;
    }

    SampledSource sampled_source(uint32_t parent) const {
        SampledSource source;
        source.chain = chain_triangles(sets_, incoming_length_, parent);
        source.length = incoming_length_;
        const BeamBlock& block = incoming().blocks[parent / block_size];
        const size_t lane = parent % block_size;
        for (size_t corner = 0; corner < 3; ++corner) {
            const auto& w = block.wi[corner];
            source.wi[corner] = {w[0][lane], w[1][lane], w[2][lane]};
        }
        source.error = block.error[lane];
        return source;
    }

    SampledTarget sampled_target() const {
        return {corners_,
                {reflectors_.normal(triangle_, 0), reflectors_.normal(triangle_, 1), reflectors_.normal(triangle_, 2)}};
    }

    /// How far light at the samples is from linear in between the corners; twice that is allowed for.
    void measure_errors(Beam& beam, uint32_t source, const BeamSamples& samples) const {
        for (size_t i = 0; i < samples.at.size(); ++i) {
            if (!samples.at[i].solved) continue;
            const Vec3& at = beam_sample_points[i];
            const Vec3 linear = beam.wi[0] * at[0] + beam.wi[1] * at[1] + beam.wi[2] * at[2];
            const auto& weights = beam.parent_weights;
            const Vec2 linear_weights = weights[0] * at[0] + weights[1] * at[1] + weights[2] * at[2];
            const Vec3 to_origin = reflectors_.point(source, samples.at[i].weights) - weighted(corners_, at);
            const Vec3 off = glm::normalize(to_origin) - glm::normalize(linear);
            beam.error = std::max(beam.error, 2.0F * glm::length(off));
            beam.parent_error = std::max(beam.parent_error, 2.0F * glm::length(samples.at[i].weights - linear_weights));
        }
    }

    /// Where the light of a corner could not be followed to, it may bend more than the rest tells.
    void allow_for_unsolved(Beam& beam, uint32_t source) const {
        constexpr float least_share = 0.2F, least_weights = 0.25F;
        beam.error = std::max(beam.error, least_share * angular_size(source));
        beam.parent_error = std::max(beam.parent_error, least_weights);
    }

    static void bound_leaving(Beam& beam, BeamSampler& sampler, const BeamSamples& samples) {
        const LeavingCone cone = sampler.leaving(samples);
        beam.leaving = cone.axis;
        beam.leaving_angle = cone.angle;
    }

    static void append(const Beam& beam, std::vector<Beam>& beams) {
        const Vec3 sum = beam.wi[0] + beam.wi[1] + beam.wi[2];
        if (std::isfinite(sum.x + sum.y + sum.z)) beams.push_back(beam);
    }

    /// Whether something is in the way of the beam's light to all corners and to the centroid.
    bool is_blocked(const Beam& beam) const {
        if (accelerator_ == nullptr) return false;
        const Vec2 mean = (beam.parent_weights[0] + beam.parent_weights[1] + beam.parent_weights[2]) / 3.0F;
        const SurfacePatch patch = reflectors_.patch(incoming().triangle(beam.parent));
        for (size_t i = 0; i < 4; ++i) {
            const Vec3 to = i < 3 ? corners_[i] : centroid();
            if (!is_occluded(patch, i < 3 ? beam.parent_weights[i] : mean, to)) return false;
        }
        return true;
    }

    /// Whether something is in the way of the light to all samples that come from inside of the source.
    bool is_blocked(uint32_t source, const BeamSamples& samples) const {
        const SurfacePatch patch = reflectors_.patch(source);
        for (size_t i = 0; i < samples.at.size(); ++i) {
            const BeamSample& sample = samples.at[i];
            if (!sample.inside) continue;
            if (!is_occluded(patch, sample.weights, weighted(corners_, beam_sample_points[i]))) return false;
        }
        return true;
    }

    Vec3 centroid() const { return (corners_[0] + corners_[1] + corners_[2]) / 3.0F; }

    /// Between points a little inwards of those given. Both ends are left out, so that neither triangle counts.
    bool is_occluded(const SurfacePatch& source, const Vec2& weights, const Vec3& point) const {
        constexpr float left_out = 1e-3F, inwards = 0.1F;
        const Vec3 to = glm::mix(point, centroid(), inwards);
        const Vec2d inside = closest_inside(source, Vec2d(weights));
        const Vec3 from(evaluate(source, glm::mix(inside, triangle_centre, double{inwards})).position);
        const Vec3 between = to - from;
        return accelerator_->occluded({from + between * left_out, between * (1.0F - 2.0F * left_out), 1.0F});
    }

    void set_origin(Beam& beam, size_t corner, uint32_t source, const Vec2& weights) const {
        beam.parent_weights[corner] = weights;
        beam.wi[corner] = glm::normalize(reflectors_.point(source, weights) - corners_[corner]);
    }

    /// Of the source as this triangle sees it: radius over distance.
    float angular_size(uint32_t source) const {
        const PointBound<float> points = reflectors_.bound(source).points;
        return points.radius * make_leg(bound_.points, points).inverse_distance;
    }

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

}  // namespace

size_t BeamSets::bytes() const {
    size_t sum = 0;
    for (const BeamSet& set : by_length) sum += set.bytes();
    return sum;
}

BeamSets trace_beams(const ReflectorTree& reflectors, const PathLight& light, const LitTriangles& lit,
                     const Accelerator* accelerator, int length, size_t max_beams,
                     const std::function<bool()>& should_stop) {
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
            for (size_t triangle = block * block_size; triangle < end && !(should_stop && should_stop()); ++triangle) {
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

}  // namespace nephroid

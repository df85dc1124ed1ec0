#include "pathcut/beam_sampler.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "pathcut/bounding.h"

namespace nephroid {

namespace {

constexpr double furthest_near = 3.0;      // Barycentric, from the triangles' centres: how far light is followed.
constexpr int few_iterations = 8;          // Enough from within that distance.
constexpr double inside_tolerance = 1e-9;  // Barycentric: light from an edge belongs to both of its triangles.
constexpr int leaving_rows = 8;            // Of points on a triangle, to see where it reflects a beam to.

WholeTriangle whole_triangle(const ReflectorTree& reflectors, uint32_t triangle) {
    WholeTriangle whole;
    for (size_t corner = 0; corner < 3; ++corner) {
        whole.positions[corner] = to_triple(reflectors.position(triangle, corner));
        whole.normals[corner] = to_triple(reflectors.normal(triangle, corner));
    }
    whole.max_slope = reflectors.max_slope(triangle);
    return whole;
}

LeavingCone cone_around(const std::vector<Vec3>& directions) {
    constexpr float wider = 1.25F, margin = 0.1F;         // What is between the points.
    constexpr float widest = 1.5F, margin_of_few = 0.2F;  // What few points say less about.
    constexpr size_t few = 8;
    Vec3 axis(0.0F);
    for (const Vec3& direction : directions) axis += direction;
    double extent = 0.0;
    for (const Vec3& direction : directions) extent = std::max(extent, angle_between(Vec3d(direction), Vec3d(axis)));
    const float angle = static_cast<float>(extent) * wider + margin + (directions.size() < few ? margin_of_few : 0.0F);
    if (!(glm::length(axis) > 0.0F) || !(angle < widest)) return {};
    return {glm::normalize(axis), angle};
}

}  // namespace

bool BeamSamples::all_solved() const {
    return std::all_of(at.begin(), at.end(), [](const BeamSample& sample) { return sample.solved; });
}

Vec2 BeamSamples::mean_inside() const {
    Vec2 sum(0.0F);
    float count = 0.0F;
    for (const BeamSample& sample : at) {
        if (!sample.inside) continue;
        sum += sample.weights;
        count += 1.0F;
    }
    return sum / count;
}

std::optional<Vec2> BeamSamples::at_corner(size_t corner) const {
    if (at[corner].solved) return at[corner].weights;
    const size_t next = (corner + 1) % 3, last = (corner + 2) % 3;
    // In the middles of the edges that start there, end there and are opposite.
    const BeamSample &after = at[3 + corner], &before = at[3 + last], &opposite = at[3 + next], &centre = at[6];
    if (after.solved && before.solved && opposite.solved) return after.weights + before.weights - opposite.weights;
    if (after.solved && at[next].solved) return 2.0F * after.weights - at[next].weights;
    if (before.solved && at[last].solved) return 2.0F * before.weights - at[last].weights;
    if (centre.solved && opposite.solved) return 3.0F * centre.weights - 2.0F * opposite.weights;
    return std::nullopt;
}

BeamSampler::BeamSampler(const ReflectorTree& reflectors, const PathLight& light, const SampledSource& source,
                         const SampledTarget& target)
    : reflectors_(reflectors),
      light_(light),
      source_(source),
      target_(target),
      whole_(whole_triangle(reflectors, source.chain[0])) {
    for (size_t corner = 0; corner < 3; ++corner) wi_[corner] = to_triple(source.wi[corner]);
}

BeamSamples BeamSampler::run() {
    BeamSamples samples;
    std::array<PieceImages, beam_sample_points.size()> images;
    bool possible = false, upright = false, mirrored = false;
    for (size_t i = 0; i < images.size(); ++i) {
        images[i] = piece_images(weighted(target_.corners, beam_sample_points[i]));
        possible = possible || images[i].possible;
        upright = upright || images[i].upright;
        mirrored = mirrored || images[i].mirrored;
    }
    if (!possible) return samples;
    samples.folded = upright && mirrored;
    make_tuple_chain(reflectors_, std::span(source_.chain).first(source_.length), target_.corners[0], light_, tuple_);
    ChainPosition known{};
    for (size_t i = 0; i < images.size(); ++i) {
        if (!images[i].possible) continue;
        ChainPosition position = start_at(images[i].start);
        samples.at[i] = solve(weighted(target_.corners, beam_sample_points[i]), position);
        if (!samples.at[i].inside || samples.reached) continue;
        samples.reached = true;
        known = position;
    }
    for (size_t i = 0; i < images.size() && samples.reached; ++i) {
        if (samples.at[i].solved) continue;
        ChainPosition position = known;
        samples.at[i] = solve(weighted(target_.corners, beam_sample_points[i]), position);
    }
    return samples;
}

LeavingCone BeamSampler::leaving(const BeamSamples& samples) {
    constexpr float inwards = 0.03F;  // Not on what the triangle may touch.
    std::vector<Vec3> directions;
    ChainPosition known{};
    for (size_t i = 0; i < samples.at.size(); ++i) {
        if (!samples.at[i].inside) continue;
        directions.push_back(reflected(beam_sample_points[i], samples.at[i]));
        known = start_at(samples.at[i].weights);
    }
    for (int j = 0; j <= leaving_rows; ++j) {
        for (int i = 0; i + j <= leaving_rows; ++i) {
            const Vec3 grid = Vec3(leaving_rows - i - j, i, j) / static_cast<float>(leaving_rows);
            const Vec3 at = glm::mix(grid, Vec3(1.0F / 3.0F), inwards), point = weighted(target_.corners, at);
            const PieceImages images = piece_images(point);
            if (!images.possible) continue;
            for (ChainPosition position : {start_at(images.start), known}) {
                const BeamSample sample = solve(point, position);
                if (sample.inside) directions.push_back(reflected(at, sample));
            }
        }
    }
    return cone_around(directions);
}

Vec3 BeamSampler::reflected(const Vec3& at, const BeamSample& sample) const {
    const Vec3 n = glm::normalize(weighted(target_.normals, at));
    const Vec3 to_origin = reflectors_.point(source_.chain[0], sample.weights) - weighted(target_.corners, at);
    const Vec3 wi = glm::normalize(to_origin);
    return n * (2.0F * glm::dot(wi, n)) - wi;
}

NEPHROID_FLATTEN BeamSampler::PieceImages BeamSampler::piece_images(const Vec3& point) const {
    const Triple<FloatV> receiver = broadcast(to_triple(point));
    const FloatV error(source_.error);
    PieceImages result;
    float best = std::numeric_limits<float>::infinity();
    for (size_t first = 0; first < piece_count; first += simd_width) {
        const TriangleLanes<FloatV> pieces = pieces_of(whole_, first);
        const IncomingDirections<FloatV> wi =
            source_.length == 1 ? directions_to<FloatV>(light_, pieces) : piece_directions(wi_, first);
        SlopeImage<FloatV> image = slope_image<FloatV>(pieces, wi, receiver);
        image.error += error;
        uint32_t possible =
            lane_bits(!(image.distance > image.error) && !is_behind<FloatV>(pieces, wi, error, receiver));
        if (possible == 0) continue;
        const FloatV least = longest_edge(image) * image.error;
        result.possible = true;
        result.upright = result.upright || (possible & lane_bits(!(image.area < -least))) != 0;
        result.mirrored = result.mirrored || (possible & lane_bits(!(image.area > least))) != 0;
        for (; possible != 0; possible &= possible - 1) {
            const auto lane = static_cast<size_t>(std::countr_zero(possible));
            if (!(image.distance[lane] < best)) continue;
            best = image.distance[lane];
            result.start = weights_in_whole(first + lane, lowest_point(image, lane));
        }
    }
    return result;
}

/// Barycentric, on the beam's triangle; in the middle of those behind it.
ChainPosition BeamSampler::start_at(const Vec2& weights) const {
    ChainPosition position;
    position.fill(triangle_centre);
    position[0] = Vec2d(weights);
    return position;
}

/// From `position`, which becomes the solution.
BeamSample BeamSampler::solve(const Vec3& point, ChainPosition& position) {
    SpecularChain& chain = tuple_.chain;
    chain.receiver = Vec3d(point);
    SolverWork work;
    BeamSample sample;
    ChainState state = make_state(chain, position, Region::planes, work);
    if (!state.evaluation.valid) return sample;
    descend(chain, state, Region::planes, few_iterations, work, furthest_near);
    if (!(largest_slope(chain, state.evaluation) <= exact_slope)) return sample;
    position = state.position;
    sample.weights = Vec2(position[0]);
    sample.solved = true;
    sample.inside =
        state.evaluation.admissible && light_.shines_on(state.evaluation.points[source_.length - 1].position);
    for (size_t i = 0; i < source_.length; ++i) {
        sample.inside = sample.inside && is_inside(position[i], inside_tolerance);
    }
    return sample;
}

}  // namespace nephroid

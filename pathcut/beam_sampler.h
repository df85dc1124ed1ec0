// Where the light comes from that a beam brings to points of a triangle, solved for: where a linear image of the beam's
// triangle says too little, because the two are close or the image folds.
//
// Images of the beam's triangle in pieces come first: most of these beams do not reach the other triangle at all.
#pragma once

#include <optional>

#include "pathcut/triangle_pieces.h"
#include "pathcut/tuple_solver.h"

namespace nephroid {

/// Points of a triangle, as weights of its corners: the corners first, close to but not on what they may touch.
inline constexpr std::array<Vec3, 7> beam_sample_points{
    Vec3(0.98F, 0.01F, 0.01F), Vec3(0.01F, 0.98F, 0.01F), Vec3(0.01F, 0.01F, 0.98F), Vec3(0.5F, 0.5F, 0.0F),
    Vec3(0.0F, 0.5F, 0.5F),    Vec3(0.5F, 0.0F, 0.5F),    Vec3(1.0F / 3.0F)};

inline Vec3 weighted(const std::array<Vec3, 3>& corners, const Vec3& weights) {
    return corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
}

/// The beam that light is looked for in.
struct SampledSource {
    PerVertex<uint32_t> chain{};  ///< Its triangles, its own first.
    size_t length = 0;            ///< Reflections.
    std::array<Vec3, 3> wi{};     ///< As in Beam.
    float error = 0.0F;           ///< As in Beam.
};

/// The triangle that it may reach.
struct SampledTarget {
    std::array<Vec3, 3> corners, normals;
};

/// Light for one point.
struct BeamSample {
    Vec2 weights{0.0F};   ///< Barycentric, on the beam's triangle: where it comes from.
    bool solved = false;  ///< Found, maybe outside of the triangles: light of another beam.
    bool inside = false;  ///< Of all triangles of the chain.
};

struct BeamSamples {
    std::array<BeamSample, beam_sample_points.size()> at;
    bool reached = false;  ///< There is light for some point.
    bool folded = false;   ///< Light may come from both sides of a fold.

    bool all_solved() const;
    /// Where the light comes from on average. At least one sample must be inside.
    Vec2 mean_inside() const;
    /// Where the light for corner `corner` comes from, as the other points say if it was not found; none if they do
    /// not. A straight continuation, it may be far outside.
    std::optional<Vec2> at_corner(size_t corner) const;
};

/// A cone of directions.
struct LeavingCone {
    Vec3 axis{0.0F, 0.0F, 1.0F};
    float angle = 4.0F;  ///< Half of its opening, radians; above pi: nothing is known.
};

class BeamSampler {
  public:
    BeamSampler(const ReflectorTree& reflectors, const PathLight& light, const SampledSource& source,
                const SampledTarget& target);

    /// Light for `beam_sample_points`. Where some is found, that of the other points is followed from there.
    BeamSamples run();

    /// Where the target reflects the light to: from more points, for beams that only reach a part of it. Not
    /// conservative; the cone is wider than what was found.
    LeavingCone leaving(const BeamSamples& samples);

  private:
    /// What the images of a triangle's pieces say about light for one point.
    struct PieceImages {
        bool possible = false;  ///< Some piece may send any:
        bool upright = false;   ///< one that keeps its orientation in slope space, as far as can be told,
        bool mirrored = false;  ///< or one that changes it.
        Vec2 start{0.0F};       ///< Barycentric, on the triangle: where light most likely comes from.
    };
    PieceImages piece_images(const Vec3& point) const;
    BeamSample solve(const Vec3& point, ChainPosition& position);
    ChainPosition start_at(const Vec2& weights) const;
    Vec3 reflected(const Vec3& at, const BeamSample& sample) const;

    const ReflectorTree& reflectors_;
    const PathLight& light_;
    SampledSource source_;
    SampledTarget target_;
    WholeTriangle whole_;
    std::array<Triple<float>, 3> wi_;
    TuplePatches tuple_;
};

}  // namespace nephroid

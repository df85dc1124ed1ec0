// What a path tracer asks of a guide: at every vertex of a wave, a mixture of directions to sample from besides the
// BSDF. The guided integrator's lobes and PPG's trees both answer to this interface.
//
// The estimator is unbiased whatever the mixtures are, as long as `pdf` and `light_pdf` are the density of what
// `sample` draws at the same point. Virtual per wave, not per ray.
#pragma once

#include <algorithm>
#include <memory>
#include <span>

#include "accel/wave_array.h"
#include "core/bsdf.h"

namespace nephroid {

/// A wave of vertices and what the guide decides for them. Arrays of `count` entries, world space; those by reference
/// belong to the caller.
struct GuideBatch {
    explicit GuideBatch(size_t capacity)
        : u_choice(capacity),
          u(capacity),
          v(capacity),
          direction(capacity),
          fraction(capacity),
          pdf(capacity),
          light_pdf(capacity),
          guided(capacity),
          place(capacity),
          density_wanted(capacity) {
        std::fill_n(density_wanted.data(), capacity, 1.0F);
    }

    size_t count = 0;
    bool wants_light_pdf = false;  ///< Otherwise light_direction is not read and light_pdf not written.

    // Given.
    PathArray<float> u_choice, u, v;  ///< Random numbers in [0, 1): guide or BSDF and which lobe; the direction.
                                      ///< u_choice = 1: the direction given stays.

    // Given and changed.
    TripleArray direction;  ///< As the BSDF's sampling has it; replaced where the guide takes over. Unit.

    PathArray<float> fraction;  ///< Given zero: no guide is wanted here. Then the probability with which the guide
                                ///< chooses the direction; zero where it knows nothing.

    // Answered, where fraction > 0.
    PathArray<float> pdf;        ///< The mixture's density of `direction`, per solid angle; zero: left out.
    PathArray<float> light_pdf;  ///< The same of light_direction.
    PathArray<float> guided;     ///< 1: the direction is the guide's; also where fraction is zero.
    PathArray<uint32_t> place;   ///< The cached point, or the like, that `fraction` is of.
    static constexpr uint32_t no_place = ~0U;  ///< It is of none, but of the vertex itself as it is seen from wo.

    // Given; one unless the caller says otherwise.
    PathArray<float> density_wanted;  ///< Zero: pdf and light_pdf of a direction that stays may be left out.

    /// Whether the answer would be the same for any other wo.
    bool holds_for_any_wo(size_t k) const { return fraction[k] > 0.0F && place[k] != no_place; }
};

/// A vertex of a camera path: what a mixture may depend on.
struct GuideVertex {
    Vec3 position{0.0F};
    Vec3 geometric_normal{0.0F, 0.0F, 1.0F};  ///< Unit, on the side of wo.
    Vec3 shading_normal{0.0F, 0.0F, 1.0F};
    Vec3 wo{0.0F, 0.0F, 1.0F};  ///< Unit, to where the camera path comes from.
    BsdfParameters<float> bsdf{};
};

/// One that scatters evenly, whatever wo is.
inline GuideVertex diffuse_guide_vertex(const Vec3& position, const Vec3& normal) {
    GuideVertex vertex{position, normal, normal, normal, {}};
    vertex.bsdf.base = {1.0F, 1.0F, 1.0F};
    vertex.bsdf.alpha = 1.0F;
    return vertex;
}

/// The vertices of a batch.
struct GuidePoints {
    const TripleArray& position;
    const TripleArray& geometric_normal;  ///< Unit, on the side of wo.
    const TripleArray& light_direction;   ///< Unit; whose density is wanted too, where wants_light_pdf.
    const TripleArray& wo;                ///< Unit, to where the camera path comes from.
    const TripleArray& shading_normal;
    const TripleArray& base;
    const TripleArray& coat_f0;
    const PathArray<float>& coat_f90;
    const PathArray<float>& metallic;
    const PathArray<float>& alpha;

    GuideVertex get(size_t i) const {
        return {position.get(i),
                geometric_normal.get(i),
                shading_normal.get(i),
                wo.get(i),
                {to_triple(base.get(i)), to_triple(coat_f0.get(i)), coat_f90[i], metallic[i], alpha[i]}};
    }
};

/// One thread's state of a guide.
class GuideWorker {
  public:
    virtual ~GuideWorker() = default;
    virtual void guide(const GuidePoints& points, GuideBatch& batch) = 0;
    /// After guide() for the same points: the pdf of these vertices, where it was left out.
    virtual void find_densities(const GuidePoints&, std::span<const uint32_t>, GuideBatch&) {}
};

class DirectionalGuide {
  public:
    virtual ~DirectionalGuide() = default;
    virtual std::unique_ptr<GuideWorker> make_worker() const = 0;
    /// Metal of a smaller alpha is left to its BSDF, which is narrower than what the guide knows.
    virtual float least_alpha() const = 0;
    /// Whether paths may carry much light after a scattering of small throughput: where guided directions lead on to
    /// more reflections. Otherwise such paths may be ended early.
    virtual bool leads_on() const = 0;
    /// Whether it is meant for light from casters alone. Its directions count only where they meet one, and elsewhere
    /// the BSDF's by its own part of the density: most vertices can do without the guide's.
    virtual bool is_for_casters() const { return false; }
};

}  // namespace nephroid

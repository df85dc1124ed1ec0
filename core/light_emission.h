// Rays that leave the lights of a LightSet, for light paths and photons: in proportion to power, or small lights aimed
// at casters.
//
// Densities of emitted rays are per throughput (etendue, m^2 sr), which a ray keeps from end to end: the same number at
// the light and at the surface that the ray meets, and weight = radiance / density for every kind of light. For lights
// of no size it is what the density is per that weight is measured in: per area across the ray at the surface for
// directional lights, and for point and spot lights too, where it falls with the squared distance.
#pragma once

#include "core/aimed_emission.h"
#include "core/light_set.h"

namespace nephroid {

struct EmissionSample {
    Vec3 origin{0.0F};           ///< Clear of the light's own surface.
    Vec3 direction{0.0F};        ///< Unit, away from the light.
    Rgb weight{0.0F};            ///< Power that the ray carries, W: emission / density. Zero: no ray.
    uint32_t light = 0;          ///< Index in the LightSet.
    bool delta = false;          ///< No ray can hit the light.
    float direct_factor = 0.0F;  ///< For direct_density.
};

/// Where rays go.
enum class EmissionAim : uint8_t {
    everywhere,      ///< In proportion to power.
    mostly_casters,  ///< Small lights send three quarters of theirs to casters.
    casters_only,    ///< Small lights send all of theirs to casters; other lights, and those without casters, none.
};

class LightEmission {
  public:
    /// Keeps references.
    LightEmission(const Scene& scene, const LightSet& lights, const CasterReport& casters, EmissionAim aim);

    /// Some light has rays to send.
    bool emits() const { return !only_casters_ || selection_.size() > 0; }

    /// Rays that aim at casters go where these were worth most (AimedEmission::learn).
    void learn(std::span<const AimedRay> rays) { aimed_.learn(rays); }

    EmissionSample sample(float u_select, Vec2 u_position, Vec2 u_direction) const;

    /// Density of emitted rays, selection included, for the ray of `direction` (unit, away from the light) that meets
    /// x at this distance from the light. `direct_pdf` is LightSet::sample's for the same light and point.
    float ray_density(uint32_t light, float direct_pdf, const Vec3& x, const Vec3& direction, float distance) const;

    /// LightSet::sample's density at x of the light that a sample came from, where x is what its ray met.
    float direct_density(const EmissionSample& sample, const Vec3& x, float distance) const;

    const AimedEmission& aimed() const { return aimed_; }
    /// Density of a point, spot or sphere light's directions per solid angle, without selection.
    float direction_pdf(uint32_t light, const Vec3& direction) const;

  private:
    Vec3 sample_direction(uint32_t light, float u_choice, Vec2 u) const;
    void sample_punctual(EmissionSample& sample, float u_choice, Vec2 u_position, Vec2 u_direction) const;
    void sample_directional(EmissionSample& sample, float u_choice, Vec2 u) const;
    void sample_triangle(EmissionSample& sample, const TriangleLight& light, Vec2 u_position, Vec2 u_direction) const;
    void sample_environment(EmissionSample& sample, Vec2 u_position, Vec2 u_direction) const;
    /// Moves a point against the direction, out of the scene.
    Vec3 outside(const Vec3& point, const Vec3& direction) const;
    Vec3 sample_disc(const Vec3& direction, Vec2 u) const;
    float disc_pdf(uint32_t light, const Vec3& x) const;
    /// Of selecting the light.
    float probability(uint32_t light) const {
        return only_casters_ ? selection_.probability(light) : lights_.probability(light);
    }
    void select_lights_that_aim();

    const Scene& scene_;
    const LightSet& lights_;
    AimedEmission aimed_;
    float aimed_share_;  ///< Of a light's rays, where it aims.
    bool only_casters_;
    AliasTable selection_;  ///< Where only casters count: among the punctual lights.
    std::vector<float> triangle_densities_;
    Vec3 centre_{0.0F};  ///< Of a sphere about everything that light can meet.
    float radius_ = 1.0F;
    float disc_density_ = 0.0F;  ///< 1 / area of that sphere's cross-section.
};

}  // namespace nephroid

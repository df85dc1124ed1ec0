// Where small lights should send light paths: to the casters. A caustic of a small caster in a wide scene is otherwise
// hit by few of the paths that leave the light.
//
// For a point, spot or small sphere light: cones from its centre; for a directional light: discs across its direction;
// each holds a group of casters (by their vertices, so that it holds their triangles too). A cone or disc is chosen in
// proportion to its size and sampled uniformly, so that the density is the number of cones that hold a direction times
// a constant. It does not cover everything: LightEmission mixes it with a density that
// does, or leaves the rest to other strategies.
#pragma once

#include <cstdint>
#include <vector>

#include "core/casters.h"
#include "core/scene.h"

namespace nephroid {

class AimedEmission {
  public:
    /// Casters beyond this number share cones: neighbours are grouped.
    static constexpr size_t most_groups = 8;

    AimedEmission() = default;
    AimedEmission(const Scene& scene, const CasterReport& casters);

    /// Whether the light (index into Scene::lights) has casters to aim at.
    bool aims(uint32_t light) const { return light < targets_.size() && !targets_[light].regions.empty(); }

    /// For lights that aim and are not directional: a unit direction, and its density per solid angle.
    Vec3 sample_direction(uint32_t light, float u_choice, Vec2 u) const;
    float direction_pdf(uint32_t light, const Vec3& direction) const;

    /// For directional lights that aim: a point to aim a ray at, and the density of rays through a point, per area
    /// across the light's direction.
    Vec3 sample_point(uint32_t light, float u_choice, Vec2 u) const;
    float point_pdf(uint32_t light, const Vec3& point) const;

  private:
    /// A cone: axis and 1 - cos of its half angle; a disc: centre and radius^2. Sizes in proportion to what they
    /// cover.
    struct Region {
        Vec3 centre;
        float size;
    };
    struct Targets {
        std::vector<Region> regions;
        float total_size = 0.0F;
        Vec3 across{0.0F};  ///< Directional lights: their direction.
    };

    static void add_region(Targets& targets, const Region& region);
    static const Region& choose(const Targets& targets, float u);

    std::vector<Targets> targets_;  ///< Per light of Scene::lights; empty regions: aims at nothing.
};

}  // namespace nephroid

// Where small lights should send light paths: to the casters. A caustic of a small caster in a wide scene is otherwise
// hit by few of the paths that leave the light.
//
// For a point, spot or small sphere light: cones from its centre; for a directional light: discs across its direction;
// each holds a group of casters (by their vertices, so that it holds their triangles too). A cone or disc is chosen in
// proportion to its size and sampled uniformly, so that the density is the number of cones that hold a direction times
// a constant. It does not cover everything: LightEmission mixes it with a density that
// does, or leaves the rest to other strategies.
//
// Where rays pay can be learned: then each cone or disc has a grid of cells, in its own coordinates, so that the cells
// are as fine as the casters are small, and a share of the rays is still spread as before.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/alias_table.h"
#include "core/casters.h"
#include "core/scene.h"

namespace nephroid {

/// A ray of a small light and what it is worth.
struct AimedRay {
    uint32_t light = 0;  ///< Index into Scene::lights.
    Vec3 to{0.0F};       ///< Its unit direction; of a directional light: a point that it runs through.
    float weight = 0.0F;
};

class AimedEmission {
  public:
    /// Casters beyond this number share cones: neighbours are grouped.
    static constexpr size_t most_groups = 8;

    AimedEmission() = default;
    AimedEmission(const Scene& scene, const CasterReport& casters);

    /// Whether the light (index into Scene::lights) has casters to aim at.
    bool aims(uint32_t light) const { return light < targets_.size() && !targets_[light].regions.empty(); }

    /// From now on, rays go where these were worth most, as far as they aim at casters. Lights without any stay as they
    /// are.
    void learn(std::span<const AimedRay> rays);

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
        bool is_directional = false;
        Vec3 across{0.0F};  ///< Directional lights: their direction.
        AliasTable cells;   ///< Of all regions, one after the other; empty: nothing was learned.
    };

    static void add_region(Targets& targets, const Region& region);
    /// A region; `u` becomes the place in it.
    static const Region& choose(const Targets& targets, float u_choice, Vec2& u);
    /// Whether a direction or point lies in the region, and where in its unit square it then does: cheap and not.
    static bool holds(const Targets& targets, const Region& region, const Vec3& to);
    static Vec2 place_in(const Targets& targets, const Region& region, const Vec3& to);
    /// Sum over the regions of (density in the unit square) / (size of the region).
    static float density(const Targets& targets, const Vec3& to);

    std::vector<Targets> targets_;  ///< Per light of Scene::lights; empty regions: aims at nothing.
};

}  // namespace nephroid

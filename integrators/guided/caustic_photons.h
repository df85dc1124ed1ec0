// Light followed from the small lights over the casters to where it lands: a picture of the caustics that owes nothing
// to the search for paths, and so tells where its lobes fall short.
#pragma once

#include <span>
#include <vector>

#include "integrators/guided/guided_paths.h"

namespace nephroid {

struct CausticPhoton {
    Receiver at;            ///< Where it lands; without a footprint.
    Vec3 wi{0.0F};          ///< Unit, to where it comes from.
    float distance = 0.0F;  ///< To the reflector that it comes from, metres.
    float power = 0.0F;     ///< Luminance in W: the sum over the photons that land on an area is what it receives.
    float radiance = 0.0F;  ///< What a path traced from here along wi, on to the same vertices and to the light would
                            ///< bring, once, W/(m^2 sr) of luminance; from vertex to vertex by BSDF sampling.
    uint32_t reflections = 0;
    uint32_t light = 0;     ///< Whose it is: index into Scene::lights.
    uint32_t triangle = 0;  ///< Where it started: index into GuidedPaths::reflectors.
    Vec3 first_reflection{0.0F};
    Vec3 second_reflection{0.0F};  ///< If there was one.
};

/// Follows `count` photons of up to `most_reflections` reflections at casters. They start at points spread evenly over
/// the reflectors. All landings on surfaces that a guide serves are returned, in an order that does not depend on the
/// threads. Sphere lights count as points.
std::vector<CausticPhoton> trace_caustic_photons(const RenderContext& context, const GuidedPaths& prepared,
                                                 uint32_t count, uint32_t most_reflections);

/// Appends photons of two and more reflections, about `enough` but of no more than `most` paths, that start around the
/// starts of those that `useful` has indices of. `photons` are what trace_caustic_photons returned for `count`; the
/// powers of those of several reflections become shares of all, by the balance heuristic.
void add_long_photons(const RenderContext& context, const GuidedPaths& prepared, std::span<const uint32_t> useful,
                      uint32_t count, uint32_t most_reflections, double enough, uint32_t most,
                      std::vector<CausticPhoton>& photons);

}  // namespace nephroid

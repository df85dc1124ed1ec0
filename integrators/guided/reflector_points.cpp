#include "integrators/guided/reflector_points.h"

#include <cmath>
#include <unordered_set>

#include "core/rounding.h"
#include "core/scene.h"

namespace nephroid {

namespace {

/// Points' spacing is halved so many times at most, from the extent of all of them.
constexpr int most_halvings = 12;

/// A reflection that a camera path has to continue from, and a ray that shows it.
struct Reflection {
    Vec3 y{0.0F};
    Ray ray;
};

Reflection last_reflection(const CausticPhoton& photon) {
    const Receiver& at = photon.at;
    return {at.position + photon.wi * photon.distance,
            {offset_ray_origin(at.position, at.error, at.geometric_normal, photon.wi), photon.wi}};
}

/// Where lobes of one reflection lead to the light, whatever came before on the camera's side. The photon has flown
/// there from its first reflection: nothing is in the way from half of it.
Reflection second_reflection(const CausticPhoton& photon) {
    const Vec3 way = photon.second_reflection - photon.first_reflection;
    return {photon.second_reflection, {photon.first_reflection + 0.5F * way, glm::normalize(way)}};
}

std::vector<Reflection> later_reflections(const std::vector<CausticPhoton>& photons,
                                          const std::vector<PhotonCoverage>& coverage) {
    std::vector<Reflection> found;
    for (uint32_t i = 0; i < photons.size(); ++i) {
        const CausticPhoton& photon = photons[i];
        if (!(coverage[i].bsdf_pdf > 0.0F) || photon.reflections < 2) continue;
        found.push_back(last_reflection(photon));
        if (photon.reflections > 2 && photon.second_reflection != photon.first_reflection) {
            found.push_back(second_reflection(photon));
        }
    }
    return found;
}

uint64_t cell_of(const Vec3& y, const Vec3& corner, float size) {
    const Vec3 at = (y - corner) / size;
    uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) key = key << 21U | static_cast<uint64_t>(std::max(at[axis], 0.0F));
    return key;
}

/// The first one in each cell of a grid.
std::vector<Reflection> one_per_cell(const std::vector<Reflection>& all, const Vec3& corner, float size) {
    std::unordered_set<uint64_t> taken;
    std::vector<Reflection> kept;
    for (const Reflection& reflection : all) {
        if (taken.insert(cell_of(reflection.y, corner, size)).second) kept.push_back(reflection);
    }
    return kept;
}

}  // namespace

std::vector<Receiver> choose_reflector_points(const RenderContext& context, const std::vector<CausticPhoton>& photons,
                                              const std::vector<PhotonCoverage>& coverage, size_t most) {
    const std::vector<Reflection> all = later_reflections(photons, coverage);
    if (all.empty()) return {};
    Bounds bounds;
    for (const Reflection& reflection : all) bounds.extend(reflection.y);
    float size = glm::length(bounds.max - bounds.min);
    if (!(size > 0.0F) || !std::isfinite(size)) return {};
    std::vector<Reflection> kept;
    for (int i = 0; i < most_halvings; ++i) {
        std::vector<Reflection> finer = one_per_cell(all, bounds.min, 0.5F * size);
        if (finer.size() > most) break;
        kept = std::move(finer);
        size *= 0.5F;
    }
    std::vector<Receiver> points;
    for (const Reflection& reflection : kept) {
        const Hit hit = context.accelerator.intersect(reflection.ray);
        if (hit.object >= context.surfaces.object_count() || !context.surfaces.is_caster(hit.object)) continue;
        const SurfaceInteraction s =
            context.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -reflection.ray.direction);
        points.push_back({s.position, s.error, s.geometric_normal, s.shading_normal, s.bsdf.alpha, size, hit.object});
    }
    return points;
}

}  // namespace nephroid

#include "pathcut/lit_triangles.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "pathcut/cut_test.h"
#include "pathcut/visibility.h"

namespace nephroid {

namespace {

bool sees_light(const SurfacePatch& patch, const Vec2d& barycentrics, const PathLight& light,
                const Accelerator& accelerator) {
    const Vec3d position = evaluate(patch, barycentrics).position;
    const Vec3d to_light = light.at_infinity ? Vec3d(light.point) : Vec3d(light.point) - position;
    const bool behind = glm::dot(to_light, patch.geometric_normal) < 0.0;
    const Vec3d towards = behind ? -patch.geometric_normal : patch.geometric_normal;
    const SpecularPathView path{
        surface_point(position, Vec3(towards), patch.size), {}, light.end(), double{light.radius}};
    return is_visible(accelerator, path);
}

bool is_lit(const ReflectorTree& reflectors, uint32_t triangle, const PathLight& light,
            const Accelerator* accelerator) {
    if (!light.shines_everywhere() && outside_light_cone(light, make_leg(reflectors.bound(triangle).points, light))) {
        return false;
    }
    if (accelerator == nullptr) return true;
    constexpr std::array<Vec2d, 4> samples{triangle_centre, Vec2d(0.02, 0.02), Vec2d(0.96, 0.02), Vec2d(0.02, 0.96)};
    const SurfacePatch patch = reflectors.patch(triangle);
    return std::any_of(samples.begin(), samples.end(),
                       [&](const Vec2d& b) { return sees_light(patch, b, light, *accelerator); });
}

}  // namespace

LitTriangles find_lit_triangles(const ReflectorTree& reflectors, const PathLight& light,
                                const Accelerator* accelerator) {
    LitTriangles lit(reflectors.blocks.size(), 0);
    tbb::parallel_for(size_t{0}, lit.size(), [&](size_t block) {
        const size_t count = std::min(block_size, reflectors.size() - block * block_size);
        for (size_t lane = 0; lane < count; ++lane) {
            const auto triangle = static_cast<uint32_t>(block * block_size + lane);
            if (is_lit(reflectors, triangle, light, accelerator)) lit[block] |= static_cast<uint16_t>(1U << lane);
        }
    });
    return lit;
}

}  // namespace nephroid

#include "pathcut/path_visibility.h"

namespace nephroid {

bool is_visible(const Accelerator& accelerator, const ReflectorTree& reflectors, const SurfacePoint& receiver,
                const FoundPath& path, const PathLight& light) {
    PerVertex<SurfacePoint> points;
    for (size_t i = 0; i < path.path.length; ++i) {
        const SurfacePatch patch = reflectors.patch(path.vertices[i].triangle);
        const Vec2d barycentrics(path.vertices[i].b1, path.vertices[i].b2);
        points[i] = surface_point(evaluate(patch, barycentrics).position, Vec3(patch.geometric_normal), patch.size);
    }
    return is_visible(accelerator,
                      {receiver, std::span(points).first(path.path.length), light.end(), double{light.radius}});
}

}  // namespace nephroid

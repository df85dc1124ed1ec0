// A small light as the end of specular paths.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/light.h"
#include "pathcut/half_vector_constraint.h"

namespace nephroid {

struct PathLight {
    Vec3 point{0.0F};          ///< World space, metres; or the unit direction towards a light at infinity.
    float radius = 0.0F;       ///< Metres: of a small sphere light, whose centre is `point`.
    bool at_infinity = false;  ///< A directional light.
    Vec3 axis{0.0F};           ///< Unit; where a spot light shines to.
    float cos_cone = -1.0F;    ///< Of the half angle that is lit; the whole sphere by default.
    uint32_t index = 0;        ///< In Scene::lights.

    PathEnd end() const { return {Vec3d(point), at_infinity}; }
    bool shines_everywhere() const { return cos_cone <= -1.0F; }
    /// Whether any light leaves towards a point.
    bool shines_on(const Vec3d& p) const {
        if (shines_everywhere()) return true;
        const Vec3d away = p - Vec3d(point);
        return glm::dot(away, Vec3d(axis)) >= double{cos_cone} * glm::length(away);
    }
};

inline PathLight make_path_light(const PunctualLight& light, uint32_t index) {
    PathLight end;
    end.index = index;
    end.point = light.position;
    if (light.kind == LightKind::sphere) end.radius = light.radius;
    if (light.kind == LightKind::directional) {
        end.point = -light.direction;
        end.at_infinity = true;
    }
    if (light.kind == LightKind::spot) {
        end.axis = light.direction;
        end.cos_cone = light.cos_outer;
    }
    return end;
}

}  // namespace nephroid

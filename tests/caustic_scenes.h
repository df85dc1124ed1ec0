// Small scenes with caustics, and the exact radiance of their floors by quadrature.
#pragma once

#include <string>
#include <vector>

#include "core/camera.h"
#include "core/scene.h"

namespace nephroid::testing {

struct CausticScene {
    std::string name;
    Scene scene;  ///< Object 0 is a Lambert floor at y = 0 of albedo 0.6; light 0 the point light.
    Camera camera;
    int reflections = 1;             ///< Of the caustic to be looked at.
    std::vector<Vec3> floor_points;  ///< In the caustic, to be looked at closely.
};

CausticScene ring_caustic(float alpha);
CausticScene sphere_caustic(float alpha);
CausticScene bumpy_plane_caustic(float alpha);
/// Light by two reflections, at a trough and at a sheet.
CausticScene two_mirror_caustic(float alpha);
/// The sphere's caustic, seen in a glossy flat mirror.
CausticScene mirror_view_caustic(float alpha);

std::vector<CausticScene> all_caustic_scenes(float alpha);

/// Radiance of the floor at x, seen from above, by direct light and one reflection: quadrature over all reflecting
/// triangles, split until neither the slope changes by more than a tenth of its scale nor the distance to x within a
/// piece. Green channel.
double floor_radiance(const CausticScene& caustic, const Vec3& x);

}  // namespace nephroid::testing

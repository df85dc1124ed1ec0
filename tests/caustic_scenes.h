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
    float scale = 1.0F;              ///< How often `scaled` has enlarged it.
};

CausticScene ring_caustic(float alpha);
CausticScene sphere_caustic(float alpha);
/// A wall of rows x rows quads.
CausticScene bumpy_plane_caustic(float alpha, int rows = 40);
/// Light by two reflections, at a trough and at a sheet.
CausticScene two_mirror_caustic(float alpha);
/// The sphere's caustic, seen in a glossy flat mirror.
CausticScene mirror_view_caustic(float alpha);

/// All lengths times `factor`, and as much radiance as before.
CausticScene scaled(CausticScene caustic, float factor);

std::vector<CausticScene> all_caustic_scenes(float alpha);

/// Green channel, seen from above.
struct FloorRadiance {
    double direct = 0.0;
    double reflected = 0.0;  ///< By one reflection.
};

/// Radiance of the floor at x by quadrature over all metal triangles, split until neither the half vector's angle
/// changes by more than about a seventh of what its density changes over, nor the distance to x by a tenth, within a
/// piece. Metal of any roughness counts, casters or not.
FloorRadiance floor_radiance_parts(const CausticScene& caustic, const Vec3& x);
/// Both parts together.
double floor_radiance(const CausticScene& caustic, const Vec3& x);

}  // namespace nephroid::testing

// Reflectors of exact shape, as the path-cut tests and the benchmark need them: any number of triangles, exact normals.
#pragma once

#include <functional>
#include <vector>

#include "pathcut/reflector_tree.h"

namespace nephroid::testing {

struct ShapePoint {
    Vec3d position;
    Vec3d normal;  ///< Any length.
};
/// A surface over the unit square.
using Shape = std::function<ShapePoint(double u, double v)>;

/// Appends columns x rows quads, split in two, with vertices on the surface. Each call is another object.
void add_shape(std::vector<ReflectorTriangle>& triangles, const Shape& shape, int columns, int rows, float alpha);
/// About `count` triangles, quads as square as `aspect` (length along u over length along v) makes them.
void add_shape(std::vector<ReflectorTriangle>& triangles, const Shape& shape, int count, double aspect, float alpha);

Shape sphere_shape(const Vec3d& centre, double radius);
/// About the y axis.
Shape torus_shape(const Vec3d& centre, double major_radius, double minor_radius);
/// Part of a cylinder about the z axis, between two angles from the x axis towards y; normals point outwards.
Shape cylinder_shape(const Vec3d& centre, double radius, double length, double begin_angle, double end_angle);
/// The same with bumps: radius * (1 + amplitude sin(frequency angle) sin(frequency z / radius)).
Shape bumpy_cylinder_shape(const Vec3d& centre, double radius, double length, double begin_angle, double end_angle,
                           double amplitude, double frequency);
/// A square of side 2 half_width about `centre`, normal along y, with waves of that height and count.
Shape bumpy_plane_shape(const Vec3d& centre, double half_width, double height, double waves);
/// The lower part of a sphere, seen from inside, up to `opening` radians from its lowest point.
Shape bowl_shape(const Vec3d& centre, double radius, double opening);
/// A parallelogram.
Shape flat_shape(const Vec3d& corner, const Vec3d& a, const Vec3d& b);

}  // namespace nephroid::testing

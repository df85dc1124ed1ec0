#include "tests/reflector_shapes.h"

#include <algorithm>
#include <cmath>

namespace nephroid::testing {

namespace {

constexpr double pi_double = 3.14159265358979323846;

}  // namespace

void add_shape(std::vector<ReflectorTriangle>& triangles, const Shape& shape, int columns, int rows, float alpha) {
    const uint32_t object = triangles.empty() ? 0 : triangles.back().id.object + 1;
    uint32_t primitive = 0;
    const auto point = [&](int i, int j) {
        return shape(static_cast<double>(i) / columns, static_cast<double>(j) / rows);
    };
    const auto add = [&](const ShapePoint& a, const ShapePoint& b, const ShapePoint& c) {
        ReflectorTriangle t;
        t.positions = {Vec3(a.position), Vec3(b.position), Vec3(c.position)};
        t.normals = {Vec3(glm::normalize(a.normal)), Vec3(glm::normalize(b.normal)), Vec3(glm::normalize(c.normal))};
        t.alpha = alpha;
        t.id = {object, primitive++};
        triangles.push_back(t);
    };
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
            const ShapePoint a = point(i, j), b = point(i + 1, j), c = point(i + 1, j + 1), d = point(i, j + 1);
            add(a, b, c);
            add(a, c, d);
        }
    }
}

void add_shape(std::vector<ReflectorTriangle>& triangles, const Shape& shape, int count, double aspect, float alpha) {
    const int rows = std::max(1, static_cast<int>(std::lround(std::sqrt(count / 2.0 / aspect))));
    add_shape(triangles, shape, std::max(1, count / 2 / rows), rows, alpha);
}

Shape sphere_shape(const Vec3d& centre, double radius) {
    return [=](double u, double v) {
        const double phi = 2.0 * pi_double * u, theta = pi_double * v;
        const Vec3d n(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
        return ShapePoint{centre + n * radius, n};
    };
}

Shape torus_shape(const Vec3d& centre, double major_radius, double minor_radius) {
    return [=](double u, double v) {
        const double phi = 2.0 * pi_double * u, theta = 2.0 * pi_double * v;
        const Vec3d out(std::cos(phi), 0.0, std::sin(phi));
        const Vec3d n = out * std::cos(theta) + Vec3d(0.0, std::sin(theta), 0.0);
        return ShapePoint{centre + out * major_radius + n * minor_radius, n};
    };
}

Shape cylinder_shape(const Vec3d& centre, double radius, double length, double begin_angle, double end_angle) {
    return [=](double u, double v) {
        const double phi = begin_angle + (end_angle - begin_angle) * u;
        const Vec3d n(std::cos(phi), std::sin(phi), 0.0);
        return ShapePoint{centre + n * radius + Vec3d(0.0, 0.0, length * (v - 0.5)), n};
    };
}

Shape bumpy_cylinder_shape(const Vec3d& centre, double radius, double length, double begin_angle, double end_angle,
                           double amplitude, double frequency) {
    return [=](double u, double v) {
        const double phi = begin_angle + (end_angle - begin_angle) * u, z = length * (v - 0.5);
        const double a = frequency * phi, b = frequency * z / radius;
        const double r = radius * (1.0 + amplitude * std::sin(a) * std::sin(b));
        const double r_phi = radius * amplitude * frequency * std::cos(a) * std::sin(b);
        const double r_z = amplitude * frequency * std::sin(a) * std::cos(b);
        const Vec3d out(std::cos(phi), std::sin(phi), 0.0), along(-std::sin(phi), std::cos(phi), 0.0);
        const Vec3d by_phi = out * r_phi + along * r, by_z = out * r_z + Vec3d(0.0, 0.0, 1.0);
        return ShapePoint{centre + out * r + Vec3d(0.0, 0.0, z), glm::cross(by_phi, by_z)};
    };
}

Shape bumpy_plane_shape(const Vec3d& centre, double half_width, double height, double waves) {
    return [=](double u, double v) {
        const double x = half_width * (2.0 * u - 1.0), z = half_width * (2.0 * v - 1.0);
        const double k = pi_double * waves / half_width;
        // Two crossed waves of different direction: no two bumps alike.
        const double a = k * (x + 0.3 * z), b = k * (0.7 * z - 0.2 * x);
        const double y = height * std::sin(a) * std::cos(b);
        const double y_a = height * std::cos(a) * std::cos(b), y_b = -height * std::sin(a) * std::sin(b);
        const double y_x = k * (y_a - 0.2 * y_b), y_z = k * (0.3 * y_a + 0.7 * y_b);
        return ShapePoint{centre + Vec3d(x, y, z), Vec3d(-y_x, 1.0, -y_z)};
    };
}

Shape bowl_shape(const Vec3d& centre, double radius, double opening) {
    return [=](double u, double v) {
        const double phi = 2.0 * pi_double * u, theta = opening * v;
        const Vec3d out(std::sin(theta) * std::cos(phi), -std::cos(theta), std::sin(theta) * std::sin(phi));
        return ShapePoint{centre + out * radius, -out};
    };
}

Shape flat_shape(const Vec3d& corner, const Vec3d& a, const Vec3d& b) {
    return [=](double u, double v) { return ShapePoint{corner + a * u + b * v, glm::cross(a, b)}; };
}

}  // namespace nephroid::testing

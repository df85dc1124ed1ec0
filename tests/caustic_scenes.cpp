#include "tests/caustic_scenes.h"

#include <cmath>

#include "accel/accelerator.h"
#include "accel/surface.h"
#include "core/casters.h"
#include "core/rounding.h"
#include "pathcut/half_vector_constraint.h"
#include "pathcut/reflector_tree.h"
#include "tests/reflector_shapes.h"
#include "tests/test_scenes.h"

namespace nephroid::testing {

namespace {

constexpr float floor_albedo = 0.6F;
constexpr int floor_material = 0, metal_material = 1;

Mesh shape_mesh(const Shape& shape, int columns, int rows, int material) {
    Mesh mesh;
    mesh.material = material;
    for (int row = 0; row <= rows; ++row) {
        for (int column = 0; column <= columns; ++column) {
            const ShapePoint point = shape(static_cast<double>(column) / columns, static_cast<double>(row) / rows);
            mesh.positions.push_back(Vec3(point.position));
            mesh.normals.push_back(glm::normalize(Vec3(point.normal)));
        }
    }
    mesh.positions.reserve(mesh.positions.size() + 1);
    const auto index = [columns](int column, int row) { return static_cast<uint32_t>(row * (columns + 1) + column); };
    for (int row = 0; row < rows; ++row) {
        for (int column = 0; column < columns; ++column) {
            const uint32_t a = index(column, row), b = index(column + 1, row);
            const uint32_t c = index(column + 1, row + 1), d = index(column, row + 1);
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({a, c, d});
        }
    }
    return mesh;
}

CausticScene with_floor(const std::string& name, float alpha, const Vec3& light, float intensity) {
    CausticScene caustic;
    caustic.name = name;
    caustic.scene.materials = {lambert(Rgb(floor_albedo)), metal(Rgb(0.9F), alpha)};
    add_mesh(caustic.scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, floor_material));
    caustic.scene.lights = {point_light(light, Rgb(intensity))};
    return caustic;
}

}  // namespace

CausticScene ring_caustic(float alpha) {
    CausticScene caustic = with_floor("ring", alpha, {-1.5F, 1.8F, 0.0F}, 10.0F);
    // The inside of a standing cylinder about the y axis.
    const Shape inside = [](double u, double v) {
        const double angle = 2.0 * 3.14159265358979 * u;
        const Vec3d out(std::cos(angle), 0.0, std::sin(angle));
        return ShapePoint{out + Vec3d(0.0, 0.02 + 0.5 * v, 0.0), -out};
    };
    add_mesh(caustic.scene, shape_mesh(inside, 120, 6, metal_material));
    caustic.camera = look_at({0.0F, 3.0F, 0.6F}, {0.0F, 0.0F, 0.0F}, 0.6F);
    caustic.floor_points = {{0.45F, 0.0F, 0.1F}, {0.6F, 0.0F, -0.25F}};
    return caustic;
}

CausticScene sphere_caustic(float alpha) {
    CausticScene caustic = with_floor("sphere", alpha, {-2.0F, 1.2F, 0.0F}, 10.0F);
    add_mesh(caustic.scene, sphere({0.0F, 0.6F, 0.0F}, 0.5F, 24, metal_material));
    caustic.camera = look_at({0.0F, 3.0F, 1.5F}, {-0.5F, 0.0F, 0.0F}, 0.6F);
    caustic.floor_points = {{-0.9F, 0.0F, 0.3F}, {-0.7F, 0.0F, 0.0F}};
    return caustic;
}

CausticScene bumpy_plane_caustic(float alpha, int rows) {
    CausticScene caustic = with_floor("bumpy plane", alpha, {-1.0F, 2.0F, 0.2F}, 10.0F);
    // A standing wall at x = 0.8 that faces the light.
    const Shape lying = bumpy_plane_shape(Vec3d(0.0), 0.5, 0.01, 3.0);
    const Shape standing = [lying](double u, double v) {
        const ShapePoint p = lying(u, v);
        const auto turn = [](const Vec3d& w) { return Vec3d(-w.y, w.x, w.z); };
        return ShapePoint{turn(p.position) + Vec3d(0.8, 0.6, 0.0), turn(p.normal)};
    };
    add_mesh(caustic.scene, shape_mesh(standing, rows, rows, metal_material));
    caustic.camera = look_at({0.0F, 3.0F, 1.0F}, {0.2F, 0.0F, 0.0F}, 0.6F);
    caustic.floor_points = {{0.35F, 0.0F, 0.05F}, {0.2F, 0.0F, -0.2F}};
    return caustic;
}

CausticScene two_mirror_caustic(float alpha) {
    CausticScene caustic = with_floor("two mirrors", alpha, {-1.2F, 1.2F, 0.0F}, 10.0F);
    // Light runs to the trough, from there to the sheet above the floor, and down.
    const Shape trough = cylinder_shape(Vec3d(0.9, 0.7, 0.0), 0.6, 1.0, 2.2, 4.0);
    const Shape sheet = [](double u, double v) {
        const Vec3d normal = glm::normalize(Vec3d(0.15 * (u - 0.5), -1.0, 0.0));
        return ShapePoint{Vec3d(-0.5 + 0.9 * u, 1.3 + 0.02 * u * u, -0.5 + v), normal};
    };
    add_mesh(caustic.scene, shape_mesh(trough, 30, 8, metal_material));
    add_mesh(caustic.scene, shape_mesh(sheet, 16, 8, metal_material));
    caustic.camera = look_at({-0.3F, 0.9F, 2.6F}, {-0.2F, 0.0F, 0.0F}, 0.6F);
    caustic.reflections = 2;
    return caustic;
}

CausticScene mirror_view_caustic(float alpha) {
    CausticScene caustic = sphere_caustic(alpha);
    caustic.name = "mirror view";
    caustic.scene.materials.push_back(metal(Rgb(0.9F), 0.02F));
    // A flat mirror above the floor, which shows the caustic to the camera below it.
    add_mesh(caustic.scene, quad({-2.0F, 2.0F, -1.0F}, {2.0F, 0.0F, 0.0F}, {0.0F, 0.0F, 2.0F}, 2));
    caustic.camera = look_at({-1.4F, 0.4F, 2.5F}, {-0.9F, 2.0F, 0.6F}, 0.35F);
    return caustic;
}

std::vector<CausticScene> all_caustic_scenes(float alpha) {
    return {ring_caustic(alpha), sphere_caustic(alpha), bumpy_plane_caustic(alpha, 16), two_mirror_caustic(alpha),
            mirror_view_caustic(alpha)};
}

CausticScene scaled(CausticScene caustic, float factor) {
    for (Mesh& mesh : caustic.scene.meshes) {
        for (Vec3& position : mesh.positions) position *= factor;
    }
    for (PunctualLight& light : caustic.scene.lights) {
        light.position *= factor;
        light.radius *= factor;
        light.intensity *= factor * factor;
    }
    caustic.camera.to_world[3] = Vec4(factor * Vec3(caustic.camera.to_world[3]), 1.0F);
    for (Vec3& point : caustic.floor_points) point *= factor;
    caustic.scale *= factor;
    return caustic;
}

namespace {

Triple<double> triple(const Vec3d& v) {
    return {v.x, v.y, v.z};
}

/// Metal of any roughness: rougher than casters are, too.
CasterReport all_metal(const Scene& scene) {
    CasterReport report;
    for (const Object& object : scene.objects) {
        const int material = scene.meshes[static_cast<size_t>(object.mesh)].material;
        report.is_caster.push_back(scene.materials[static_cast<size_t>(material)].metallic > 0.0F ? 1 : 0);
    }
    return report;
}

/// Sums the light that the pieces of one triangle reflect to x.
class TriangleQuadrature {
  public:
    TriangleQuadrature(const CausticScene& caustic, const Accelerator& accelerator, const Vec3& x)
        : light_(caustic.scene.lights[0]), accelerator_(accelerator), x_(x), ray_offset_(1e-5 * double{caustic.scale}) {
        const Material& material = caustic.scene.materials[metal_material];
        const double alpha = double{material.roughness * material.roughness};
        bsdf_ = {triple(Vec3d(material.base_color)), {0.0, 0.0, 0.0}, 0.0, 1.0, alpha};
    }

    /// W/m^2, green. Corners are barycentric.
    double irradiance(const SurfacePatch& patch, const std::array<Vec2d, 3>& corners, int depth) const {
        const Vec2d centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        const PatchPoint point = evaluate(patch, centre);
        double size = 0.0;
        for (size_t k = 0; k < 3; ++k) {
            size = std::max(size, glm::length(evaluate(patch, corners[k]).position - point.position));
        }
        const SlopeConstraint constraint = evaluate_constraint(patch, point, Interaction(), {Vec3d(x_), false},
                                                               {Vec3d(light_.position), false}, Derivatives::own);
        const double distance = glm::length(point.position - Vec3d(x_));
        bool fine = size < 0.1 * distance;
        if (constraint.valid) {
            // Of the half vector's angle: its slope has a pole where it lies in the surface, where there is no light.
            const double slope2 = glm::dot(constraint.slope, constraint.slope);
            double change = 0.0;
            for (const Vec2d& corner : corners) {
                const Vec3d way = evaluate(patch, corner).position - point.position;
                const Vec2d in_plane(glm::dot(way, patch.axes[0]), glm::dot(way, patch.axes[1]));
                change = std::max(change, glm::length(constraint.by_vertex * in_plane) / (1.0 + slope2));
            }
            fine = fine && change < 0.15 * std::hypot(bsdf_.alpha, std::sqrt(slope2 / (1.0 + slope2)));
        }
        if (!fine && depth < deepest) {
            const Vec2d a = 0.5 * (corners[0] + corners[1]), b = 0.5 * (corners[1] + corners[2]),
                        c = 0.5 * (corners[2] + corners[0]);
            return irradiance(patch, {corners[0], a, c}, depth + 1) + irradiance(patch, {a, corners[1], b}, depth + 1) +
                   irradiance(patch, {c, b, corners[2]}, depth + 1) + irradiance(patch, {a, b, c}, depth + 1);
        }
        const Vec2d u = corners[1] - corners[0], v = corners[2] - corners[0];
        const Vec3d edge_a = patch.positions[1] - patch.positions[0], edge_b = patch.positions[2] - patch.positions[0];
        const double area = 0.5 * std::abs(u.x * v.y - u.y * v.x) * glm::length(glm::cross(edge_a, edge_b));
        return area * reflected(patch, point);
    }

  private:
    static constexpr int deepest = 20;

    /// Per area of reflector.
    double reflected(const SurfacePatch& patch, const PatchPoint& point) const {
        const Vec3d to_x = Vec3d(x_) - point.position, to_light = Vec3d(light_.position) - point.position;
        const double d2 = glm::dot(to_x, to_x), l2 = glm::dot(to_light, to_light);
        const Vec3d wo = to_x / std::sqrt(d2), wi = to_light / std::sqrt(l2);
        Vec3d geometric = patch.geometric_normal, shading = point.normal;
        if (glm::dot(geometric, wo) < 0.0) geometric = -geometric;
        if (glm::dot(shading, geometric) < 0.0) shading = -shading;
        if (wo.y >= 0.0 || glm::dot(geometric, wi) <= 0.0) return 0.0;
        // All in double: float would do no better than 1e-3 at alpha 0.005.
        const Frame<double> frame = make_frame(triple(shading));
        const double value = evaluate_bsdf(bsdf_, frame.to_local(triple(wo)), frame.to_local(triple(wi))).value.y;
        if (!(value > 0.0) || !visible(point.position, geometric)) return 0.0;
        const double light = double{light_.intensity.y} / l2;
        return light * value * -wo.y * std::abs(glm::dot(geometric, wo)) / d2;
    }

    bool visible(const Vec3d& y, const Vec3d& normal) const {
        const Vec3 origin = Vec3(y + ray_offset_ * normal);
        const Vec3 floor = x_ + Vec3(0.0F, static_cast<float>(ray_offset_), 0.0F);
        return !accelerator_.occluded({origin, light_.position - origin, 0.9999F}) &&
               !accelerator_.occluded({origin, floor - origin, 0.9999F});
    }

    const PunctualLight& light_;
    const Accelerator& accelerator_;
    Vec3 x_;
    double ray_offset_;
    BsdfParameters<double> bsdf_{};
};

}  // namespace

FloorRadiance floor_radiance_parts(const CausticScene& caustic, const Vec3& x) {
    const Accelerator accelerator(caustic.scene, 2);
    const PunctualLight& light = caustic.scene.lights[0];
    const Vec3 to_light = light.position - x;
    const double distance2 = double{glm::dot(to_light, to_light)};
    const bool lit = !accelerator.occluded({x + Vec3(0.0F, 1e-5F * caustic.scale, 0.0F), to_light, 0.9999F});
    const double direct = lit ? double{light.intensity.y} * double{to_light.y} / std::pow(distance2, 1.5) : 0.0;
    const TriangleQuadrature quadrature(caustic, accelerator, x);
    double reflected = 0.0;
    for (const ReflectorTriangle& triangle : reflector_triangles(caustic.scene, all_metal(caustic.scene))) {
        std::array<Vec3d, 3> positions, normals;
        for (size_t k = 0; k < 3; ++k) {
            positions[k] = Vec3d(triangle.positions[k]);
            normals[k] = Vec3d(triangle.normals[k]);
        }
        const SurfacePatch patch = make_surface_patch(positions, normals);
        if (patch.degenerate) continue;
        reflected += quadrature.irradiance(patch, {Vec2d(0.0, 0.0), Vec2d(1.0, 0.0), Vec2d(0.0, 1.0)}, 0);
    }
    const double brdf = double{floor_albedo} / 3.14159265358979;
    return {brdf * direct, brdf * reflected};
}

double floor_radiance(const CausticScene& caustic, const Vec3& x) {
    const FloorRadiance parts = floor_radiance_parts(caustic, x);
    return parts.direct + parts.reflected;
}

}  // namespace nephroid::testing

// From a hit to what shading needs: position with its rounding error, normals, material.
#pragma once

#include <vector>

#include "accel/accelerator.h"
#include "accel/surface_geometry.h"
#include "core/bsdf.h"
#include "core/scene.h"

namespace nephroid {

struct SurfaceInteraction {
    Vec3 position{0.0F};
    Vec3 error{0.0F};             ///< Bound of |position - true position on the triangle|, per coordinate.
    Vec3 geometric_normal{0.0F};  ///< Unit, on the side of wo; zero for a degenerate triangle.
    Vec3 shading_normal{0.0F};    ///< Unit, on the side of geometric_normal.
    BsdfParameters<float> bsdf{};
    Vec2 uv[2]{};
    float area = 0.0F;   ///< Of the triangle, world space, m^2.
    bool front = false;  ///< wo lies on the side that the winding calls front.
};

/// Looks up surfaces; keeps references to the scene. One compact record per object, so that a hit touches few lines.
class Surfaces {
  public:
    explicit Surfaces(const Scene& scene);

    /// For a hit on an object (hit.object < objects.size()), seen from direction wo = -ray direction.
    SurfaceInteraction interact(uint32_t object, uint32_t primitive, float u, float v, const Vec3& wo) const;

    /// Most hits need only their triangle's corners and a constant material: no texture, no emission, no instance
    /// transform. Those are handled a vector at a time by load_plain.
    bool is_plain(uint32_t object) const { return records_[object].plain; }
    /// Corners and materials of a vector of plain hits; `active` lanes only, the others become zero.
    void load_plain(const UintV& object, const UintV& primitive, FloatV::mask_type active,
                    TriangleCorners<FloatV>& corners, BsdfParameters<FloatV>& bsdf) const;

    const Material& material(uint32_t object) const { return *records_[object].material; }
    bool emits(uint32_t object) const { return records_[object].emits; }
    size_t object_count() const { return records_.size(); }
    bool is_caster(uint32_t object) const { return records_[object].caster; }
    void set_casters(const std::vector<uint8_t>& casters);

  private:
    struct InstanceTransform {
        Mat4 to_world;
        Mat3 normal_to_world;  ///< Inverse transpose of the linear part.
        bool mirrors;          ///< Negative determinant.
    };
    struct Record {
        const Triangle* triangles;
        const Vec3* positions;
        const Vec3* normals;  ///< Null: geometric normal.
        const Material* material;
        const Mesh* mesh;
        const InstanceTransform* instance;  ///< Null: the mesh is in world space.
        BsdfParameters<float> constant_bsdf;
        bool textured;  ///< Some slot has a texture, or vertices have colours.
        bool emits;
        bool plain;
        bool caster;
    };

    static void gather_corners(const Record& record, const UintV& primitive, const FloatV::mask_type& active,
                               TriangleCorners<FloatV>& corners);
    static TriangleCorners<float> corners_of(const Record& record, const Triangle& t);
    static TriangleCorners<float> to_world(const InstanceTransform& transform, const TriangleCorners<float>& corners);

    void interpolate_texture_coordinates(const Record& record, const Triangle& t, const Vec3& weights,
                                         SurfaceInteraction& surface) const;
    void apply_normal_map(const Record& record, const Triangle& t, const Vec3& weights,
                          SurfaceInteraction& surface) const;
    BsdfParameters<float> textured_bsdf(const Record& record, const Triangle& t, const Vec3& weights,
                                        const SurfaceInteraction& surface) const;

    const Scene& scene_;
    std::vector<InstanceTransform> instances_;
    std::vector<Record> records_;
};

}  // namespace nephroid

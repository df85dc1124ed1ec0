// All lights of a scene as one set to sample from: punctual lights, emissive triangles, the environment.
//
// Selection is by power (alias table, constant time for any number of lights): chosen over a light hierarchy because
// its cost does not grow and its density is known without the shading point, which path guiding and bidirectional
// methods need. Indices: punctual lights in file order, then emissive triangles by object, then the environment.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/alias_table.h"
#include "core/environment.h"
#include "core/scene.h"

namespace nephroid {

/// A direction towards a light, seen from a point.
struct LightSample {
    Vec3 wi{0.0F};          ///< Unit, towards the light.
    Vec3 target{0.0F};      ///< Where the shadow ray ends, already clear of the light's surface; unused where infinite.
    bool infinite = false;  ///< Directional and environment lights: the shadow ray has no end.
    bool delta = false;     ///< No other strategy finds this light: pdf is the probability of its selection.
    Rgb radiance{0.0F};     ///< Arriving along -wi without occlusion: W/(m^2 sr); delta: irradiance, W/m^2.
    float pdf = 0.0F;       ///< Per solid angle, selection included; delta: selection only. 0: no light from here.
    uint32_t light = 0;     ///< Index in the set.
};

/// An emissive triangle in world space.
struct TriangleLight {
    uint32_t object;
    uint32_t triangle;
};

class LightSet {
  public:
    static constexpr uint32_t none = std::numeric_limits<uint32_t>::max();

    /// Keeps a reference to the scene, whose meshes must have been flattened.
    explicit LightSet(const Scene& scene);

    size_t size() const { return selection_.size(); }
    bool empty() const { return size() == 0; }
    /// Some light can be hit by a ray: sphere lights, emissive triangles, environment.
    bool has_hittable() const { return hittable_; }
    const Environment* environment() const { return environment_ ? &*environment_ : nullptr; }
    /// The light where there is just one and it is a point, spot or directional light; else null. The commonest case of
    /// a caustic, and one that needs no random numbers.
    const PunctualLight* single_delta_light() const {
        return size() == 1 && scene_.lights.size() == 1 && !hittable_ ? scene_.lights.data() : nullptr;
    }

    /// Selects a light with u_select and a point of it with u, as seen from p.
    LightSample sample(float u_select, Vec2 u, const Vec3& p) const;

    /// A light drawn with u, which is remapped to [0, 1) for further use, and the probability of drawing it.
    uint32_t select(float& u) const { return static_cast<uint32_t>(selection_.sample(u)); }
    float probability(uint32_t light) const { return selection_.probability(light); }
    /// Light `light` of the set, where it is no punctual light: an emissive triangle, or null for the environment.
    const TriangleLight* triangle(uint32_t light) const {
        const size_t i = light - scene_.lights.size();
        return i < triangles_.size() ? &triangles_[i] : nullptr;
    }
    size_t triangle_count() const { return triangles_.size(); }
    /// Index in the set of the emissive triangle of an object; none where the object does not emit.
    uint32_t triangle_light(uint32_t object, uint32_t triangle) const {
        return first_triangle_[object] == none ? none : first_triangle_[object] + triangle;
    }

    /// Density of sample() for the emissive triangle of an object that a ray from p hit at `hit` with geometric
    /// normal n (unit) and area (m^2).
    float pdf_triangle(uint32_t object, uint32_t triangle, float area, const Vec3& p, const Vec3& hit,
                       const Vec3& n) const;
    /// The same for a sphere light (index into Scene::lights).
    float pdf_sphere(uint32_t light, const Vec3& p) const;
    /// Probability of selecting the environment; its density is that times Environment::evaluate's.
    float environment_probability() const { return selection_.probability(size() - 1); }

    /// Radiance that a sphere light emits, W/(m^2 sr).
    static Rgb sphere_radiance(const PunctualLight& light);

  private:
    LightSample sample_punctual(const PunctualLight& light, Vec2 u, const Vec3& p) const;
    LightSample sample_triangle(const TriangleLight& light, Vec2 u, const Vec3& p) const;
    void add_triangles(std::vector<float>& powers);

    const Scene& scene_;
    std::vector<TriangleLight> triangles_;
    std::vector<uint32_t> first_triangle_;  ///< Per object: index of its first triangle in the set, or none.
    std::optional<Environment> environment_;
    AliasTable selection_;
    bool hittable_ = false;
};

/// A point of an emissive triangle.
struct TrianglePoint {
    Vec3 position{0.0F}, error{0.0F};  ///< With the bound of its rounding error.
    Vec3 normal{0.0F};                 ///< Unit, on the front; zero for a degenerate triangle.
    float area = 0.0F;                 ///< Of the triangle, m^2.
    Rgb radiance{0.0F};                ///< That it emits.
    bool double_sided = false;
};
/// Uniform over the triangle's area.
TrianglePoint sample_triangle_point(const Scene& scene, const TriangleLight& light, Vec2 u);

/// Radiance that a material emits at uv of both sets, W/(m^2 sr); the caller checks the side.
Rgb emitted_radiance(const Scene& scene, const Material& material, const Vec2 uv[2]);

}  // namespace nephroid

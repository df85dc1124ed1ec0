#include "accel/surface.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace nephroid {

namespace {

BsdfParameters<float> make_bsdf(const Material& material, const Rgb& base, float metallic, float roughness) {
    const float ratio = (material.ior - 1.0F) / (material.ior + 1.0F);
    const Rgb f0 = glm::min(ratio * ratio * material.specular_color, Rgb(1.0F)) * material.specular;
    return {to_triple(glm::clamp(base, Rgb(0.0F), Rgb(1.0F))), to_triple(f0), material.specular, metallic,
            std::min(roughness * roughness, 1.0F)};
}

template <class T>
T interpolate(const std::vector<T>& values, const Triangle& t, const Vec3& w) {
    return w.x * values[t[0]] + w.y * values[t[1]] + w.z * values[t[2]];
}

bool has_texture(const Material& m) {
    return m.base_color_texture.image >= 0 || m.metallic_roughness_texture.image >= 0 || m.normal_texture.image >= 0 ||
           m.emissive_texture.image >= 0;
}

}  // namespace

Surfaces::Surfaces(const Scene& scene) : scene_(scene) {
    instances_.reserve(scene.objects.size());
    records_.reserve(scene.objects.size());
    for (const Object& object : scene.objects) {
        const Mesh& mesh = scene.meshes[static_cast<size_t>(object.mesh)];
        const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
        const InstanceTransform* instance = nullptr;
        if (object.to_world != Mat4(1.0F)) {
            const Mat3 linear(object.to_world);
            instances_.push_back(
                {object.to_world, glm::transpose(glm::inverse(linear)), glm::determinant(linear) < 0.0F});
            instance = &instances_.back();
        }
        const bool textured = has_texture(material) || !mesh.colors.empty();
        records_.push_back({mesh.triangles.data(), mesh.positions.data(),
                            mesh.normals.empty() ? nullptr : mesh.normals.data(), &material, &mesh, instance,
                            make_bsdf(material, Rgb(material.base_color), material.metallic, material.roughness),
                            textured, material.emits(), !textured && !material.emits() && instance == nullptr, false});
    }
}

void Surfaces::set_casters(const std::vector<uint8_t>& casters) {
    for (size_t i = 0; i < records_.size(); ++i) records_[i].caster = casters[i] != 0;
}

TriangleCorners<float> Surfaces::corners_of(const Record& record, const Triangle& t) {
    TriangleCorners<float> corners{to_triple(record.positions[t[0]]),
                                   to_triple(record.positions[t[1]]),
                                   to_triple(record.positions[t[2]]),
                                   {0.0F, 0.0F, 0.0F},
                                   {0.0F, 0.0F, 0.0F},
                                   {0.0F, 0.0F, 0.0F}};
    if (record.normals != nullptr) {
        corners.n0 = to_triple(record.normals[t[0]]);
        corners.n1 = to_triple(record.normals[t[1]]);
        corners.n2 = to_triple(record.normals[t[2]]);
    }
    return corners;
}

namespace {

/// where(active): to = from, for the parts of a structure.
void assign(const FloatV::mask_type& active, FloatV& to, const FloatV& from) {
    stdx::where(active, to) = from;
}
void assign(const FloatV::mask_type& active, Triple<FloatV>& to, const Triple<float>& from) {
    assign(active, to.x, FloatV(from.x));
    assign(active, to.y, FloatV(from.y));
    assign(active, to.z, FloatV(from.z));
}

/// The index-th triples of an array. Each is read at once and turned into its lane, which is cheaper than three
/// gathers.
Triple<FloatV> load_triples(const float* triples, const UintV& index) {
#if defined(__AVX512F__) && defined(__AVX512VL__)
    alignas(simd_alignment) uint32_t at[simd_width];
    index.copy_to(at, stdx::vector_aligned);
    const auto load = [&](size_t lane) { return _mm_maskz_loadu_ps(0x7, triples + size_t{3} * at[lane]); };
    __m512 rows[4];  // Lanes r, r + 4, r + 8 and r + 12, a quarter each.
#pragma GCC unroll 4
    for (size_t r = 0; r < 4; ++r) {
        const __m512 first = _mm512_insertf32x4(_mm512_castps128_ps512(load(r)), load(r + 4), 1);
        rows[r] = _mm512_insertf32x4(_mm512_insertf32x4(first, load(r + 8), 2), load(r + 12), 3);
    }
    const __m512d xy01 = _mm512_castps_pd(_mm512_unpacklo_ps(rows[0], rows[1]));
    const __m512d xy23 = _mm512_castps_pd(_mm512_unpacklo_ps(rows[2], rows[3]));
    const __m512d z01 = _mm512_castps_pd(_mm512_unpackhi_ps(rows[0], rows[1]));
    const __m512d z23 = _mm512_castps_pd(_mm512_unpackhi_ps(rows[2], rows[3]));
    return {FloatV(_mm512_castpd_ps(_mm512_unpacklo_pd(xy01, xy23))),
            FloatV(_mm512_castpd_ps(_mm512_unpackhi_pd(xy01, xy23))),
            FloatV(_mm512_castpd_ps(_mm512_unpacklo_pd(z01, z23)))};
#else
    const auto load = [&](size_t c) { return FloatV([&](auto lane) { return triples[size_t{3} * index[lane] + c]; }); };
    return {load(0), load(1), load(2)};
#endif
}

void assign_loaded(const FloatV::mask_type& active, Triple<FloatV>& to, const Vec3* vectors, const UintV& index) {
    const Triple<FloatV> loaded = load_triples(reinterpret_cast<const float*>(vectors), index);
    assign(active, to.x, loaded.x);
    assign(active, to.y, loaded.y);
    assign(active, to.z, loaded.z);
}

}  // namespace

void Surfaces::gather_corners(const Record& record, const UintV& primitive, const FloatV::mask_type& active,
                              TriangleCorners<FloatV>& corners) {
    // Lanes of other objects read the first triangle.
    const UintV own = std::bit_cast<UintV>(select(active, std::bit_cast<FloatV>(primitive), FloatV(0.0F)));
    const Triple<FloatV> indices = load_triples(reinterpret_cast<const float*>(record.triangles), own);
    const auto index0 = std::bit_cast<UintV>(indices.x), index1 = std::bit_cast<UintV>(indices.y),
               index2 = std::bit_cast<UintV>(indices.z);
    assign_loaded(active, corners.p0, record.positions, index0);
    assign_loaded(active, corners.p1, record.positions, index1);
    assign_loaded(active, corners.p2, record.positions, index2);
    if (record.normals == nullptr) return;
    assign_loaded(active, corners.n0, record.normals, index0);
    assign_loaded(active, corners.n1, record.normals, index1);
    assign_loaded(active, corners.n2, record.normals, index2);
}

NEPHROID_FLATTEN void Surfaces::load_plain(const UintV& object, const UintV& primitive, FloatV::mask_type active,
                                           TriangleCorners<FloatV>& corners, BsdfParameters<FloatV>& bsdf) const {
    const Triple<FloatV> zero{FloatV(0.0F), FloatV(0.0F), FloatV(0.0F)};
    corners = {zero, zero, zero, zero, zero, zero};
    bsdf = {zero, zero, FloatV(0.0F), FloatV(0.0F), FloatV(0.0F)};
    // One turn per distinct object among the lanes: neighbouring paths mostly hit the same.
    while (stdx::any_of(active)) {
        const uint32_t id = object[static_cast<size_t>(stdx::find_first_set(active))];
        const auto same =
            active && FloatV::mask_type(stdx::static_simd_cast<FloatV>(object ^ UintV(id)) == FloatV(0.0F));
        const Record& record = records_[id];
        gather_corners(record, primitive, same, corners);
        assign(same, bsdf.base, record.constant_bsdf.base);
        assign(same, bsdf.coat_f0, record.constant_bsdf.coat_f0);
        assign(same, bsdf.coat_f90, FloatV(record.constant_bsdf.coat_f90));
        assign(same, bsdf.metallic, FloatV(record.constant_bsdf.metallic));
        assign(same, bsdf.alpha, FloatV(record.constant_bsdf.alpha));
        active = active && !same;
    }
}

TriangleCorners<float> Surfaces::to_world(const InstanceTransform& transform, const TriangleCorners<float>& corners) {
    const auto point = [&](const Triple<float>& p) {
        return to_triple(Vec3(transform.to_world * Vec4(to_vec3(p), 1.0F)));
    };
    const auto normal = [&](const Triple<float>& n) { return to_triple(transform.normal_to_world * to_vec3(n)); };
    return {point(corners.p0),  point(corners.p1),  point(corners.p2),
            normal(corners.n0), normal(corners.n1), normal(corners.n2)};
}

SurfaceInteraction Surfaces::interact(uint32_t object, uint32_t primitive, float u, float v, const Vec3& wo) const {
    const Record& record = records_[object];
    const Triangle& t = record.triangles[primitive];
    TriangleCorners<float> corners = corners_of(record, t);
    Vec3 transform_error(0.0F);
    if (record.instance != nullptr) {
        const Mat4& m = record.instance->to_world;
        const Mat3 magnitude(glm::abs(Vec3(m[0])), glm::abs(Vec3(m[1])), glm::abs(Vec3(m[2])));
        const Vec3 largest =
            to_vec3(maximum(absolute(corners.p0), maximum(absolute(corners.p1), absolute(corners.p2))));
        transform_error = rounding_bound(8) * (magnitude * largest + glm::abs(Vec3(m[3])));
        corners = to_world(*record.instance, corners);
    }
    const SurfaceGeometry<float> geometry = interpolate_surface(corners, u, v, to_triple(wo));

    SurfaceInteraction surface;
    surface.position = to_vec3(geometry.position);
    surface.error = to_vec3(geometry.error) + transform_error;
    surface.geometric_normal = to_vec3(geometry.geometric_normal);
    surface.shading_normal = to_vec3(geometry.shading_normal);
    // Mirroring reverses the winding (glTF 2.0, Sec. 3.7.2.1).
    surface.front = geometry.front != (record.instance != nullptr && record.instance->mirrors);
    if (record.textured) {
        const Vec3 weights(1.0F - u - v, u, v);
        interpolate_texture_coordinates(record, t, weights, surface);
        if (record.material->normal_texture.image >= 0) apply_normal_map(record, t, weights, surface);
        surface.bsdf = textured_bsdf(record, t, weights, surface);
    } else {
        surface.bsdf = record.constant_bsdf;
    }
    surface.shading_normal =
        to_vec3(face_forward(to_triple(surface.shading_normal), to_triple(surface.geometric_normal)));
    surface.area = 0.5F * geometry.double_area;
    return surface;
}

void Surfaces::interpolate_texture_coordinates(const Record& record, const Triangle& t, const Vec3& weights,
                                               SurfaceInteraction& surface) const {
    for (size_t set = 0; set < 2; ++set) {
        const auto& uvs = record.mesh->uvs[set];
        if (!uvs.empty()) surface.uv[set] = interpolate(uvs, t, weights);
    }
}

void Surfaces::apply_normal_map(const Record& record, const Triangle& t, const Vec3& weights,
                                SurfaceInteraction& surface) const {
    if (record.mesh->tangents.empty()) return;
    Vec3 tangent(interpolate(record.mesh->tangents, t, weights));
    if (record.instance != nullptr) tangent = Mat3(record.instance->to_world) * tangent;
    const Vec3& n = surface.shading_normal;
    tangent -= n * glm::dot(n, tangent);
    const float length2 = glm::dot(tangent, tangent);
    if (!(length2 > 0.0F)) return;
    tangent /= std::sqrt(length2);
    float handedness = record.mesh->tangents[t[0]].w;
    if (record.instance != nullptr && record.instance->mirrors) handedness = -handedness;
    const Vec3 bitangent = glm::cross(n, tangent) * handedness;

    const Material& material = *record.material;
    const TextureReference& texture = material.normal_texture;
    const Vec3 texel(
        sample_texture(scene_.images[static_cast<size_t>(texture.image)], texture, surface.uv[texture.uv_set]));
    const Vec3 local = (2.0F * texel - 1.0F) * Vec3(material.normal_scale, material.normal_scale, 1.0F);
    const Vec3 mapped = tangent * local.x + bitangent * local.y + n * local.z;
    const float mapped_length2 = glm::dot(mapped, mapped);
    if (mapped_length2 > 0.0F) surface.shading_normal = mapped / std::sqrt(mapped_length2);
}

BsdfParameters<float> Surfaces::textured_bsdf(const Record& record, const Triangle& t, const Vec3& weights,
                                              const SurfaceInteraction& surface) const {
    const Material& material = *record.material;
    Rgb base(material.base_color);
    float metallic = material.metallic;
    float roughness = material.roughness;
    if (!record.mesh->colors.empty()) base *= Rgb(interpolate(record.mesh->colors, t, weights));
    if (const TextureReference& texture = material.base_color_texture; texture.image >= 0) {
        base *=
            Rgb(sample_texture(scene_.images[static_cast<size_t>(texture.image)], texture, surface.uv[texture.uv_set]));
    }
    if (const TextureReference& texture = material.metallic_roughness_texture; texture.image >= 0) {
        const Vec4 texel =
            sample_texture(scene_.images[static_cast<size_t>(texture.image)], texture, surface.uv[texture.uv_set]);
        roughness *= texel.g;
        metallic *= texel.b;
    }
    return make_bsdf(material, base, std::clamp(metallic, 0.0F, 1.0F), roughness);
}

}  // namespace nephroid

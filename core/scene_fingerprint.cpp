#include "core/scene_fingerprint.h"

namespace nephroid {

namespace {

// Structs may hold padding, so their members are added one by one.
template <class... T>
void add_all(Fingerprint& fingerprint, const T&... values) {
    (fingerprint.add_bytes(&values, sizeof(values)), ...);
}

void add_image(const Image& image, Fingerprint& fingerprint) {
    add_all(fingerprint, image.width, image.height, image.channels);
    fingerprint.add(image.bytes);
    fingerprint.add(image.floats);
}

void add_texture(const TextureReference& t, Fingerprint& fingerprint) {
    add_all(fingerprint, t.image, t.uv_set, t.wrap_u, t.wrap_v, t.nearest, t.srgb, t.uv_matrix, t.uv_offset);
}

void add_material(const Material& m, Fingerprint& fingerprint) {
    add_all(fingerprint, m.base_color, m.metallic, m.roughness, m.emission, m.ior, m.specular, m.specular_color,
            m.normal_scale, m.alpha_mode, m.alpha_cutoff, m.double_sided);
    add_texture(m.base_color_texture, fingerprint);
    add_texture(m.metallic_roughness_texture, fingerprint);
    add_texture(m.normal_texture, fingerprint);
    add_texture(m.emissive_texture, fingerprint);
}

void add_mesh(const Mesh& mesh, Fingerprint& fingerprint) {
    add_all(fingerprint, mesh.material);
    fingerprint.add(mesh.triangles);
    fingerprint.add(mesh.positions);
    fingerprint.add(mesh.normals);
    for (const auto& uvs : mesh.uvs) fingerprint.add(uvs);
    fingerprint.add(mesh.tangents);
    fingerprint.add(mesh.colors);
}

}  // namespace

void add_camera(const Camera& camera, Fingerprint& fingerprint) {
    add_all(fingerprint, camera.kind, camera.to_world, camera.yfov, camera.xmag, camera.ymag);
}

void add_scene(const Scene& scene, Fingerprint& fingerprint) {
    for (const Mesh& mesh : scene.meshes) add_mesh(mesh, fingerprint);
    for (const Object& object : scene.objects) add_all(fingerprint, object.mesh, object.to_world, object.no_caustics);
    for (const Material& material : scene.materials) add_material(material, fingerprint);
    for (const Image& image : scene.images) add_image(image, fingerprint);
    for (const PunctualLight& l : scene.lights) {
        add_all(fingerprint, l.kind, l.position, l.direction, l.intensity, l.radius, l.cos_inner, l.cos_outer);
    }
    if (scene.environment) {
        add_image(scene.environment->image, fingerprint);
        add_all(fingerprint, scene.environment->scale);
    }
}

}  // namespace nephroid

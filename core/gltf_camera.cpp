#include "core/gltf_camera.h"

#include <cmath>

#include "core/gltf_error.h"

namespace nephroid {

namespace {

/// Position and orientation without scaling and shear; false where the matrix has no orientation.
bool remove_scaling(const glm::dmat4& to_world, Mat4& result) {
    const double determinant = glm::determinant(glm::dmat3(to_world));
    if (!(std::abs(determinant) > 0.0)) return false;
    const glm::dvec3 z = glm::normalize(glm::dvec3(to_world[2]));
    const glm::dvec3 up = glm::dvec3(to_world[1]);
    const glm::dvec3 y = glm::normalize(up - z * glm::dot(z, up));
    const glm::dvec3 x = glm::cross(y, z) * (determinant > 0.0 ? 1.0 : -1.0);
    result = Mat4(glm::dmat4(glm::dvec4(x, 0.0), glm::dvec4(y, 0.0), glm::dvec4(z, 0.0), to_world[3]));
    for (int column = 0; column < 4; ++column) {
        if (!std::isfinite(glm::dot(result[column], Vec4(1.0F)))) return false;
    }
    return true;
}

void read_perspective(const GltfImport& import, const tinygltf::PerspectiveCamera& source, const std::string& element,
                      Camera& camera) {
    camera.kind = CameraKind::perspective;
    if (!(source.yfov > 1e-5) || !(source.yfov < 3.1415)) {
        fail_gltf(import.document.file, element, "yfov must be above 0 and below pi; correct it");
    }
    if (source.aspectRatio != 0.0 && !(source.aspectRatio > 1e-4 && source.aspectRatio < 1e4)) {
        fail_gltf(import.document.file, element, "aspectRatio must be from 1e-4 to 1e4; correct it");
    }
    camera.yfov = static_cast<float>(source.yfov);
    camera.aspect = static_cast<float>(source.aspectRatio);
}

void read_orthographic(const GltfImport& import, const tinygltf::OrthographicCamera& source, const std::string& element,
                       Camera& camera) {
    camera.kind = CameraKind::orthographic;
    for (const double magnitude : {source.xmag, source.ymag}) {
        if (magnitude > 1e-6 && magnitude < 1e9) continue;
        fail_gltf(import.document.file, element, "xmag and ymag must be from 1e-6 to 1e9; correct them");
    }
    camera.xmag = static_cast<float>(source.xmag);
    camera.ymag = static_cast<float>(source.ymag);
    camera.aspect = camera.xmag / camera.ymag;
}

}  // namespace

void import_camera(GltfImport& import, int node_index, const glm::dmat4& to_world) {
    const tinygltf::Node& node = import.document.model.nodes[static_cast<size_t>(node_index)];
    if (node.camera < 0) return;
    const tinygltf::Camera& source = import.document.model.cameras[static_cast<size_t>(node.camera)];
    const std::string element = element_name("camera", static_cast<size_t>(node.camera));
    Camera camera;
    camera.name = printable(source.name.empty() ? node.name : source.name);
    if (source.type == "orthographic") {
        read_orthographic(import, source.orthographic, element, camera);
    } else {
        read_perspective(import, source.perspective, element, camera);
    }
    if (!remove_scaling(to_world, camera.to_world)) {
        warn_gltf(import, element, "its node is scaled to nothing; ignored");
        return;
    }
    import.scene.cameras.push_back(std::move(camera));
}

}  // namespace nephroid

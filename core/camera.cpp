#include "core/camera.h"

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

namespace nephroid {

CameraRays make_camera_rays(const Camera& camera, int width, int height) {
    // A node's scale does not change what a glTF camera sees.
    const Vec3 right = glm::normalize(Vec3(camera.to_world[0]));
    const Vec3 up = glm::normalize(Vec3(camera.to_world[1]));
    const Vec3 forward = -glm::normalize(Vec3(camera.to_world[2]));
    const Vec3 position(camera.to_world[3]);
    const auto columns = static_cast<float>(width);
    const auto rows = static_cast<float>(height);

    const float half_height = camera.kind == CameraKind::perspective ? std::tan(0.5F * camera.yfov) : camera.ymag;
    const float pixel = 2.0F * half_height / rows;
    const Vec3 corner = right * (-0.5F * columns * pixel) + up * (0.5F * rows * pixel);
    if (camera.kind == CameraKind::perspective) {
        return {position, Vec3(0.0F), Vec3(0.0F), forward + corner, right * pixel, up * -pixel};
    }
    return {position + corner, right * pixel, up * -pixel, forward, Vec3(0.0F), Vec3(0.0F)};
}

CameraProjection::CameraProjection(const CameraRays& rays)
    : parallel_(rays.direction_dx == Vec3(0.0F) && rays.direction_dy == Vec3(0.0F)),
      origin_(rays.origin_base),
      forward_(rays.direction_base) {
    const Vec3 dx = parallel_ ? rays.origin_dx : rays.direction_dx;
    const Vec3 dy = parallel_ ? rays.origin_dy : rays.direction_dy;
    const glm::dmat3 basis{glm::dvec3(rays.direction_base), glm::dvec3(dx), glm::dvec3(dy)};
    const glm::dmat3 rows = glm::transpose(glm::inverse(basis));
    to_depth_ = Vec3(rows[0]);
    to_x_ = Vec3(rows[1]);
    to_y_ = Vec3(rows[2]);
    density_ = static_cast<float>(1.0 / std::abs(glm::determinant(basis)));
}

Camera framing_camera(const Vec3& bounds_min, const Vec3& bounds_max) {
    Camera camera;
    camera.name = "framed default";
    const Vec3 centre = 0.5F * (bounds_min + bounds_max);
    const float radius = glm::max(0.5F * glm::length(bounds_max - bounds_min), 1e-6F);
    const float distance = 1.05F * radius / std::sin(0.5F * camera.yfov);
    const Vec3 eye = centre + distance * glm::normalize(Vec3(0.0F, 0.4F, 1.0F));
    camera.to_world = glm::inverse(glm::lookAt(eye, centre, Vec3(0.0F, 1.0F, 0.0F)));
    return camera;
}

}  // namespace nephroid

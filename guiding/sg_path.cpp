#include "guiding/sg_path.h"

namespace nephroid {

namespace {

Triple<double> to_triple(const Vec3d& v) {
    return {v.x, v.y, v.z};
}

Vec3d direction_to(const PathEnd& end, const Vec3d& from) {
    return glm::normalize(end.at_infinity ? end.point : end.point - from);
}

/// The light's image after all reflectors but the first, as the first one sees it.
Emitter image_before(std::span<const GlossyVertex> vertices, const PathEnd& light) {
    Emitter emitter = make_emitter(light);
    for (size_t i = vertices.size() - 1; i > 0; --i) {
        emitter = spherical_image(emitter, vertices[i].position, vertices[i].surface);
    }
    return emitter;
}

}  // namespace

SgLobe make_sg_lobe(const Vec3d& x, std::span<const GlossyVertex> vertices, const PathEmitter& light) {
    SphericalGaussian<double> lobe =
        light_lobe(to_triple(direction_to(light.end, vertices.back().position)), light.angle, light.irradiance);
    Vec3d to_viewer(0.0);
    for (size_t i = vertices.size(); i-- > 0;) {
        const GlossyVertex& vertex = vertices[i];
        to_viewer = glm::normalize((i == 0 ? x : vertices[i - 1].position) - vertex.position);
        lobe = reflected_lobe(lobe, vertex.bsdf, to_triple(vertex.surface.normal), to_triple(to_viewer));
        // Seen from the next vertex, light comes from where it leaves this one.
        if (i > 0) lobe.axis = -lobe.axis;
    }
    const double radiance = evaluate(lobe, to_triple(to_viewer));

    const GlossyVertex& first = vertices.front();
    const Emitter emitter = image_before(vertices, light.end);
    const auto& [s, t] = first.surface.direction;
    const auto image = [&](size_t k) {
        return principal_image(emitter, first.position, first.surface.normal, first.surface.direction[k],
                               first.surface.curvature[k]);
    };
    const PrincipalImage image_s = image(0), image_t = image(1);
    SgLobe result;
    result.reflector = Vec3(first.position);
    result.normal = Vec3(first.surface.normal);
    result.tangent = Vec3(s);
    result.image_inverse_distance = Vec2(image_s.inverse_distance, image_t.inverse_distance);
    result.image_slope = Vec2(image_s.slope, image_t.slope);
    result.sharpness = static_cast<float>(lobe.sharpness);
    result.weight = static_cast<float>(radiance * unit_integral(lobe.sharpness));
    return result;
}

}  // namespace nephroid

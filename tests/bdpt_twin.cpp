#include "tests/bdpt_twin.h"

#include <cmath>

#include "core/delta_light.h"
#include "core/rounding.h"
#include "integrators/subpaths/mis_recursion.h"

namespace nephroid::testing {

namespace {

Vec3 unit(const Vec3& from, const Vec3& to) {
    return glm::normalize(to - from);
}

/// From vertex i of the path towards its neighbour on the light's or the camera's side.
Vec3 direction_at(const TwinPath& path, size_t i, bool towards_camera) {
    const Vec3& here = path.vertices[i].position;
    if (towards_camera) {
        return unit(here, i + 1 < path.vertices.size() ? path.vertices[i + 1].position : path.camera_position);
    }
    if (i > 0) return unit(here, path.vertices[i - 1].position);
    return -path.light_direction;
}

double squared_distance(const Vec3& a, const Vec3& b) {
    const glm::dvec3 d = glm::dvec3(a) - glm::dvec3(b);
    return glm::dot(d, d);
}

double cosine(const Vec3& a, const Vec3& b) {
    return std::abs(glm::dot(glm::dvec3(a), glm::dvec3(b)));
}

double light_distance(const TwinPath& path) {
    return path.infinite ? 1.0 : std::sqrt(squared_distance(path.light_point, path.vertices[0].position));
}

}  // namespace

std::optional<TwinPath> BdptTwin::random_path(uint32_t index, size_t most_vertices) const {
    uint32_t dimension = 0;
    const auto next = [&] { return sample_1d(SamplerKind::independent, 77U, index, dimension++); };
    const Vec2 film(8.0F * next(), 8.0F * next());
    const Vec3 eye = to_vec3(context_.camera_rays.origin(film.x, film.y));
    Ray ray{eye, to_vec3(context_.camera_rays.direction(film.x, film.y))};
    const size_t count = 1 + static_cast<size_t>(next() * static_cast<float>(most_vertices));
    TwinPath path;
    path.camera_position = eye;
    for (size_t i = 0; i < count; ++i) {
        const Hit hit = context_.accelerator.intersect(ray);
        if (hit.object >= context_.surfaces.object_count()) return std::nullopt;
        const Vec3 wo = -ray.direction;
        const SurfaceInteraction s = context_.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, wo);
        TwinVertex vertex{s.position, s.geometric_normal, s.shading_normal, s.bsdf, false};
        if (i == 0) {
            // Rays of a pinhole camera with pixels of area A at distance one: 1 / (A cos^3) per solid angle.
            const CameraRays& rays = context_.camera_rays;
            const Vec3 axis = glm::normalize(glm::cross(rays.direction_dx, rays.direction_dy));
            const double scale = std::abs(glm::dot(rays.direction_base, axis));
            const double pixel = glm::length(glm::cross(rays.direction_dx, rays.direction_dy)) / (scale * scale);
            const double off_axis = cosine(axis, ray.direction);
            path.camera_density =
                static_cast<float>(cosine(s.geometric_normal, wo) / squared_distance(eye, s.position) /
                                   (pixel * off_axis * off_axis * off_axis));
        }
        const Frame<float> frame = make_frame(to_triple(s.shading_normal));
        const Triple<float> local_wo = frame.to_local(to_triple(wo));
        const float u_lobe = next(), u = next(), v = next();
        if (i + 1 == count) {
            const float u_select = next(), u_x = next();
            const LightSample light = context_.lights.sample(u_select, {u_x, next()}, s.position);
            if (!(light.pdf > 0.0F) || glm::dot(light.wi, s.geometric_normal) <= 0.0F) return std::nullopt;
            path.light = light.light;
            path.light_point = light.target;
            path.light_direction = -light.wi;
            path.delta_light = light.delta;
            path.infinite = light.infinite;
            if (light.light < context_.scene.lights.size()) {
                const PunctualLight& punctual = context_.scene.lights[light.light];
                if (punctual.kind == LightKind::sphere) path.light_normal = unit(punctual.position, light.target);
            } else if (const TriangleLight* triangle = context_.lights.triangle(light.light)) {
                const TrianglePoint point = sample_triangle_point(context_.scene, *triangle, {0.5F, 0.5F});
                path.light_normal = point.normal;
                path.light_area = point.area;
            }
            path.vertices.insert(path.vertices.begin(), vertex);
            return path;
        }
        const BsdfSample<float> sample = sample_bsdf(s.bsdf, local_wo, u_lobe, u, v);
        const Vec3 wi = to_vec3(frame.to_world(sample.wi));
        if (max_component(sample.weight) <= 0.0F || glm::dot(wi, s.geometric_normal) <= 0.0F) return std::nullopt;
        vertex.delta = sample.delta;
        path.vertices.insert(path.vertices.begin(), vertex);
        ray = {offset_ray_origin(s.position, s.error, s.geometric_normal, wi), wi};
    }
    return std::nullopt;
}

/// Of going on from a vertex, when coming from its other neighbour; per solid angle.
double BdptTwin::scattering_pdf(const TwinPath& path, size_t i, bool towards_camera) const {
    const TwinVertex& v = path.vertices[i];
    if (v.delta) return 1.0;
    const Frame<float> frame = make_frame(to_triple(v.shading_normal));
    const Triple<float> from = frame.to_local(to_triple(direction_at(path, i, !towards_camera)));
    const Triple<float> to = frame.to_local(to_triple(direction_at(path, i, towards_camera)));
    return evaluate_bsdf(v.bsdf, from, to).pdf;
}

/// Of making vertex i from its neighbour, which is no end of the path.
double BdptTwin::area_pdf(const TwinPath& path, size_t i, bool from_light) const {
    const size_t from = from_light ? i - 1 : i + 1;
    const Vec3& here = path.vertices[i].position;
    return scattering_pdf(path, from, from_light) *
           cosine(path.vertices[i].geometric_normal, direction_at(path, i, !from_light)) /
           squared_distance(here, path.vertices[from].position);
}

/// Of next event estimation, per solid angle at the first vertex (lights of no size: probability).
double BdptTwin::direct_pdf(const TwinPath& path) const {
    const double probability = context_.lights.probability(path.light);
    if (path.delta_light) return probability;
    const Vec3& x = path.vertices[0].position;
    if (path.infinite) return probability * context_.lights.environment()->pdf(-path.light_direction);
    if (path.light < context_.scene.lights.size()) return context_.lights.pdf_sphere(path.light, x);
    return probability * squared_distance(x, path.light_point) /
           (cosine(path.light_normal, path.light_direction) * path.light_area);
}

bool BdptTwin::exists(const TwinPath& path, size_t s) const {
    const size_t n = path.vertices.size();
    if (s == 0) return !path.delta_light;
    // Vertices s - 2 and s - 1 (from 0 at the first surface) are joined; the light or camera may be one of them.
    return (s < 2 || !path.vertices[s - 2].delta) && (s > n || !path.vertices[s - 1].delta);
}

// Of all vertices, s of them from the light: the light's point, then surface vertices 0 .. s - 2.
double BdptTwin::density(const TwinPath& path, size_t s) const {
    const size_t n = path.vertices.size();
    double result = s == n + 1 ? static_cast<double>(light_paths_) : 1.0;  // As many samples of strategy t = 1.
    for (size_t i = 0; i < n; ++i) {
        const bool from_light = i + 2 <= s;
        if (from_light && i > 0) result *= area_pdf(path, i, true);
        if (!from_light) result *= i + 1 == n ? static_cast<double>(path.camera_density) : area_pdf(path, i, false);
    }
    // The light's point, per area (per solid angle where infinitely far, probability where the light has no size); the
    // first surface vertex with it where both come from the light.
    const Vec3& x = path.vertices[0].position;
    const double to_area = path.infinite || path.delta_light ? 1.0
                                                             : cosine(path.light_normal, path.light_direction) /
                                                                   squared_distance(x, path.light_point);
    if (s == 0) return result * scattering_pdf(path, 0, false) * to_area;
    if (s == 1) return result * direct_pdf(path) * to_area;
    const double first_cosine = cosine(path.vertices[0].geometric_normal, path.light_direction);
    const double probability = context_.lights.probability(path.light);
    const auto rays = static_cast<double>(
        emission_.ray_density(path.light, static_cast<float>(direct_pdf(path)), x, path.light_direction, 1.0F));
    if (path.infinite) return result * rays * first_cosine;
    const double d2 = squared_distance(x, path.light_point);
    if (path.light >= context_.scene.lights.size()) {
        return result * probability / path.light_area * cosine(path.light_normal, path.light_direction) / M_PI *
               first_cosine / d2;
    }
    const double direction = static_cast<double>(emission_.direction_pdf(path.light, path.light_direction));
    const PunctualLight& light = context_.scene.lights[path.light];
    const double position = light.kind != LightKind::sphere ? 1.0
                                                            : cosine(path.light_normal, path.light_direction) /
                                                                  (M_PI * light.radius * light.radius);
    return result * probability * direction * position * first_cosine / d2;
}

std::vector<double> BdptTwin::explicit_weights(const TwinPath& path) const {
    std::vector<double> weights(path.vertices.size() + 2, 0.0);
    double sum = 0.0;
    for (size_t s = 0; s < weights.size(); ++s) {
        if (!exists(path, s)) continue;
        const double p = density(path, s);
        weights[s] = p * p;
        sum += weights[s];
    }
    for (double& weight : weights) weight /= sum;
    return weights;
}

std::vector<double> BdptTwin::recursive_weights(const TwinPath& path) const {
    const size_t n = path.vertices.size();
    const auto distance = [&](size_t a, size_t b) {
        return static_cast<float>(std::sqrt(squared_distance(path.vertices[a].position, path.vertices[b].position)));
    };
    const auto cosine_at = [&](size_t i, bool towards_camera) {
        return static_cast<float>(cosine(path.vertices[i].geometric_normal, direction_at(path, i, towards_camera)));
    };
    const auto pdf = [&](size_t i, bool towards_camera) {
        return static_cast<float>(scattering_pdf(path, i, towards_camera));
    };
    const auto direct = static_cast<float>(direct_pdf(path));
    const float rays = emission_.ray_density(path.light, direct, path.vertices[0].position, path.light_direction,
                                             static_cast<float>(light_distance(path)));
    std::vector<MisSums<float>> light(n), camera(n), camera_past(n);
    light[0] = mis_light_start(direct, rays, cosine_at(0, false), path.delta_light);
    for (size_t i = 1; i < n; ++i) {
        const auto past = mis_scatter(light[i - 1], cosine_at(i - 1, true), pdf(i - 1, true), pdf(i - 1, false),
                                      path.vertices[i - 1].delta);
        light[i] = mis_arrive(past, distance(i - 1, i), cosine_at(i, false));
    }
    camera[n - 1] = mis_camera_start(path.camera_density, light_paths_);
    for (size_t i = n; i-- > 0;) {
        camera_past[i] =
            mis_scatter(camera[i], cosine_at(i, false), pdf(i, false), pdf(i, true), path.vertices[i].delta);
        if (i > 0) camera[i - 1] = mis_arrive(camera_past[i], distance(i - 1, i), cosine_at(i - 1, true));
    }
    std::vector<double> weights(n + 2, 0.0);
    for (size_t s = 0; s < weights.size(); ++s) {
        if (!exists(path, s)) continue;
        if (s == 0) {
            weights[s] = mis_weight_hit(camera_past[0], direct, rays);
        } else if (s == 1) {
            weights[s] = mis_weight_light(camera[0], direct, path.delta_light ? 0.0F : pdf(0, false), rays,
                                          cosine_at(0, false), pdf(0, true));
        } else if (s == n + 1) {
            weights[s] = mis_weight_camera(light[n - 1], path.camera_density, light_paths_, pdf(n - 1, false));
        } else {
            const size_t y = s - 2, z = s - 1;
            const float inverse2 = 1.0F / squared(distance(y, z));
            weights[s] =
                1.0F / (1.0F + mis_others(light[y], pdf(z, false) * cosine_at(y, true) * inverse2, pdf(y, false)) +
                        mis_others(camera[z], pdf(y, true) * cosine_at(z, false) * inverse2, pdf(z, true)));
        }
    }
    return weights;
}

}  // namespace nephroid::testing

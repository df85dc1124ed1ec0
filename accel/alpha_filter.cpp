#include "accel/alpha_filter.h"

#include <bit>

#include "core/sampler.h"

namespace nephroid {

namespace {

float alpha_at(const AlphaFilterData& data, uint32_t primitive, float u, float v) {
    const Triangle& t = data.mesh->triangles[primitive];
    const float w = 1.0F - u - v;
    float alpha = data.material->base_color.a;
    if (!data.mesh->colors.empty()) {
        alpha *= w * data.mesh->colors[t[0]].a + u * data.mesh->colors[t[1]].a + v * data.mesh->colors[t[2]].a;
    }
    const TextureReference& texture = data.material->base_color_texture;
    if (texture.image >= 0) {
        const auto& uvs = data.mesh->uvs[static_cast<size_t>(texture.uv_set)];
        const Vec2 uv = uvs.empty() ? Vec2(0.0F) : w * uvs[t[0]] + u * uvs[t[1]] + v * uvs[t[2]];
        alpha *= sample_texture(data.scene->images[static_cast<size_t>(texture.image)], texture, uv).a;
    }
    return alpha;
}

void filter(const RTCFilterFunctionNArguments* arguments) {
    const auto& data = *static_cast<const AlphaFilterData*>(arguments->geometryUserPtr);
    const unsigned n = arguments->N;
    for (unsigned i = 0; i < n; ++i) {
        if (arguments->valid[i] == 0) continue;
        const uint32_t primitive = RTCHitN_primID(arguments->hit, n, i);
        const float alpha = alpha_at(data, primitive, RTCHitN_u(arguments->hit, n, i), RTCHitN_v(arguments->hit, n, i));
        float threshold = data.material->alpha_cutoff;
        if (data.material->alpha_mode == AlphaMode::blend) {
            const uint32_t ray =
                hash_combine(std::bit_cast<uint32_t>(RTCRayN_dir_x(arguments->ray, n, i)),
                             hash_combine(std::bit_cast<uint32_t>(RTCRayN_dir_y(arguments->ray, n, i)),
                                          std::bit_cast<uint32_t>(RTCRayN_dir_z(arguments->ray, n, i))));
            // A threshold in (0, 1]: alpha 1 always stays, alpha 0 never does.
            threshold = unit_float(hash_combine(ray, primitive)) + 0x1p-24F;
        }
        if (alpha < threshold) arguments->valid[i] = 0;
    }
}

}  // namespace

void attach_alpha_filter(RTCGeometry geometry, AlphaFilterData& data) {
    rtcSetGeometryUserData(geometry, &data);
    rtcSetGeometryIntersectFilterFunction(geometry, filter);
    rtcSetGeometryOccludedFilterFunction(geometry, filter);
}

}  // namespace nephroid

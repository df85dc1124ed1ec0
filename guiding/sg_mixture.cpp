#include "guiding/sg_mixture.h"

#include <algorithm>
#include <cmath>

#include "guiding/hemisphere.h"

namespace nephroid {

namespace {

/// Lobes whose exponent is below are zero next to the protective lobe: exp(-60) times the largest density, 1e8, is
/// 1e-18 per steradian.
constexpr float negligible_exponent = -60.0F;
/// With an axis of zero: negligible in every direction.
constexpr float no_lobe_sharpness = 1e6F;

}  // namespace

SgMixtures::SgMixtures(const Cache& cache, const Options& options)
    : cache_(cache),
      options_(options),
      axis_x_(padded_to_packets(cache.most_lobes())),
      axis_y_(axis_x_.size()),
      axis_z_(axis_x_.size()),
      sharpness_(axis_x_.size()),
      weight_(axis_x_.size()),
      density_(axis_x_.size()) {}

float SgMixtures::cached_fraction(std::span<const FoundPoint> found) const {
    const CachedPoint& point = cache_.points[found[0].index];
    return point.lobe_count == 0 ? 0.0F : point.fraction;
}

void SgMixtures::add(std::span<const FoundPoint> found, const GuideVertex& vertex, float fraction) {
    const Vec3& x = vertex.position;
    const CachedPoint& point = cache_.points[found[0].index];
    is_full_ = true;
    fraction_ = fraction;
    normal_ = vertex.geometric_normal;
    count_ = point.lobe_count;
    const float lobes_weight = 1.0F - options_.protective_weight;
    protective_weight_ = 1.0F;
    for (size_t i = 0; i < count_; ++i) {
        const SgLobe& lobe = cache_.lobes[point.first_lobe + i];
        const Vec3 axis =
            options_.warp == SgWarp::mirror ? mirror_axis(lobe, x) : glm::normalize(lobe.reflector - point.position);
        axis_x_[i] = axis.x;
        axis_y_[i] = axis.y;
        axis_z_[i] = axis.z;
        sharpness_[i] = lobe.sharpness;
        weight_[i] = lobes_weight * lobe.weight;
        density_[i] = weight_[i] / unit_integral(lobe.sharpness);
        protective_weight_ -= weight_[i];
    }
    for (size_t i = count_; i % simd_width != 0; ++i) {
        axis_x_[i] = axis_y_[i] = axis_z_[i] = 0.0F;
        sharpness_[i] = no_lobe_sharpness;
    }
}

Vec3 SgMixtures::sample(size_t, float u_choice, float u, float v) const {
    float left = u_choice;
    for (size_t i = 0; i < count_; ++i) {
        if (left < weight_[i]) {
            const Triple<float> axis{axis_x_[i], axis_y_[i], axis_z_[i]};
            return to_vec3(sample_spherical_gaussian(axis, sharpness_[i], u, v));
        }
        left -= weight_[i];
    }
    return sample_uniform_hemisphere(normal_, u, v);
}

float SgMixtures::pdf(size_t, const Vec3& wi) const {
    float density = protective_weight_ * uniform_hemisphere_pdf(normal_, wi);
    const Triple<FloatV> direction{FloatV(wi.x), FloatV(wi.y), FloatV(wi.z)};
    for (size_t i = 0; i < count_; i += simd_width) {
        const auto load = [i](const Array& array) { return FloatV(&array[i], stdx::vector_aligned); };
        const Triple<FloatV> axis{load(axis_x_), load(axis_y_), load(axis_z_)};
        const Triple<FloatV> difference = direction - axis;
        const FloatV exponent = FloatV(-0.5F) * load(sharpness_) * dot(difference, difference);
        const auto near = exponent > FloatV(negligible_exponent);
        if (stdx::none_of(near)) continue;
        // Few lanes are near: lobes are narrow.
        for (size_t lane = 0; lane < simd_width; ++lane) {
            if (near[lane]) density += density_[i + lane] * std::exp(exponent[lane]);
        }
    }
    return density;
}

LobeView SgMixtures::heaviest(size_t) const {
    if (count_ == 0) return {};
    const size_t i = static_cast<size_t>(std::max_element(&weight_[0], &weight_[0] + count_) - &weight_[0]);
    return {{axis_x_[i], axis_y_[i], axis_z_[i]}, std::sqrt(2.0F * std::log(2.0F) / sharpness_[i])};
}

}  // namespace nephroid

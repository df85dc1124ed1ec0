#include "guiding/slope_mixture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "guiding/hemisphere.h"

namespace nephroid {

namespace {

/// Distances below this share of a point's reach count as equal.
constexpr float kernel_width = 0.125F;

/// A lobe that rounding has left without a volume, or with an infinite one, is not used.
constexpr float most_determinant = 1e30F;

}  // namespace

SlopeMixture::SlopeMixture(const Cache& cache, const Options& options)
    : cache_(cache),
      options_(options),
      cached_(padded_to_packets(most_points * cache.most_lobes())),
      kernel_(cached_.size()),
      from_x_(cached_.size()),
      from_y_(cached_.size()),
      from_z_(cached_.size()),
      lobe_{Array(cached_.size()), Array(cached_.size()), Array(cached_.size()),
            Array(cached_.size()), Array(cached_.size()), Array(cached_.size()),
            Array(cached_.size()), Array(cached_.size()), Array(cached_.size())},
      weight_(cached_.size()),
      density_(cached_.size()) {}

float SlopeMixture::prepare(std::span<const FoundPoint> found, const Vec3& x, const Vec3& normal) {
    count_ = 0;
    normal_ = normal;
    float fraction = 0.0F, kernels = 0.0F;
    for (const FoundPoint& near : found) {
        const CachedPoint& point = cache_.points[near.index];
        const float width = kernel_width * point.reach;
        const float kernel = width * width / (near.squared_distance + width * width);
        kernels += kernel;
        fraction += kernel * point.fraction;
        collect(point, kernel);
    }
    if (count_ == 0) return 0.0F;
    const float total = warp(x);
    if (!(total > 0.0F) || !(total < std::numeric_limits<float>::infinity())) return 0.0F;
    normalise(total);
    return fraction / kernels;
}

void SlopeMixture::collect(const CachedPoint& point, float kernel) {
    for (uint32_t i = 0; i < point.lobe_count; ++i) {
        cached_[count_] = point.first_lobe + i;
        kernel_[count_] = kernel;
        from_x_[count_] = point.position.x;
        from_y_[count_] = point.position.y;
        from_z_[count_] = point.position.z;
        ++count_;
    }
}

// Returns the sum of the weights. Vectors reach behind the last lobe: everything is zero there.
NEPHROID_FLATTEN float SlopeMixture::warp(const Vec3& x) {
    const Triple<FloatV> to{FloatV(x.x), FloatV(x.y), FloatV(x.z)};
    const FloatV zero(0.0F);
    FloatV total(0.0F);
    for (size_t i = 0; i < count_; i += simd_width) {
        const auto active = first_lanes(count_ - i);
        const CachedSlopeLobe<FloatV> cached = cache_.lobes.gather(UintV(&cached_[i], stdx::vector_aligned), active);
        const auto load = [i](const Array& array) { return FloatV(&array[i], stdx::vector_aligned); };
        const SlopeLobe<FloatV> lobe = warped(cached, to, {load(from_x_), load(from_y_), load(from_z_)}, options_.warp);
        const FloatV determinant = lobe.determinant();
        const auto usable = active && (determinant > zero) && (determinant < FloatV(most_determinant)) &&
                            (dot(lobe.axis, lobe.axis) < FloatV(2.0F));
        const auto fields = std::bit_cast<std::array<FloatV, 9>>(lobe);
        for (size_t f = 0; f < fields.size(); ++f) {
            select(usable, fields[f], zero).copy_to(&lobe_[f][i], stdx::vector_aligned);
        }
        const FloatV weight = select(usable, cached.weight * load(kernel_), zero);
        weight.copy_to(&weight_[i], stdx::vector_aligned);
        select(usable, determinant, zero).copy_to(&density_[i], stdx::vector_aligned);
        total += weight;
    }
    return stdx::reduce(total);
}

// Weights to probabilities, determinants to densities.
void SlopeMixture::normalise(float total) {
    const FloatV scale((1.0F - options_.protective_weight) / total);
    FloatV sum(0.0F);
    for (size_t i = 0; i < count_; i += simd_width) {
        const FloatV weight = FloatV(&weight_[i], stdx::vector_aligned) * scale;
        weight.copy_to(&weight_[i], stdx::vector_aligned);
        (FloatV(&density_[i], stdx::vector_aligned) * weight * FloatV(inv_pi))
            .copy_to(&density_[i], stdx::vector_aligned);
        sum += weight;
    }
    protective_weight_ = 1.0F - stdx::reduce(sum);
}

SlopeLobe<FloatV> SlopeMixture::load(size_t i) const {
    std::array<FloatV, 9> fields;
    for (size_t f = 0; f < fields.size(); ++f) fields[f].copy_from(&lobe_[f][i], stdx::vector_aligned);
    return std::bit_cast<SlopeLobe<FloatV>>(fields);
}

SlopeLobe<float> SlopeMixture::get(size_t i) const {
    std::array<float, 9> fields;
    for (size_t f = 0; f < fields.size(); ++f) fields[f] = lobe_[f][i];
    return std::bit_cast<SlopeLobe<float>>(fields);
}

Vec3 SlopeMixture::sample(float u_choice, float u, float v) const {
    float left = u_choice;
    for (size_t i = 0; i < count_; ++i) {
        if (left < weight_[i]) return sample_slope_lobe(get(i), left / weight_[i], u, v);
        left -= weight_[i];
    }
    return sample_uniform_hemisphere(normal_, u, v);
}

NEPHROID_FLATTEN float SlopeMixture::pdf(const Vec3& wi) const {
    const Triple<FloatV> w{FloatV(wi.x), FloatV(wi.y), FloatV(wi.z)};
    FloatV sum(0.0F);
    for (size_t i = 0; i < count_; i += simd_width) {
        sum += relative_density(load(i), w) * FloatV(&density_[i], stdx::vector_aligned);
    }
    return protective_weight_ * uniform_hemisphere_pdf(normal_, wi) + stdx::reduce(sum);
}

LobeView SlopeMixture::heaviest() const {
    if (count_ == 0) return {};
    const size_t i = static_cast<size_t>(std::max_element(&weight_[0], &weight_[0] + count_) - &weight_[0]);
    const SlopeLobe<float> lobe = get(i);
    // GGX holds half of its slopes within its width.
    return {to_vec3(lobe.axis), 1.0F / std::sqrt(lobe.determinant())};
}

}  // namespace nephroid

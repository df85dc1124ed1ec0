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

}  // namespace

SlopeMixtures::SlopeMixtures(const Cache& cache, const Options& options)
    : cache_(cache),
      options_(options),
      cached_(padded_to_packets(enough_lobes + most_points * cache.most_lobes())),
      kernel_(cached_.size()),
      from_x_(cached_.size()),
      from_y_(cached_.size()),
      from_z_(cached_.size()),
      to_x_(cached_.size()),
      to_y_(cached_.size()),
      to_z_(cached_.size()),
      lobe_{Array(cached_.size()), Array(cached_.size()), Array(cached_.size()),
            Array(cached_.size()), Array(cached_.size()), Array(cached_.size()),
            Array(cached_.size()), Array(cached_.size()), Array(cached_.size())},
      weight_(cached_.size()),
      density_(cached_.size()) {}

void SlopeMixtures::clear() {
    size_ = 0;
    lobe_count_ = 0;
}

void SlopeMixtures::add(std::span<const FoundPoint> found, const Vec3& x, const Vec3& normal) {
    Mixture& mixture = mixtures_[size_++];
    mixture.normal = normal;
    mixture.first_lobe = static_cast<uint32_t>(lobe_count_);
    float fraction = 0.0F, kernels = 0.0F;
    for (const FoundPoint& near : found) {
        if (lobe_count_ - mixture.first_lobe >= enough_for_mixture) break;
        const CachedPoint& point = cache_.points[near.index];
        const float width = kernel_width * point.reach;
        const float kernel = width * width / (near.squared_distance + width * width);
        kernels += kernel;
        fraction += kernel * point.fraction;
        collect(point, kernel, x);
    }
    mixture.lobe_count = static_cast<uint32_t>(lobe_count_) - mixture.first_lobe;
    mixture.fraction = mixture.lobe_count == 0 ? 0.0F : fraction / kernels;
}

void SlopeMixtures::collect(const CachedPoint& point, float kernel, const Vec3& x) {
    for (uint32_t k = 0; k < point.lobe_count; ++k) {
        const size_t i = lobe_count_++;
        cached_[i] = point.first_lobe + k;
        cache_.lobes.prefetch(cached_[i]);
        kernel_[i] = kernel;
        from_x_[i] = point.position.x;
        from_y_[i] = point.position.y;
        from_z_[i] = point.position.z;
        to_x_[i] = x.x;
        to_y_[i] = x.y;
        to_z_[i] = x.z;
    }
}

void SlopeMixtures::prepare() {
    warp();
    for (size_t k = 0; k < size_; ++k) {
        if (mixtures_[k].fraction > 0.0F) normalise(mixtures_[k]);
    }
}

NEPHROID_FLATTEN void SlopeMixtures::warp() {
    const FloatV zero(0.0F);
    for (size_t i = 0; i < lobe_count_; i += simd_width) {
        const auto active = first_lanes(lobe_count_ - i);
        const CachedSlopeLobe<FloatV> cached = cache_.lobes.gather(UintV(&cached_[i], stdx::vector_aligned), active);
        const auto load = [i](const Array& array) { return FloatV(&array[i], stdx::vector_aligned); };
        const SlopeLobe<FloatV> lobe = warped(cached, {load(to_x_), load(to_y_), load(to_z_)},
                                              {load(from_x_), load(from_y_), load(from_z_)}, options_.warp);
        const FloatV determinant = lobe.determinant();
        const auto usable = active && is_usable(lobe);
        const auto fields = std::bit_cast<std::array<FloatV, 9>>(lobe);
        for (size_t f = 0; f < fields.size(); ++f) {
            select(usable, fields[f], zero).copy_to(&lobe_[f][i], stdx::vector_aligned);
        }
        select(usable, cached.weight * load(kernel_), zero).copy_to(&weight_[i], stdx::vector_aligned);
        select(usable, determinant, zero).copy_to(&density_[i], stdx::vector_aligned);
    }
}

// Weights to probabilities, determinants to densities.
void SlopeMixtures::normalise(Mixture& mixture) {
    float total = 0.0F;
    const size_t end = mixture.first_lobe + mixture.lobe_count;
    for (size_t i = mixture.first_lobe; i < end; ++i) total += weight_[i];
    if (!(total > 0.0F) || !(total < std::numeric_limits<float>::infinity())) {
        mixture.fraction = 0.0F;
        return;
    }
    const float scale = (1.0F - options_.protective_weight) / total;
    mixture.protective_weight = 1.0F;
    for (size_t i = mixture.first_lobe; i < end; ++i) {
        weight_[i] *= scale;
        density_[i] *= weight_[i] * inv_pi;
        mixture.protective_weight -= weight_[i];
    }
}

SlopeLobe<float> SlopeMixtures::get(size_t i) const {
    std::array<float, 9> fields;
    for (size_t f = 0; f < fields.size(); ++f) fields[f] = lobe_[f][i];
    return std::bit_cast<SlopeLobe<float>>(fields);
}

Vec3 SlopeMixtures::sample(size_t k, float u_choice, float u, float v) const {
    const Mixture& mixture = mixtures_[k];
    float left = u_choice;
    for (size_t i = mixture.first_lobe; i < mixture.first_lobe + mixture.lobe_count; ++i) {
        if (left < weight_[i]) return sample_slope_lobe(get(i), left / weight_[i], u, v);
        left -= weight_[i];
    }
    return sample_uniform_hemisphere(mixture.normal, u, v);
}

NEPHROID_FLATTEN float SlopeMixtures::pdf(size_t k, const Vec3& wi) const {
    const Mixture& mixture = mixtures_[k];
    const Triple<FloatV> w{FloatV(wi.x), FloatV(wi.y), FloatV(wi.z)};
    FloatV sum(0.0F);
    for (size_t i = 0; i < mixture.lobe_count; i += simd_width) {
        const auto load = [first = mixture.first_lobe + i](const Array& array) {
            return FloatV(&array[first], stdx::element_aligned);
        };
        const SlopeLobe<FloatV> lobe{{load(lobe_[0]), load(lobe_[1]), load(lobe_[2])},
                                     {load(lobe_[3]), load(lobe_[4]), load(lobe_[5])},
                                     {load(lobe_[6]), load(lobe_[7]), load(lobe_[8])}};
        const FloatV density = relative_density(lobe, w) * load(density_);
        // The next mixture's lobes follow.
        sum += select(first_lanes(mixture.lobe_count - i), density, FloatV(0.0F));
    }
    return mixture.protective_weight * uniform_hemisphere_pdf(mixture.normal, wi) + stdx::reduce(sum);
}

LobeView SlopeMixtures::heaviest(size_t k) const {
    const Mixture& mixture = mixtures_[k];
    if (mixture.lobe_count == 0) return {};
    const float* first = &weight_[mixture.first_lobe];
    const auto i = static_cast<size_t>(std::max_element(first, first + mixture.lobe_count) - &weight_[0]);
    const SlopeLobe<float> lobe = get(i);
    // GGX holds half of its slopes within its width.
    return {to_vec3(lobe.axis), 1.0F / std::sqrt(lobe.determinant())};
}

}  // namespace nephroid

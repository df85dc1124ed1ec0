#include "guiding/slope_mixture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "guiding/hemisphere.h"

namespace nephroid {

namespace {

/// Distances below this share of a point's reach count as equal.
constexpr float kernel_width = 0.125F;

/// What the BSDF samples at glossy points is noisier than what lobes bring, and known as a mean over all directions
/// only: it counts so many times, and keeps at least a third (docs/guiding.md).
constexpr float bsdf_factor = 4.0F;
constexpr float most_glossy_fraction = 0.65F;
/// Guides that would be asked less often than that are not.
constexpr float least_glossy_fraction = 0.002F;

/// Lobes and products that bring less than this share of what a glossy point's mixture brings are dropped.
constexpr float least_glossy_share = 1e-3F;

std::array<AlignedArray<float>, 9> nine_arrays(size_t size) {
    using Array = AlignedArray<float>;
    return {Array(size), Array(size), Array(size), Array(size), Array(size),
            Array(size), Array(size), Array(size), Array(size)};
}

}  // namespace

SlopeMixtures::SlopeMixtures(const Cache& cache, const Options& options)
    : cache_(cache),
      options_(options),
      cached_(padded_to_packets(enough_lobes + most_points * cache.most_lobes())),
      mixture_(cached_.size()),
      kernel_(cached_.size()),
      from_x_(cached_.size()),
      from_y_(cached_.size()),
      from_z_(cached_.size()),
      to_x_(cached_.size()),
      to_y_(cached_.size()),
      to_z_(cached_.size()),
      lobe_(nine_arrays(3 * cached_.size() + simd_width)),
      weight_(lobe_[0].size()),
      density_(lobe_[0].size()),
      views_(most_mixtures),
      product_(nine_arrays(cached_.size() + simd_width)),
      product_density_(product_[0].size()),
      own_weight_(product_[0].size()),
      product_weight_(product_[0].size()),
      bsdf_weight_(product_[0].size()) {}

void SlopeMixtures::clear() {
    size_ = 0;
    lobe_count_ = 0;
    has_glossy_ = false;
}

void SlopeMixtures::add(std::span<const FoundPoint> found, const GuideVertex& vertex, float fraction) {
    Mixture& mixture = mixtures_[size_++];
    mixture.normal = vertex.geometric_normal;
    mixture.first_lobe = static_cast<uint32_t>(lobe_count_);
    mixture.other_radiance = 0.0F;
    for (const FoundPoint& near : found) {
        if (lobe_count_ - mixture.first_lobe >= enough_for_mixture) break;
        const CachedPoint& point = cache_.points[near.index];
        const float kernel = kernel_of(near);
        mixture.other_radiance += kernel * point.other_radiance;
        collect(point, kernel, vertex.position);
    }
    mixture.lobe_count = static_cast<uint32_t>(lobe_count_) - mixture.first_lobe;
    mixture.fraction = fraction;
    const BsdfParameters<float>& bsdf = vertex.bsdf;
    mixture.is_glossy = is_narrow(bsdf.alpha, bsdf.metallic, bsdf.coat_f90) && fraction > 0.0F;
    look_from(vertex, mixture);
}

// Of the points that add() asks.
float SlopeMixtures::cached_fraction(std::span<const FoundPoint> found) const {
    float fraction = 0.0F, kernels = 0.0F;
    uint32_t lobes = 0;
    for (const FoundPoint& near : found) {
        if (lobes >= enough_for_mixture) break;
        const CachedPoint& point = cache_.points[near.index];
        const float kernel = kernel_of(near);
        kernels += kernel;
        fraction += kernel * point.fraction;
        lobes += point.lobe_count;
    }
    return lobes == 0 ? 0.0F : fraction / kernels;
}

float SlopeMixtures::kernel_of(const FoundPoint& near) const {
    const float width = kernel_width * cache_.points[near.index].reach;
    return width * width / (near.squared_distance + width * width);
}

void SlopeMixtures::look_from(const GuideVertex& vertex, Mixture& mixture) {
    if (mixture.is_glossy) {
        // Those before have no view; what an earlier group left there would be multiplied.
        for (size_t k = 0; k + 1 < size_ && !has_glossy_; ++k) views_.set(k, {});
        const Frame<float> frame = make_frame(to_triple(vertex.shading_normal));
        views_.set(size_ - 1, make_glossy_view(vertex.bsdf, to_triple(vertex.wo), frame));
        has_glossy_ = true;
    } else if (has_glossy_) {
        views_.set(size_ - 1, {});
    }
}

void SlopeMixtures::collect(const CachedPoint& point, float kernel, const Vec3& x) {
    for (uint32_t k = 0; k < point.lobe_count; ++k) {
        const size_t i = lobe_count_++;
        cached_[i] = point.first_lobe + k;
        mixture_[i] = static_cast<uint32_t>(size_ - 1);
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
    if (has_glossy_) multiply();
    kept_end_ = cached_.size();
    for (size_t k = 0; k < size_; ++k) {
        Mixture& mixture = mixtures_[k];
        if (mixture.fraction == 0.0F) continue;
        if (mixture.is_glossy) {
            weigh_glossy(mixture);
        } else {
            const float* first = &weight_[mixture.first_lobe];
            normalise(mixture, std::accumulate(first, first + mixture.lobe_count, 0.0F));
        }
    }
}

NEPHROID_FLATTEN void SlopeMixtures::warp() {
    const FloatV zero(0.0F);
    for (size_t i = 0; i < lobe_count_; i += simd_width) {
        const auto active = first_lanes(lobe_count_ - i);
        const CachedSlopeLobe<FloatV> cached = cache_.lobes.gather(&cached_[i], lobe_count_ - i);
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

// Weights that add up to `total` to probabilities, determinants to densities.
void SlopeMixtures::normalise(Mixture& mixture, float total) {
    if (!(total > 0.0F) || !(total < std::numeric_limits<float>::infinity())) {
        // No lobe can be used here, one point in ten million. The fraction stays: it may have been asked for before.
        mixture.lobe_count = 0;
        mixture.protective_weight = 1.0F;
        return;
    }
    const float scale = (1.0F - options_.protective_weight) / total;
    mixture.protective_weight = 1.0F;
    for (size_t i = mixture.first_lobe; i < mixture.first_lobe + mixture.lobe_count; ++i) {
        weight_[i] *= scale;
        density_[i] *= weight_[i] * inv_pi;
        mixture.protective_weight -= weight_[i];
    }
}

// Products of all glossy points' lobes, with weights for both in what they bring to wo.
NEPHROID_FLATTEN void SlopeMixtures::multiply() {
    const FloatV zero(0.0F);
    for (size_t i = 0; i < lobe_count_; i += simd_width) {
        const auto active = first_lanes(lobe_count_ - i);
        const GlossyView<FloatV> view = views_.gather(&mixture_[i], lobe_count_ - i);
        const auto glossy = active && (view.alpha > zero);
        if (!any_of(glossy)) continue;
        const auto load = [i](const Array& array) { return FloatV(&array[i], stdx::vector_aligned); };
        std::array<FloatV, 9> fields;
        for (size_t f = 0; f < fields.size(); ++f) fields[f] = load(lobe_[f]);
        const FloatV weight = load(weight_);
        const LobeProduct<FloatV> product = make_lobe_product(std::bit_cast<SlopeLobe<FloatV>>(fields), view);
        const auto usable = glossy && (weight > zero) && is_finite(product.own_weight) &&
                            is_finite(product.product_weight) && is_finite(product.bsdf_weight);
        const auto store = [i](const FloatV& value, Array& array) { value.copy_to(&array[i], stdx::vector_aligned); };
        store(select(usable, weight * (view.diffuse + product.own_weight), zero), own_weight_);
        store(select(usable, weight * product.bsdf_weight, zero), bsdf_weight_);
        store(select(usable, weight * product.product_weight, zero), product_weight_);
        store(product.lobe.determinant(), product_density_);
        fields = std::bit_cast<std::array<FloatV, 9>>(product.lobe);
        for (size_t f = 0; f < fields.size(); ++f) store(fields[f], product_[f]);
    }
}

// Probabilities of lobes, products and the BSDF, from what each would bring.
void SlopeMixtures::weigh_glossy(Mixture& mixture) {
    const GlossyView<float>& view = views_.get(static_cast<size_t>(&mixture - mixtures_.data()));
    float guided = 0.0F, irradiance = 0.0F, bsdf = 0.0F;
    for (size_t i = mixture.first_lobe; i < mixture.first_lobe + mixture.lobe_count; ++i) {
        guided += own_weight_[i] + product_weight_[i];
        irradiance += weight_[i];
        bsdf += bsdf_weight_[i];
    }
    const float cosine = std::max(dot(view.wo, view.normal), 0.0F);
    bsdf += mixture.other_radiance * specular_reflectance(view, cosine);
    // The cached fraction is a diffuse surface's: so much goes to the BSDF for the diffuse part.
    bsdf += irradiance * view.diffuse * (1.0F - mixture.fraction) / mixture.fraction;
    const float fraction = std::min(guided / (guided + bsdf_factor * bsdf), most_glossy_fraction);
    if (!(fraction > least_glossy_fraction)) {
        mixture.fraction = 0.0F;
        return;
    }
    mixture.fraction = fraction;
    keep_heavy(mixture, least_glossy_share * guided);
}

// Lobes and products of more than that weight become the mixture.
void SlopeMixtures::keep_heavy(Mixture& mixture, float least_weight) {
    const size_t first = kept_end_;
    keep_heavy(mixture, lobe_, own_weight_, density_, least_weight);
    keep_heavy(mixture, product_, product_weight_, product_density_, least_weight);
    mixture.first_lobe = static_cast<uint32_t>(first);
    mixture.lobe_count = static_cast<uint32_t>(kept_end_ - first);
    normalise(mixture, std::accumulate(&weight_[first], &weight_[kept_end_], 0.0F));
}

NEPHROID_FLATTEN void SlopeMixtures::keep_heavy(const Mixture& mixture, const std::array<Array, 9>& lobes,
                                                const Array& weight, const Array& determinant, float least_weight) {
    for (size_t i = 0; i < mixture.lobe_count; i += simd_width) {
        const auto load = [first = mixture.first_lobe + i](const Array& array) {
            return FloatV(&array[first], stdx::element_aligned);
        };
        const FloatV weights = load(weight);
        // The next mixture's lobes follow.
        const auto heavy = first_lanes(mixture.lobe_count - i) && (weights > FloatV(least_weight));
        for (size_t f = 0; f < lobe_.size(); ++f) compress_store(&lobe_[f][kept_end_], load(lobes[f]), heavy);
        compress_store(&weight_[kept_end_], weights, heavy);
        compress_store(&density_[kept_end_], load(determinant), heavy);
        kept_end_ += count_of(heavy);
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

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

/// Wider specular parts vary less over a lobe than is worth the work.
constexpr float widest_glossy_alpha = 0.3F;

/// The BSDF's own sampling keeps at least a tenth at glossy points (lobes.md, Sec. 6).
constexpr float most_glossy_fraction = 0.9F;
/// Guides that would be asked less often than that are not.
constexpr float least_glossy_fraction = 0.002F;

/// Whether the specular part is narrow, but no mirror.
bool is_narrow(const BsdfParameters<float>& bsdf) {
    return bsdf.alpha >= delta_alpha && bsdf.alpha <= widest_glossy_alpha &&
           (bsdf.metallic > 0.0F || bsdf.coat_f90 > 0.0F);
}

Triple<FloatV> broadcast(const Triple<float>& v) {
    return {FloatV(v.x), FloatV(v.y), FloatV(v.z)};
}

GlossyView<FloatV> broadcast(const GlossyView<float>& view) {
    const BsdfParameters<float>& p = view.bsdf;
    return {broadcast(view.wo),
            broadcast(view.normal),
            broadcast(view.tangent),
            broadcast(view.bitangent),
            {broadcast(p.base), broadcast(p.coat_f0), FloatV(p.coat_f90), FloatV(p.metallic), FloatV(p.alpha)}};
}

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
      product_offset_(cached_.size()),
      lobe_{doubled(), doubled(), doubled(), doubled(), doubled(), doubled(), doubled(), doubled(), doubled()},
      weight_(doubled()),
      density_(doubled()) {}

void SlopeMixtures::clear() {
    size_ = 0;
    lobe_count_ = 0;
}

void SlopeMixtures::add(std::span<const FoundPoint> found, const GuideVertex& vertex) {
    Mixture& mixture = mixtures_[size_++];
    mixture.normal = vertex.geometric_normal;
    mixture.first_lobe = static_cast<uint32_t>(lobe_count_);
    float fraction = 0.0F, kernels = 0.0F;
    mixture.other_radiance = 0.0F;
    for (const FoundPoint& near : found) {
        if (lobe_count_ - mixture.first_lobe >= enough_for_mixture) break;
        const CachedPoint& point = cache_.points[near.index];
        const float width = kernel_width * point.reach;
        const float kernel = width * width / (near.squared_distance + width * width);
        kernels += kernel;
        fraction += kernel * point.fraction;
        mixture.other_radiance += kernel * point.other_radiance;
        collect(point, kernel, vertex.position);
    }
    mixture.lobe_count = static_cast<uint32_t>(lobe_count_) - mixture.first_lobe;
    mixture.fraction = mixture.lobe_count == 0 ? 0.0F : fraction / kernels;
    mixture.is_glossy = is_narrow(vertex.bsdf) && mixture.fraction > 0.0F;
    if (mixture.is_glossy) look_from(vertex, mixture);
}

void SlopeMixtures::look_from(const GuideVertex& vertex, Mixture& mixture) const {
    const Frame<float> frame = make_frame(to_triple(vertex.shading_normal));
    mixture.view = {to_triple(vertex.wo), frame.n, frame.s, frame.t, vertex.bsdf};
    const float cosine = std::max(glm::dot(vertex.wo, vertex.shading_normal), 0.0F);
    mixture.diffuse_value =
        (1.0F - vertex.bsdf.metallic) * coat_transmittance(vertex.bsdf, cosine) * luminance(vertex.bsdf.base) * inv_pi;
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
        if (mixtures_[k].fraction == 0.0F) continue;
        if (mixtures_[k].is_glossy) {
            weigh_glossy(mixtures_[k]);
        } else {
            normalise(mixtures_[k]);
        }
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
    mixture.protective_weight = options_.protective_weight;
    scale_weights(mixture.first_lobe, mixture.lobe_count, (1.0F - options_.protective_weight) / total);
}

void SlopeMixtures::scale_weights(size_t first, size_t count, float scale) {
    for (size_t i = first; i < first + count; ++i) {
        weight_[i] *= scale;
        density_[i] *= weight_[i] * inv_pi;
    }
}

// Probabilities of lobes, products and the BSDF, from what each would bring.
void SlopeMixtures::weigh_glossy(Mixture& mixture) {
    Totals totals = multiply(mixture);
    const float cosine = std::max(dot(mixture.view.wo, mixture.view.normal), 0.0F);
    totals.bsdf += mixture.other_radiance * luminance(specular_reflectance(mixture.view.bsdf, cosine));
    // The cached fraction is a diffuse surface's: so much goes to the BSDF for the diffuse part.
    totals.bsdf += totals.diffuse * (1.0F - mixture.fraction) / mixture.fraction;
    const float all = totals.guided + totals.bsdf;
    const float fraction = std::min(totals.guided / all, most_glossy_fraction);
    if (!(fraction > least_glossy_fraction) || !(all < std::numeric_limits<float>::infinity())) {
        mixture.fraction = 0.0F;
        return;
    }
    mixture.fraction = fraction;
    mixture.protective_weight = options_.protective_weight;
    const float scale = (1.0F - options_.protective_weight) / totals.guided;
    scale_weights(mixture.first_lobe, mixture.lobe_count, scale);
    scale_weights(mixture.first_lobe + product_offset_, mixture.lobe_count, scale);
}

// Lobes' weights become what they bring to wo; their products are appended.
NEPHROID_FLATTEN SlopeMixtures::Totals SlopeMixtures::multiply(const Mixture& mixture) {
    const GlossyView<FloatV> view = broadcast(mixture.view);
    const Triple<FloatV> mirror = view.normal * (FloatV(2.0F) * dot(view.normal, view.wo)) - view.wo;
    const FloatV zero(0.0F), diffuse(mixture.diffuse_value);
    FloatV guided(0.0F), bsdf(0.0F), irradiance(0.0F);
    for (size_t i = 0; i < mixture.lobe_count; i += simd_width) {
        const size_t at = mixture.first_lobe + i;
        const auto load = [at](const Array& array) { return FloatV(&array[at], stdx::element_aligned); };
        const FloatV weight = load(weight_);
        const auto active = first_lanes(mixture.lobe_count - i);
        const LobeProduct<FloatV> product = make_lobe_product(load_lobe(at), view, mirror);
        const auto usable = active && (weight > zero) && is_finite(product.own_weight) &&
                            is_finite(product.product_weight) && is_finite(product.bsdf_weight);
        const FloatV own = select(usable, weight * (diffuse + product.own_weight), zero);
        const FloatV joint = select(usable, weight * product.product_weight, zero);
        guided += own + joint;
        irradiance += select(usable, weight, zero);
        bsdf += select(usable, weight * product.bsdf_weight, zero);
        // The next mixture's lobes follow.
        select(active, own, weight).copy_to(&weight_[at], stdx::element_aligned);
        const auto fields = std::bit_cast<std::array<FloatV, 9>>(product.lobe);
        const size_t behind = at + product_offset_;
        const auto has_joint = joint > zero;
        for (size_t f = 0; f < fields.size(); ++f) {
            select(has_joint, fields[f], zero).copy_to(&lobe_[f][behind], stdx::element_aligned);
        }
        joint.copy_to(&weight_[behind], stdx::element_aligned);
        select(has_joint, product.lobe.determinant(), zero).copy_to(&density_[behind], stdx::element_aligned);
    }
    return {stdx::reduce(guided), stdx::reduce(irradiance) * mixture.diffuse_value, stdx::reduce(bsdf)};
}

SlopeLobe<float> SlopeMixtures::get(size_t i) const {
    std::array<float, 9> fields;
    for (size_t f = 0; f < fields.size(); ++f) fields[f] = lobe_[f][i];
    return std::bit_cast<SlopeLobe<float>>(fields);
}

SlopeLobe<FloatV> SlopeMixtures::load_lobe(size_t i) const {
    const auto load = [i](const Array& array) { return FloatV(&array[i], stdx::element_aligned); };
    return {{load(lobe_[0]), load(lobe_[1]), load(lobe_[2])},
            {load(lobe_[3]), load(lobe_[4]), load(lobe_[5])},
            {load(lobe_[6]), load(lobe_[7]), load(lobe_[8])}};
}

Vec3 SlopeMixtures::sample(size_t k, float u_choice, float u, float v) const {
    const Mixture& mixture = mixtures_[k];
    float left = u_choice;
    for (size_t i = mixture.first_lobe; i < mixture.first_lobe + mixture.lobe_count; ++i) {
        if (left < weight_[i]) return sample_slope_lobe(get(i), left / weight_[i], u, v);
        left -= weight_[i];
    }
    if (mixture.is_glossy) {
        const size_t first = mixture.first_lobe + product_offset_;
        for (size_t i = first; i < first + mixture.lobe_count; ++i) {
            if (left < weight_[i]) return sample_slope_lobe(get(i), left / weight_[i], u, v);
            left -= weight_[i];
        }
    }
    return sample_uniform_hemisphere(mixture.normal, u, v);
}

float SlopeMixtures::pdf(size_t k, const Vec3& wi) const {
    const Mixture& mixture = mixtures_[k];
    const Triple<FloatV> w{FloatV(wi.x), FloatV(wi.y), FloatV(wi.z)};
    float sum = density_of_lobes(mixture.first_lobe, mixture.lobe_count, w);
    if (mixture.is_glossy) sum += density_of_lobes(mixture.first_lobe + product_offset_, mixture.lobe_count, w);
    return mixture.protective_weight * uniform_hemisphere_pdf(mixture.normal, wi) + sum;
}

NEPHROID_FLATTEN float SlopeMixtures::density_of_lobes(size_t first, size_t count, const Triple<FloatV>& w) const {
    FloatV sum(0.0F);
    for (size_t i = 0; i < count; i += simd_width) {
        const FloatV density =
            relative_density(load_lobe(first + i), w) * FloatV(&density_[first + i], stdx::element_aligned);
        // The next mixture's lobes follow.
        sum += select(first_lanes(count - i), density, FloatV(0.0F));
    }
    return stdx::reduce(sum);
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

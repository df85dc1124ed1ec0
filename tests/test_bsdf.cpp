// The reflection model: sampling against density, energy, reciprocity, extremes of roughness and angle.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "core/bsdf.h"
#include "core/sampler.h"
#include "tests/statistics.h"

using namespace nephroid;

namespace {

BsdfParameters<float> metal(float alpha, float f0 = 1.0F) {
    return {{f0, f0, f0}, {0.04F, 0.04F, 0.04F}, 1.0F, 1.0F, alpha};
}
BsdfParameters<float> coated(float alpha, float albedo) {
    return {{albedo, 0.5F * albedo, 0.2F * albedo}, {0.04F, 0.04F, 0.04F}, 1.0F, 0.0F, alpha};
}
BsdfParameters<float> lambert(float albedo) {
    return {{albedo, albedo, albedo}, {0.0F, 0.0F, 0.0F}, 0.0F, 0.0F, 0.5F};
}
BsdfParameters<float> half_metal(float alpha) {
    return {{0.8F, 0.6F, 0.3F}, {0.04F, 0.04F, 0.04F}, 1.0F, 0.5F, alpha};
}

Triple<float> direction(float degrees, float azimuth = 0.3F) {
    const float theta = degrees * pi / 180.0F;
    return {std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth), std::cos(theta)};
}

/// Albedo of one direction, estimated with the model's own sampling.
double albedo(const BsdfParameters<float>& p, const Triple<float>& wo, double& variance_of_mean) {
    constexpr uint32_t n = 40000;
    double sum = 0.0;
    double squares = 0.0;
    for (uint32_t i = 0; i < n; ++i) {
        const auto [u, v] = sample_2d(SamplerKind::independent, 3U, i, 0);
        const BsdfSample<float> s = sample_bsdf(p, wo, sample_1d(SamplerKind::independent, 3U, i, 1), u, v);
        const double value = s.weight.x;
        sum += value;
        squares += value * value;
    }
    variance_of_mean = std::max(squares / n - sum * sum / n / n, 0.0) / n;
    return sum / n;
}

}  // namespace

TEST_CASE("BSDF sampling matches its density (chi-square)") {
    const std::vector<float> alphas = {1e-3F, 5e-3F, 0.05F, 0.3F, 1.0F};
    const std::vector<float> angles = {0.0F, 30.0F, 70.0F, 88.0F};
    const double significance = testing::sidak(0.01, static_cast<double>(alphas.size() * angles.size() * 4));
    for (const float alpha : alphas) {
        for (const float angle : angles) {
            for (const auto& p : {metal(alpha, 0.7F), coated(alpha, 0.8F), half_metal(alpha), lambert(0.5F)}) {
                const Triple<float> wo = direction(angle);
                const auto sample = [&](Vec2 u, float choice) -> testing::DirectionDraw {
                    const BsdfSample<float> s = sample_bsdf(p, wo, choice, u.x, u.y);
                    return {to_vec3(s.wi), max_component(s.weight) > 0.0F};
                };
                const auto pdf = [&](const Vec3& wi) {
                    return static_cast<double>(evaluate_bsdf(p, wo, to_triple(wi)).pdf);
                };
                const auto result =
                    testing::chi_square_directions(sample, pdf, Vec3(-wo.x, -wo.y, wo.z), 0.02 * alpha, 200000);
                INFO("alpha ", alpha, ", angle ", angle, ", metallic ", p.metallic, ": ", result.worst_bin,
                     ", integral ", result.integral, ", sampled ", result.sampled_share);
                CHECK(result.p_value > significance);
                CHECK(result.integral == doctest::Approx(result.sampled_share).epsilon(0.01));
            }
        }
    }
}

TEST_CASE("density times the Jacobian of the map from the unit square is one") {
    // Finite differences in the square give d omega / du; the lobe choice scales the density of each branch.
    const auto check = [](const BsdfParameters<float>& p, const Triple<float>& wo, float u, float v, float step) {
        const auto at = [&](float du, float dv) {
            const BsdfSample<float> s = sample_bsdf(p, wo, 0.0F, u + du, v + dv);
            return glm::dvec3(s.wi.x, s.wi.y, s.wi.z);
        };
        const double h = step;
        const glm::dvec3 du = (at(step, 0.0F) - at(-step, 0.0F)) / (2.0 * h);
        const glm::dvec3 dv = (at(0.0F, step) - at(0.0F, -step)) / (2.0 * h);
        const double jacobian = glm::length(glm::cross(du, dv));
        const BsdfSample<float> s = sample_bsdf(p, wo, 0.0F, u, v);
        if (!(s.pdf > 0.0F)) return;
        CHECK(s.pdf * jacobian == doctest::Approx(1.0).epsilon(0.02));
    };
    for (const float alpha : {0.05F, 0.3F, 1.0F}) {
        for (const float angle : {5.0F, 45.0F, 75.0F}) {
            for (const float u : {0.13F, 0.52F, 0.81F}) {
                for (const float v : {0.2F, 0.5F, 0.7F}) check(metal(alpha), direction(angle), u, v, 1e-3F);
            }
        }
    }
    for (const float u : {0.2F, 0.7F}) check(lambert(0.5F), direction(40.0F), u, 0.3F, 1e-3F);
}

TEST_CASE("BSDF is reciprocal") {
    for (const float alpha : {1e-3F, 0.1F, 0.7F}) {
        for (const auto& p : {metal(alpha, 0.6F), coated(alpha, 0.8F), half_metal(alpha)}) {
            for (uint32_t i = 0; i < 200; ++i) {
                const auto a = sample_2d(SamplerKind::independent, 8U, i, 0);
                const auto b = sample_2d(SamplerKind::independent, 8U, i, 1);
                const Triple<float> wo = square_to_cosine_hemisphere(a.first, a.second);
                const Triple<float> wi = square_to_cosine_hemisphere(b.first, b.second);
                if (wo.z < 0.02F || wi.z < 0.02F) continue;
                const float forward = evaluate_bsdf(p, wo, wi).value.x / wi.z;
                const float backward = evaluate_bsdf(p, wi, wo).value.x / wo.z;
                CHECK(forward == doctest::Approx(backward).epsilon(1e-4));
            }
        }
    }
}

TEST_CASE("albedo never exceeds one, and Lambert's is exact") {
    for (const float alpha : {1e-4F, 1e-3F, 0.05F, 0.3F, 1.0F}) {
        for (const float angle : {0.0F, 45.0F, 80.0F, 89.5F}) {
            for (const auto& p : {metal(alpha), coated(alpha, 1.0F), half_metal(alpha)}) {
                double variance = 0.0;
                const double value = albedo(p, direction(angle), variance);
                INFO("alpha ", alpha, " angle ", angle, " metallic ", p.metallic);
                CHECK(value <= 1.0 + 5.0 * std::sqrt(variance) + 1e-4);
                CHECK(value > 0.05);
            }
        }
    }
    double variance = 0.0;
    CHECK(albedo(lambert(0.37F), direction(60.0F), variance) == doctest::Approx(0.37).epsilon(1e-5));
}

TEST_CASE("a smooth white metal loses nothing: GGX without shadowing is normalised") {
    for (const float alpha : {1e-4F, 1e-3F, 1e-2F}) {
        double variance = 0.0;
        CHECK(albedo(metal(alpha), direction(40.0F), variance) == doctest::Approx(1.0).epsilon(2e-3));
    }
}

TEST_CASE("GGX density of normals integrates to one over projected area at any roughness") {
    for (const double alpha : {1e-4, 1e-3, 0.05, 0.5, 1.0}) {
        // Substituting t = tan(theta) = alpha s / (1 - s) resolves the peak for every alpha.
        constexpr int n = 20000;
        double integral = 0.0;
        for (int i = 0; i < n; ++i) {
            const double s = (i + 0.5) / n;
            const double t = alpha * s / (1.0 - s);
            const double dt = alpha / ((1.0 - s) * (1.0 - s)) / n;
            const double cosine = 1.0 / std::sqrt(1.0 + t * t);
            const Triple<float> h{static_cast<float>(t * cosine), 0.0F, static_cast<float>(cosine)};
            const double d = ggx_density(h, static_cast<float>(alpha));
            // D cos dw = D cos * sin dtheta dphi, dtheta = cos^2 dt.
            integral += d * cosine * (t * cosine) * cosine * cosine * dt * 2.0 * M_PI;
        }
        CHECK(integral == doctest::Approx(1.0).epsilon(2e-3));
    }
}

TEST_CASE("GGX density in float keeps its digits at alpha 1e-4") {
    for (const double theta : {0.0, 1e-5, 1e-4, 3e-4, 1e-2}) {
        const double alpha = 1e-4;
        const double c = std::cos(theta);
        const double s = std::sin(theta);
        const double t = c * c * alpha * alpha + s * s;
        const double exact = alpha * alpha / (M_PI * t * t);
        const float value = ggx_density(Triple<float>{static_cast<float>(s), 0.0F, static_cast<float>(c)}, 1e-4F);
        CHECK(value == doctest::Approx(exact).epsilon(1e-3));
    }
}

TEST_CASE("below delta_alpha the metal is a perfect mirror") {
    const Triple<float> wo = direction(50.0F);
    const BsdfSample<float> s = sample_bsdf(metal(5e-5F, 0.8F), wo, 0.3F, 0.2F, 0.7F);
    CHECK(s.delta);
    CHECK(s.wi.x == -wo.x);
    CHECK(s.wi.z == wo.z);
    const float schlick = 0.8F + 0.2F * std::pow(1.0F - wo.z, 5.0F);
    CHECK(s.weight.x == doctest::Approx(schlick));
    CHECK(evaluate_bsdf(metal(5e-5F), wo, s.wi).pdf == 0.0F);
}

TEST_CASE("nothing non-finite comes out at the extremes") {
    for (const float alpha : {0.0F, 1e-5F, 1e-4F, 1e-3F, 1.0F}) {
        for (const float angle : {0.0F, 89.9F, 89.9999F, 90.0F, 120.0F}) {
            for (const auto& p :
                 {metal(alpha), coated(alpha, 0.0F), coated(alpha, 1.0F), half_metal(alpha), lambert(0.0F)}) {
                const Triple<float> wo = direction(angle);
                for (const float u : {0.0F, 0.5F, 0.99999994F}) {
                    for (const float v : {0.0F, 0.5F, 0.99999994F}) {
                        const BsdfSample<float> s = sample_bsdf(p, wo, u, u, v);
                        CHECK(std::isfinite(s.weight.x + s.weight.y + s.weight.z));
                        CHECK(std::isfinite(s.wi.x + s.wi.y + s.wi.z));
                        const BsdfEvaluation<float> e = evaluate_bsdf(p, wo, direction(180.0F * v, u));
                        CHECK(std::isfinite(e.value.x + e.pdf));
                        CHECK(e.value.x >= 0.0F);
                        CHECK(e.pdf >= 0.0F);
                        const BsdfEvaluation<float> opposite = evaluate_bsdf(p, wo, -wo);
                        CHECK(opposite.value.x == 0.0F);
                    }
                }
            }
        }
    }
}

TEST_CASE("vector and scalar evaluation agree") {
    const Triple<float> wo = direction(35.0F);
    const auto widen = [](const Triple<float>& t) { return Triple<FloatV>{FloatV(t.x), FloatV(t.y), FloatV(t.z)}; };
    const BsdfParameters<float> p = half_metal(0.2F);
    const BsdfParameters<FloatV> wide{widen(p.base), widen(p.coat_f0), FloatV(p.coat_f90), FloatV(p.metallic),
                                      FloatV(p.alpha)};
    for (const float u : {0.1F, 0.4F, 0.9F}) {
        const BsdfSample<float> s = sample_bsdf(p, wo, u, 0.3F, u);
        const BsdfSample<FloatV> w = sample_bsdf(wide, widen(wo), FloatV(u), FloatV(0.3F), FloatV(u));
        CHECK(static_cast<float>(w.wi.x[0]) == doctest::Approx(s.wi.x).epsilon(1e-5));
        CHECK(static_cast<float>(w.weight.y[0]) == doctest::Approx(s.weight.y).epsilon(1e-4));
        CHECK(static_cast<float>(w.pdf[simd_width - 1]) == doctest::Approx(s.pdf).epsilon(1e-4));
    }
}

// Products of a slope lobe with the BSDF's specular part: exact densities, and little variance for what both let
// through.
#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "guiding/product_lobe.h"
#include "tests/statistics.h"

using namespace nephroid;

namespace {

/// A lobe about an axis, of one half width (radians) along each of two directions across, turned by an angle.
SlopeLobe<float> lobe_about(const Vec3& axis, float first, float second, float turn) {
    const Frame<float> frame = make_frame(to_triple(axis));
    const Triple<float> s = frame.s * std::cos(turn) + frame.t * std::sin(turn);
    return {frame.n, s * (1.0F / first), cross(frame.n, s) * (1.0F / second)};
}

BsdfParameters<float> metal(float alpha) {
    BsdfParameters<float> bsdf{};
    bsdf.base = {0.9F, 0.9F, 0.9F};
    bsdf.metallic = 1.0F;
    bsdf.alpha = alpha;
    return bsdf;
}

Triple<float> mirror_of(const GlossyView<float>& view) {
    return view.normal * (2.0F * dot(view.normal, view.wo)) - view.wo;
}

struct Case {
    float elevation;  ///< Of wo above the surface, radians.
    float alpha;
    float width;   ///< The lobe's.
    float offset;  ///< Of the lobe's axis from the mirror direction, in units of the wider of both.
};

constexpr Case cases[] = {
    {1.2F, 1e-4F, 1e-4F, 0.5F}, {1.2F, 0.02F, 0.02F, 1.0F},  {1.2F, 0.02F, 0.02F, 4.0F}, {0.6F, 0.02F, 0.1F, 1.0F},
    {0.6F, 0.1F, 0.005F, 1.0F}, {0.6F, 0.005F, 0.2F, 0.5F},  {0.15F, 0.1F, 0.05F, 1.0F}, {0.05F, 0.02F, 0.02F, 1.0F},
    {1.0F, 0.3F, 0.1F, 0.7F},   {1.0F, 1e-3F, 1e-3F, 20.0F},
};

struct Setting {
    BsdfParameters<float> bsdf;
    Frame<float> frame;
    GlossyView<float> view;
    SlopeLobe<float> lobe;
};

Setting set_up(const Case& c) {
    Setting setting;
    setting.bsdf = metal(c.alpha);
    setting.frame = make_frame(Triple<float>{0.0F, 0.0F, 1.0F});
    setting.view = make_glossy_view(setting.bsdf, {std::cos(c.elevation), 0.0F, std::sin(c.elevation)}, setting.frame);
    const float shift = std::min(c.offset * std::max(2.0F * c.alpha, c.width), 0.5F);
    const Vec3 mirror = to_vec3(mirror_of(setting.view));
    const Vec3 axis = glm::normalize(mirror + shift * glm::normalize(Vec3(0.0F, 0.7F, 0.0F) + Vec3(0.3F, 0.0F, 0.6F)));
    setting.lobe = lobe_about(axis, c.width, 3.0F * c.width, 0.7F);
    return setting;
}

}  // namespace

TEST_CASE("samples of a product's lobe match its density (chi-square)") {
    for (const Case& c : cases) {
        const Setting s = set_up(c);
        const LobeProduct<float> product = make_lobe_product(s.lobe, s.view);
        INFO("elevation ", c.elevation, " alpha ", c.alpha, " width ", c.width, " offset ", c.offset);
        REQUIRE(product.product_weight > 0.0F);
        const Vec3 centre = direction_at_slope(product.lobe, Vec2(0.0F));
        const auto result = testing::chi_square_directions(
            [&](Vec2 u, float choice) -> testing::DirectionDraw {
                return {sample_slope_lobe(product.lobe, choice, u.x, u.y), true};
            },
            [&](const Vec3& d) { return double{lobe_density(product.lobe, to_triple(d))}; }, centre,
            0.03 * double{std::min(c.width, c.alpha)}, 200000);
        INFO(result.worst_bin, ", integral ", result.integral);
        CHECK(result.p_value > 1e-4);
    }
}

TEST_CASE("lobe, product and BSDF together sample what both let through") {
    std::mt19937 generator(1);
    std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
    for (const Case& c : cases) {
        const Setting s = set_up(c);
        const LobeProduct<float> product = make_lobe_product(s.lobe, s.view);
        const float bsdf_weight = std::max(product.bsdf_weight, (product.own_weight + product.product_weight) / 9.0F);
        const float total = product.own_weight + product.product_weight + bsdf_weight;
        double sum = 0.0, squares = 0.0, alone = 0.0;
        constexpr int count = 100000;
        for (int i = 0; i < count; ++i) {
            const float choice = uniform(generator) * total, u = uniform(generator), v = uniform(generator);
            Triple<float> w;
            if (choice < product.own_weight) {
                w = to_triple(sample_slope_lobe(s.lobe, uniform(generator), u, v));
            } else if (choice < product.own_weight + product.product_weight) {
                w = to_triple(sample_slope_lobe(product.lobe, uniform(generator), u, v));
            } else {
                w = s.frame.to_world(sample_bsdf(s.bsdf, s.frame.to_local(s.view.wo), uniform(generator), u, v).wi);
            }
            const float bsdf_pdf = evaluate_bsdf(s.bsdf, s.frame.to_local(s.view.wo), s.frame.to_local(w)).pdf;
            const float own_pdf = lobe_density(s.lobe, w);
            const float pdf = (product.own_weight * own_pdf + product.product_weight * lobe_density(product.lobe, w) +
                               bsdf_weight * bsdf_pdf) /
                              total;
            REQUIRE(std::isfinite(pdf));
            const double target = double{own_pdf} * double{specular_value(s.view, w)};
            if (!(pdf > 0.0F)) continue;
            const double value = target / double{pdf};
            sum += value;
            squares += value * value;
            if (bsdf_pdf > 0.0F) alone += target * target / (double{pdf} * double{bsdf_pdf});
        }
        const double mean = sum / count;
        const double deviation = std::sqrt(squares / count - mean * mean) / mean;
        const double bsdf_deviation = std::sqrt(std::max(alone / count - mean * mean, 0.0)) / mean;
        MESSAGE("elevation ", c.elevation, " alpha ", c.alpha, " width ", c.width, " offset ", c.offset, ": weights ",
                product.product_weight / total, " ", product.own_weight / total, " ", bsdf_weight / total,
                ", deviation ", deviation, ", by the BSDF alone ", bsdf_deviation);
        CHECK(deviation < 1.5);
    }
}

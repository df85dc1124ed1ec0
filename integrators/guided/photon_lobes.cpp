#include "integrators/guided/photon_lobes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/frame.h"

namespace nephroid {

namespace {

constexpr size_t most_lobes = 6;
constexpr size_t fewest_photons = 4;
constexpr int assignment_rounds = 4;
constexpr int fit_rounds = 6;

/// Fewer photons do not tell a derivative.
constexpr size_t fewest_for_slope = 6;

/// Least width of a lobe at its plane, in units of the spacing. Moments of other photons than those fitted, of the
/// Snail, with .1, .05, .02, .01: 9400, 9660, 10200, 10700; with eight times the photons .05 and .02 are alike.
constexpr float least_width = 0.05F;

/// Towards a derivative of zero: as many photons' weight, a spacing away.
constexpr float slope_prior = 0.1F;

/// Directions further apart than this (cosine) are not worth a common lobe even where it is the nearest.
constexpr float farthest_seed_cosine = 0.9998F;

/// Lines that meet a lobe's plane at a smaller cosine do not count.
constexpr float least_cosine = 0.1F;

struct Member {
    const LandedPhoton* photon = nullptr;
    Vec2 shift{0.0F};  ///< From the cached point to where it lands, along the surface, in units of the spacing.
    size_t lobe = 0;
};

/// Axes that lie far apart: each is the direction farthest from those before.
std::vector<Vec3> choose_axes(const std::vector<Member>& members) {
    const auto strongest = std::max_element(members.begin(), members.end(), [](const Member& a, const Member& b) {
        return a.photon->power < b.photon->power;
    });
    std::vector<Vec3> axes{strongest->photon->wi};
    while (axes.size() < most_lobes) {
        float least = 1.0F;
        Vec3 farthest(0.0F);
        for (const Member& m : members) {
            float nearest = -1.0F;
            for (const Vec3& axis : axes) nearest = std::max(nearest, glm::dot(axis, m.photon->wi));
            if (nearest < least) {
                least = nearest;
                farthest = m.photon->wi;
            }
        }
        if (least > farthest_seed_cosine) break;
        axes.push_back(farthest);
    }
    return axes;
}

/// Every photon to the nearest axis; axes to the mean of theirs.
void assign(std::vector<Member>& members, std::vector<Vec3>& axes) {
    for (int round = 0; round < assignment_rounds; ++round) {
        std::vector<Vec3> sums(axes.size(), Vec3(0.0F));
        for (Member& m : members) {
            float best = -2.0F;
            for (size_t k = 0; k < axes.size(); ++k) {
                const float cosine = glm::dot(axes[k], m.photon->wi);
                if (cosine > best) {
                    best = cosine;
                    m.lobe = k;
                }
            }
            sums[m.lobe] += m.photon->power * m.photon->wi;
        }
        for (size_t k = 0; k < axes.size(); ++k) {
            if (glm::dot(sums[k], sums[k]) > 0.0F) axes[k] = glm::normalize(sums[k]);
        }
    }
}

/// A symmetric matrix of two rows.
struct Symmetric {
    float xx = 0.0F, xy = 0.0F, yy = 0.0F;
    float determinant() const { return xx * yy - xy * xy; }
    float inverse_form(const Vec2& q) const {
        return (yy * q.x * q.x - 2.0F * xy * q.x * q.y + xx * q.y * q.y) / determinant();
    }
};

/// Where light of a lobe comes from, on a plane, by where it lands. Lengths in units of the spacing.
struct Regression {
    float spacing = 1.0F;                               ///< Metres.
    Vec3 centre{0.0F};                                  ///< Of the plane, world space.
    Frame<float> frame;                                 ///< n: away from the receiver.
    Vec2 offset{0.0F};                                  ///< Plane coordinates at the cached point.
    std::array<Vec2, 2> slope{Vec2(0.0F), Vec2(0.0F)};  ///< By the coordinates of Member::shift.
    Symmetric scatter;                                  ///< Of what is left.
    float power = 0.0F;                                 ///< Of the members; zero: there is no such lobe.

    /// Where the photon's line meets the plane.
    std::optional<Vec2> seen(const LandedPhoton& photon) const {
        const Vec3 n = to_vec3(frame.n);
        const float cosine = glm::dot(photon.wi, n);
        if (!(cosine > least_cosine)) return std::nullopt;
        const float t = glm::dot(centre - photon.x, n) / cosine;
        if (!(t > 0.0F)) return std::nullopt;
        const Vec3 from_centre = (photon.x + photon.wi * t - centre) / spacing;
        return Vec2(glm::dot(from_centre, to_vec3(frame.s)), glm::dot(from_centre, to_vec3(frame.t)));
    }
    Vec2 expected(const Vec2& shift) const { return offset + slope[0] * shift.x + slope[1] * shift.y; }
    /// Relative likelihood.
    float likelihood(const Member& m) const {
        const std::optional<Vec2> at = seen(*m.photon);
        if (!at) return 0.0F;
        const float d = 1.0F + 0.5F * scatter.inverse_form(*at - expected(m.shift));
        return power / (std::sqrt(scatter.determinant()) * d * d);
    }
};

/// The plane of a lobe's members: across their mean direction, at their mean distance.
bool place(const Vec3& x, const std::vector<Member>& members, size_t lobe, Regression& fit) {
    Vec3 mean(0.0F);
    fit.power = 0.0F;
    for (const Member& m : members) {
        if (m.lobe != lobe) continue;
        mean += m.photon->power * (m.photon->x + m.photon->wi * m.photon->distance - x);
        fit.power += m.photon->power;
    }
    if (!(fit.power > 0.0F)) return false;
    mean /= fit.power;
    const float distance = glm::length(mean);
    if (!(distance > 0.0F)) return false;
    fit.centre = x + mean;
    fit.frame = make_frame(to_triple(mean / distance));
    return true;
}

/// Iteratively reweighted least squares.
void regress(const std::vector<Member>& members, size_t lobe, Regression& fit) {
    constexpr float floor = least_width * least_width;
    fit.offset = fit.slope[0] = fit.slope[1] = Vec2(0.0F);
    std::vector<std::pair<Vec2, const Member*>> points;
    float power = 0.0F;
    for (const Member& m : members) {
        if (m.lobe != lobe) continue;
        if (const std::optional<Vec2> at = fit.seen(*m.photon)) {
            points.emplace_back(*at, &m);
            power += m.photon->power;
        }
    }
    fit.scatter = {floor, 0.0F, floor};
    if (points.empty()) return;
    const auto count = static_cast<float>(points.size());
    const bool linear = points.size() >= fewest_for_slope;
    for (int round = 0; round < fit_rounds; ++round) {
        Mat3 normal(0.0F);
        normal[1][1] = normal[2][2] = slope_prior;
        Vec3 right_x(0.0F), right_y(0.0F);
        const auto weight_of = [&](const Vec2& residual, float p) {
            return (round == 0 ? 1.0F : 4.0F / (2.0F + fit.scatter.inverse_form(residual))) * p * count / power;
        };
        for (const auto& [at, m] : points) {
            const float u = weight_of(at - fit.expected(m->shift), m->photon->power);
            const Vec3 z(1.0F, linear ? m->shift : Vec2(0.0F));
            normal += glm::outerProduct(z, z * u);
            right_x += z * (u * at.x);
            right_y += z * (u * at.y);
        }
        const Mat3 inverse = glm::inverse(normal);
        const Vec3 by_x = inverse * right_x, by_y = inverse * right_y;
        fit.offset = {by_x.x, by_y.x};
        fit.slope = {Vec2(by_x.y, by_y.y), Vec2(by_x.z, by_y.z)};
        Symmetric sum{floor, 0.0F, floor};
        for (const auto& [at, m] : points) {
            const Vec2 q = at - fit.expected(m->shift);
            const float u = weight_of(q, m->photon->power);
            sum.xx += u * q.x * q.x;
            sum.xy += u * q.x * q.y;
            sum.yy += u * q.y * q.y;
        }
        // The least width counts as one more photon; what was fitted, as fewer.
        const float freedom = std::max(count + 1.0F - (linear ? 3.0F : 1.0F), 1.0F);
        fit.scatter = {std::max(sum.xx / freedom, floor), sum.xy / freedom, std::max(sum.yy / freedom, floor)};
        const float limit = 0.999F * std::sqrt(fit.scatter.xx * fit.scatter.yy);
        fit.scatter.xy = std::clamp(fit.scatter.xy, -limit, limit);
    }
}

void reassign(std::vector<Member>& members, const std::vector<Regression>& fits) {
    for (Member& m : members) {
        float best = -1.0F;
        for (size_t k = 0; k < fits.size(); ++k) {
            const float likelihood = fits[k].power > 0.0F ? fits[k].likelihood(m) : 0.0F;
            if (likelihood > best) {
                best = likelihood;
                m.lobe = k;
            }
        }
    }
}

/// As a lobe of the cached point.
CachedSlopeLobe<float> lobe_of(const Vec3& x, const Frame<float>& tangents, const Regression& fit) {
    CachedSlopeLobe<float> lobe{};
    const Vec2 offset = fit.offset * fit.spacing;
    lobe.y = to_triple(fit.centre) + fit.frame.s * offset.x + fit.frame.t * offset.y;
    lobe.e1 = fit.frame.s;
    lobe.e2 = fit.frame.t;
    lobe.normal = -fit.frame.n;
    lobe.tangent = fit.frame.s;
    lobe.light = to_triple(x);
    lobe.move1 = tangents.s * fit.slope[0].x + tangents.t * fit.slope[1].x;
    lobe.move2 = tangents.s * fit.slope[0].y + tangents.t * fit.slope[1].y;
    // K^T K = S^-1 / 2 with an upper triangular K; J is K per metre.
    const float determinant = fit.scatter.determinant();
    const float a = fit.scatter.yy / (2.0F * determinant), b = -fit.scatter.xy / (2.0F * determinant);
    const float c = fit.scatter.xx / (2.0F * determinant);
    const float k11 = std::sqrt(a), k12 = b / k11, k22 = std::sqrt(std::max(c - k12 * k12, 1e-6F * c));
    lobe.j11 = k11 / fit.spacing;
    lobe.j12 = k12 / fit.spacing;
    lobe.j22 = k22 / fit.spacing;
    lobe.squared_floor = 1.0F;
    return lobe;
}

}  // namespace

std::vector<CachedSlopeLobe<float>> fit_photon_lobes(const Vec3& x, const Vec3& normal,
                                                     std::span<const LandedPhoton> photons, float irradiance,
                                                     float spacing) {
    const Frame<float> tangents = make_frame(to_triple(normal));
    std::vector<Member> members;
    float total = 0.0F;
    for (const LandedPhoton& photon : photons) {
        if (!(photon.distance > 0.0F) || !std::isfinite(photon.distance)) continue;
        const Vec3 shift = photon.x - x;
        members.push_back(
            {&photon, Vec2(glm::dot(shift, to_vec3(tangents.s)), glm::dot(shift, to_vec3(tangents.t))) / spacing, 0});
        total += photon.power;
    }
    std::vector<CachedSlopeLobe<float>> lobes;
    if (members.size() < fewest_photons || !(total > 0.0F)) return lobes;
    std::vector<Vec3> axes = choose_axes(members);
    assign(members, axes);
    std::vector<Regression> fits(axes.size());
    for (Regression& fit : fits) fit.spacing = spacing;
    for (const bool first : {true, false}) {
        if (!first) reassign(members, fits);
        for (size_t k = 0; k < fits.size(); ++k) {
            if (place(x, members, k, fits[k])) regress(members, k, fits[k]);
        }
    }
    for (const Regression& fit : fits) {
        if (!(fit.power > 0.0F)) continue;
        lobes.push_back(lobe_of(x, tangents, fit));
        lobes.back().weight = irradiance * fit.power / total;
    }
    return lobes;
}

}  // namespace nephroid

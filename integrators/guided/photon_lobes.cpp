#include "integrators/guided/photon_lobes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/frame.h"

namespace nephroid {

namespace {

constexpr size_t most_lobes = 6;
constexpr size_t fewest_origins = 4;
constexpr int assignment_rounds = 4;
constexpr int fit_rounds = 6;

/// Directions further apart than this (cosine) are not worth a common lobe even where it is the nearest.
constexpr float farthest_seed_cosine = 0.9998F;

struct Direction {
    Vec3 w{0.0F};  ///< Unit.
    float distance = 0.0F;
    float power = 0.0F;
    size_t lobe = 0;
};

/// Axes that lie far apart: each is the direction farthest from those before.
std::vector<Vec3> choose_axes(const std::vector<Direction>& directions) {
    const auto strongest = std::max_element(directions.begin(), directions.end(),
                                            [](const Direction& a, const Direction& b) { return a.power < b.power; });
    std::vector<Vec3> axes{strongest->w};
    while (axes.size() < most_lobes) {
        float least = 1.0F;
        Vec3 farthest(0.0F);
        for (const Direction& d : directions) {
            float nearest = -1.0F;
            for (const Vec3& axis : axes) nearest = std::max(nearest, glm::dot(axis, d.w));
            if (nearest < least) {
                least = nearest;
                farthest = d.w;
            }
        }
        if (least > farthest_seed_cosine) break;
        axes.push_back(farthest);
    }
    return axes;
}

/// Every direction to its nearest axis; axes to the mean of theirs.
void assign(std::vector<Direction>& directions, std::vector<Vec3>& axes) {
    for (int round = 0; round < assignment_rounds; ++round) {
        std::vector<Vec3> sums(axes.size(), Vec3(0.0F));
        for (Direction& d : directions) {
            float best = -2.0F;
            for (size_t k = 0; k < axes.size(); ++k) {
                const float cosine = glm::dot(axes[k], d.w);
                if (cosine > best) {
                    best = cosine;
                    d.lobe = k;
                }
            }
            sums[d.lobe] += d.power * d.w;
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

/// The scatter S of one lobe's directions about its axis.
Symmetric fit_scatter(const std::vector<Direction>& directions, size_t lobe, const Frame<float>& frame,
                      float least_width) {
    const float floor = least_width * least_width;
    Symmetric scatter{floor, 0.0F, floor};
    for (int round = 0; round < fit_rounds; ++round) {
        // The least width counts as one more direction.
        Symmetric sum{floor, 0.0F, floor};
        float count = 1.0F;
        for (const Direction& d : directions) {
            if (d.lobe != lobe) continue;
            const Triple<float> local = frame.to_local(to_triple(d.w));
            if (!(local.z > 0.1F)) continue;
            const Vec2 q(local.x / local.z, local.y / local.z);
            const float u = round == 0 ? 1.0F : 4.0F / (2.0F + scatter.inverse_form(q));
            sum.xx += u * q.x * q.x;
            sum.xy += u * q.x * q.y;
            sum.yy += u * q.y * q.y;
            count += 1.0F;
        }
        scatter = {std::max(sum.xx / count, floor), sum.xy / count, std::max(sum.yy / count, floor)};
        const float limit = 0.999F * std::sqrt(scatter.xx * scatter.yy);
        scatter.xy = std::clamp(scatter.xy, -limit, limit);
    }
    return scatter;
}

/// A lobe about a point that stays where it is when the receiver moves.
CachedSlopeLobe<float> lobe_about(const Vec3& x, const Frame<float>& frame, float distance, const Symmetric& scatter) {
    CachedSlopeLobe<float> lobe{};
    lobe.y = to_triple(x) + frame.n * distance;
    lobe.e1 = frame.s;
    lobe.e2 = frame.t;
    lobe.normal = -frame.n;
    lobe.tangent = frame.s;
    lobe.light = to_triple(x);
    // K^T K = S^-1 / 2 with an upper triangular K; J is K per metre on the plane through y.
    const float determinant = scatter.determinant();
    const float a = scatter.yy / (2.0F * determinant), b = -scatter.xy / (2.0F * determinant);
    const float c = scatter.xx / (2.0F * determinant);
    const float k11 = std::sqrt(a), k12 = b / k11, k22 = std::sqrt(std::max(c - k12 * k12, 1e-6F * c));
    lobe.j11 = k11 / distance;
    lobe.j12 = k12 / distance;
    lobe.j22 = k22 / distance;
    lobe.squared_floor = 1.0F;
    return lobe;
}

}  // namespace

std::vector<CachedSlopeLobe<float>> fit_photon_lobes(const Vec3& x, std::span<const PhotonOrigin> origins,
                                                     float irradiance, float spacing) {
    std::vector<Direction> directions;
    float total = 0.0F;
    for (const PhotonOrigin& origin : origins) {
        const Vec3 to_y = origin.y - x;
        const float distance = glm::length(to_y);
        if (!(distance > 0.0F) || !std::isfinite(distance)) continue;
        directions.push_back({to_y / distance, distance, origin.power});
        total += origin.power;
    }
    std::vector<CachedSlopeLobe<float>> lobes;
    if (directions.size() < fewest_origins || !(total > 0.0F)) return lobes;
    std::vector<Vec3> axes = choose_axes(directions);
    assign(directions, axes);
    for (size_t k = 0; k < axes.size(); ++k) {
        float power = 0.0F, distance = 0.0F;
        for (const Direction& d : directions) {
            if (d.lobe != k) continue;
            power += d.power;
            distance += d.power * d.distance;
        }
        if (!(power > 0.0F)) continue;
        distance /= power;
        const Frame<float> frame = make_frame(to_triple(axes[k]));
        const Symmetric scatter = fit_scatter(directions, k, frame, 0.25F * spacing / distance);
        lobes.push_back(lobe_about(x, frame, distance, scatter));
        lobes.back().weight = irradiance * power / total;
    }
    return lobes;
}

}  // namespace nephroid

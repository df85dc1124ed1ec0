#include "integrators/guided/photon_starts.h"

#include <algorithm>

namespace nephroid {

namespace {

/// Groups of less than this share of the area have no starts of their own: densities stay finite.
constexpr double least_group_area = 1e-12;

}  // namespace

PhotonStarts::PhotonStarts(const ReflectorTree& reflectors) {
    double area = 0.0;
    for (uint32_t i = 0; i < reflectors.size(); ++i) {
        const Vec3 e1 = reflectors.position(i, 1) - reflectors.position(i, 0);
        const Vec3 e2 = reflectors.position(i, 2) - reflectors.position(i, 0);
        area += 0.5 * double{glm::length(glm::cross(e1, e2))};
        area_up_to_.push_back(area);
    }
    for (const double up_to : area_up_to_) probability_up_to_.push_back(up_to / area);
    group_pdf_.assign((area_up_to_.size() + triangles_per_group - 1) / triangles_per_group,
                      static_cast<float>(1.0 / area));
}

PhotonStarts PhotonStarts::around(std::span<const uint32_t> useful) const {
    const size_t groups = group_pdf_.size();
    std::vector<double> weight(groups);
    for (const uint32_t triangle : useful) {
        const size_t group = triangle / triangles_per_group;
        weight[group] += 2.0;
        if (group > 0) weight[group - 1] += 1.0;
        if (group + 1 < groups) weight[group + 1] += 1.0;
    }
    PhotonStarts starts = *this;
    const auto area_before = [&](size_t triangle) { return triangle == 0 ? 0.0 : area_up_to_[triangle - 1]; };
    double sum = 0.0;
    for (size_t g = 0; g < groups; ++g) {
        const size_t first = g * triangles_per_group, end = std::min(first + triangles_per_group, area_up_to_.size());
        const double area = area_up_to_[end - 1] - area_before(first);
        const double density = area > least_group_area * total_area() ? weight[g] / area : 0.0;
        starts.group_pdf_[g] = static_cast<float>(density);
        for (size_t i = first; i < end; ++i) {
            sum += density * (area_up_to_[i] - area_before(i));
            starts.probability_up_to_[i] = sum;
        }
    }
    if (!(sum > 0.0)) return *this;
    for (double& up_to : starts.probability_up_to_) up_to /= sum;
    for (float& pdf : starts.group_pdf_) pdf = static_cast<float>(double{pdf} / sum);
    return starts;
}

uint32_t PhotonStarts::triangle(float u) const {
    const auto found = std::upper_bound(probability_up_to_.begin(), probability_up_to_.end(), double{u});
    // Rounding may have left the end below one.
    return static_cast<uint32_t>(std::min<std::ptrdiff_t>(found - probability_up_to_.begin(),
                                                          static_cast<std::ptrdiff_t>(probability_up_to_.size()) - 1));
}

double PhotonStarts::gain(std::span<const uint32_t> useful) const {
    double sum = 0.0;
    for (const uint32_t triangle : useful) sum += double{pdf(triangle)} * total_area();
    return useful.empty() ? 0.0 : sum / static_cast<double>(useful.size());
}

}  // namespace nephroid

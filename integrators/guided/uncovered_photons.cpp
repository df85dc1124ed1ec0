#include "integrators/guided/uncovered_photons.h"

#include <array>
#include <cmath>
#include <numeric>

namespace nephroid {

namespace {

constexpr size_t gathered_points = 16;
constexpr size_t enough_photons = 200;

}  // namespace

UncoveredPhotons::UncoveredPhotons(const SlopeCache& cache, const std::vector<CausticPhoton>& photons,
                                   const std::vector<PhotonCoverage>& coverage, bool with_single)
    : cache_(cache), first_(cache.points.size() + 1) {
    const auto is_wanted = [&](size_t i) {
        return (photons[i].reflections > 1 || with_single) && coverage[i].bsdf_pdf > coverage[i].guide_pdf;
    };
    for (size_t i = 0; i < photons.size(); ++i) first_[coverage[i].nearest + 1] += is_wanted(i) ? 1 : 0;
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    photons_.resize(first_.back());
    std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
    for (size_t i = 0; i < photons.size(); ++i) {
        const CausticPhoton& photon = photons[i];
        if (!is_wanted(i)) continue;
        photons_[next[coverage[i].nearest]++] = {photon.at.position, photon.wi, photon.distance, photon.power};
    }
}

std::vector<CachedSlopeLobe<float>> UncoveredPhotons::lobes_at(const CachedPoint& point) const {
    std::array<FoundPoint, gathered_points> found;
    const size_t count = cache_.lookup.find(point.position, point.normal, found);
    std::vector<LandedPhoton> photons;
    float area = 0.0F, power = 0.0F;
    for (size_t k = 0; k < count && photons.size() < enough_photons; ++k) {
        const uint32_t i = found[k].index;
        photons.insert(photons.end(), photons_.begin() + first_[i], photons_.begin() + first_[i + 1]);
        area += cached_area(cache_.points[i]);
    }
    for (const LandedPhoton& photon : photons) power += photon.power;
    return fit_photon_lobes(point.position, point.normal, photons, power / area, std::sqrt(area));
}

}  // namespace nephroid

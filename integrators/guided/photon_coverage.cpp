#include "integrators/guided/photon_coverage.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <memory>

namespace nephroid {

namespace {

/// A sample so many times brighter than its surroundings is a bright dot.
constexpr float bright = 4.0F;

/// Fraction of the guide that samples are told for: lower ones only spread the same light over more dots.
constexpr float told_fraction = 0.5F;

/// New points near one cached point.
constexpr uint32_t most_per_point = 2;

/// Photons [begin, end) in groups that fill the mixtures' vectors.
void measure(const SlopeCache& cache, SlopeMixtures& mixtures, std::span<const CausticPhoton> photons, size_t begin,
             size_t end, std::vector<PhotonCoverage>& coverage) {
    std::array<size_t, SlopeMixtures::most_mixtures> group;
    std::array<FoundPoint, SlopeMixtures::most_points> found;
    size_t next = begin;
    while (next < end) {
        mixtures.clear();
        size_t size = 0;
        for (; next < end && !mixtures.is_full(); ++next) {
            const CausticPhoton& photon = photons[next];
            const size_t count = cache.lookup.find(photon.at.position, photon.at.geometric_normal, found);
            if (count == 0) continue;
            const float cosine = glm::dot(photon.at.shading_normal, photon.wi);
            if (!(cosine > 0.0F)) continue;
            coverage[next] = {found[0].index, 0.0F, cosine * inv_pi};
            mixtures.add(std::span(found).first(count),
                         diffuse_guide_vertex(photon.at.position, photon.at.geometric_normal));
            group[size++] = next;
        }
        mixtures.prepare();
        for (size_t i = 0; i < size; ++i) {
            if (mixtures.fraction(i) > 0.0F) coverage[group[i]].guide_pdf = mixtures.pdf(i, photons[group[i]].wi);
        }
    }
}

}  // namespace

std::vector<PhotonCoverage> measure_coverage(const SlopeCache& cache, const SlopeMixtureOptions& options,
                                             std::span<const CausticPhoton> photons) {
    std::vector<PhotonCoverage> coverage(photons.size());
    tbb::enumerable_thread_specific<std::unique_ptr<SlopeMixtures>> threads;
    constexpr size_t grain = 1024;
    tbb::parallel_for(tbb::blocked_range<size_t>(0, photons.size(), grain), [&](const auto& range) {
        auto& mixtures = threads.local();
        if (!mixtures) mixtures = std::make_unique<SlopeMixtures>(cache, options);
        measure(cache, *mixtures, photons, range.begin(), range.end(), coverage);
    });
    return coverage;
}

float cached_area(const CachedPoint& point) {
    const float footprint = point.reach / reach_in_footprints;
    return footprint * footprint;
}

std::vector<float> irradiance_at_points(const SlopeCache& cache, std::span<const CausticPhoton> photons,
                                        std::span<const PhotonCoverage> coverage) {
    std::vector<float> irradiance(cache.points.size());
    for (size_t i = 0; i < photons.size(); ++i) {
        if (coverage[i].bsdf_pdf > 0.0F) irradiance[coverage[i].nearest] += photons[i].power;
    }
    for (size_t i = 0; i < irradiance.size(); ++i) irradiance[i] /= cached_area(cache.points[i]);
    return irradiance;
}

double second_moment_of_long_paths(const SlopeCache& cache, std::span<const CausticPhoton> photons,
                                   std::span<const PhotonCoverage> coverage) {
    const std::vector<float> irradiance = irradiance_at_points(cache, photons, coverage);
    double moment = 0.0, squared_mean = 0.0;
    for (size_t i = 0; i < photons.size(); ++i) {
        if (!(coverage[i].bsdf_pdf > 0.0F)) continue;
        const double power{photons[i].power};
        squared_mean += power * double{irradiance[coverage[i].nearest]};
        if (photons[i].reflections > 1) moment += power * double{coverage[i].sample_value(photons[i], told_fraction)};
    }
    return squared_mean > 0.0 ? moment / squared_mean : 0.0;
}

PoorlyCovered poorly_covered(const SlopeCache& cache, const std::vector<CausticPhoton>& photons,
                             const std::vector<PhotonCoverage>& coverage, size_t most) {
    const std::vector<float> irradiances = irradiance_at_points(cache, photons, coverage);
    struct Candidate {
        float variance;
        uint32_t photon;
    };
    std::vector<Candidate> candidates;
    double smooth = 0.0, dots = 0.0;
    for (uint32_t i = 0; i < photons.size(); ++i) {
        if (photons[i].reflections != 1 || !(coverage[i].bsdf_pdf > 0.0F)) continue;
        const uint32_t nearest = coverage[i].nearest;
        const float irradiance = irradiances[nearest];
        const float excess = coverage[i].sample_value(photons[i], told_fraction) - bright * irradiance;
        smooth += double{photons[i].power} * double{irradiance};
        if (!(excess > 0.0F)) continue;
        dots += double{photons[i].power} * double{excess};
        candidates.push_back({photons[i].power * excess, i});
    }
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
        return a.variance != b.variance ? a.variance > b.variance : a.photon < b.photon;
    });
    std::vector<uint8_t> taken(cache.points.size());
    PoorlyCovered found;
    found.excess = smooth > 0.0 ? dots / smooth : 0.0;
    std::vector<Receiver>& chosen = found.points;
    for (const Candidate& candidate : candidates) {
        if (chosen.size() >= most) break;
        const uint32_t nearest = coverage[candidate.photon].nearest;
        if (taken[nearest] == most_per_point) continue;
        ++taken[nearest];
        chosen.push_back(photons[candidate.photon].at);
        // Half as far from each other as the points before.
        chosen.back().footprint = 0.5F * cache.points[nearest].reach / reach_in_footprints;
    }
    return found;
}

}  // namespace nephroid

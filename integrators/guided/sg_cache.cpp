#include "integrators/guided/sg_cache.h"

#include <tbb/parallel_for.h>

#include <cmath>

namespace nephroid {

namespace {

constexpr float paper_fraction = 0.5F;

/// What an occluded representative path is still worth: part of its glossy region may be lit.
constexpr float occluded_weight = 0.1F;

/// With weights that sum to one; none where no path brings light.
std::vector<SgLobe> lobes_of(const RenderContext& context, const GuidedPaths& found, size_t index) {
    const Vec3d x(found.receivers[index].position);
    std::vector<SgLobe> lobes;
    float total = 0.0F;
    for (const RepresentativePath& path : found.paths.of_receiver(index)) {
        const PerVertex<GlossyVertex> vertices = glossy_vertices(context, found, path, x);
        const auto used = std::span(vertices).first(path.length);
        SgLobe lobe = make_sg_lobe(x, used, emitter_at(context, found.lights[path.light], used.back().position));
        if (path.occluded) lobe.weight *= occluded_weight;
        if (!(lobe.weight > 0.0F) || !std::isfinite(lobe.weight)) continue;
        lobes.push_back(lobe);
        total += lobe.weight;
    }
    if (!std::isfinite(total)) return {};
    for (SgLobe& lobe : lobes) lobe.weight /= total;
    return lobes;
}

}  // namespace

SgCache make_sg_cache(const RenderContext& context, const GuidedPaths& found, const GuidedSettings& settings) {
    std::vector<std::vector<SgLobe>> lobes(found.receivers.size());
    tbb::parallel_for(size_t{0}, lobes.size(), [&](size_t i) { lobes[i] = lobes_of(context, found, i); });
    SgCache cache;
    const float fraction = settings.guide_fraction.value_or(paper_fraction);
    for (size_t i = 0; i < lobes.size(); ++i) {
        cache.points.push_back(make_cached_point(found.receivers[i], cache.lobes.size(), lobes[i].size()));
        if (!lobes[i].empty()) cache.points.back().fraction = fraction;
        cache.lobes.insert(cache.lobes.end(), lobes[i].begin(), lobes[i].end());
    }
    cache.lookup = CachedPointLookup(cache.points);
    cache.leads_on = has_long_paths(found);
    return cache;
}

}  // namespace nephroid

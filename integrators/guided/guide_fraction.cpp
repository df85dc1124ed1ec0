#include "integrators/guided/guide_fraction.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "core/rounding.h"
#include "core/warp.h"
#include "integrators/path/path_worker.h"

namespace nephroid {

namespace {

constexpr uint32_t path_count = 32;
constexpr uint32_t path_depth = 3;  // Scatterings: later ones add little to what is only a weight.
constexpr size_t shared_points = 16;
constexpr float least_fraction = 0.1F;
constexpr float most_fraction = 0.9F;
constexpr uint32_t estimator_seed = 0x6c8e9cf5U;

/// A lobe's estimate varies by its own standard deviation beside its mean: about 0.7 of it.
constexpr double lobe_second_moment = 1.5;

/// Samples what arrives at points without having been a caustic.
class OtherLight {
  public:
    explicit OtherLight(const RenderContext& context)
        : worker_(context, nullptr), rays_(path_count), seed_(context.seed ^ estimator_seed) {}

    /// Second moment of one BSDF sample's estimate of the irradiance at a diffuse receiver, (W/m^2)^2 of luminance.
    double second_moment(const Receiver& receiver, uint32_t index) {
        rays_.count = 0;
        const Frame<float> frame = make_frame(to_triple(receiver.geometric_normal));
        std::array<uint32_t, path_count> seeds;
        for (uint32_t i = 0; i < path_count; ++i) {
            seeds[i] = pixel_seed(index, i, seed_);
            const auto [u, v] = sample_2d(SamplerKind::sobol, pixel_seed(index, path_count, seed_), i, 0);
            const Vec3 direction = to_vec3(frame.to_world(square_to_cosine_hemisphere(u, v)));
            rays_.push(offset_ray_origin(receiver.position, receiver.error, receiver.geometric_normal, direction),
                       direction);
        }
        worker_.incident_radiance(rays_, seeds, 0, samples_);
        double squares = 0.0;
        for (size_t i = 0; i < path_count; ++i) {
            Rgb other;
            for (int c = 0; c < 3; ++c) other[c] = samples_.radiance[c][i] - samples_.caustic[c][i];
            const double value = double{luminance(other)};
            if (std::isfinite(value)) squares += value * value;
        }
        return double{pi} * double{pi} * squares / path_count;
    }

  private:
    PathWorker worker_;
    RayBatch rays_;
    SampleBuffer samples_;
    uint32_t seed_;
};

std::vector<double> second_moments(const RenderContext& context, std::span<const Receiver> receivers) {
    RenderContext caustics_apart = context;
    caustics_apart.max_depth = std::min(context.max_depth, path_depth);
    caustics_apart.aovs.caustic = true;
    tbb::enumerable_thread_specific<std::unique_ptr<OtherLight>> threads;
    std::vector<double> moments(receivers.size());
    tbb::parallel_for(size_t{0}, receivers.size(), [&](size_t i) {
        auto& light = threads.local();
        if (!light) light = std::make_unique<OtherLight>(caustics_apart);
        moments[i] = light->second_moment(receivers[i], static_cast<uint32_t>(i));
    });
    return moments;
}

}  // namespace

std::vector<float> guide_fractions(const RenderContext& context, std::span<const Receiver> receivers,
                                   std::span<const float> caustic, const CachedPointLookup& lookup) {
    const std::vector<double> moments = second_moments(context, receivers);
    std::vector<float> fractions(receivers.size(), 0.0F);
    for (size_t i = 0; i < receivers.size(); ++i) {
        if (!(caustic[i] > 0.0F)) continue;
        std::array<FoundPoint, shared_points> found;
        const size_t count = lookup.find(receivers[i].position, receivers[i].geometric_normal, found);
        double other = moments[i];
        for (const FoundPoint& near : std::span(found).first(count)) other += moments[near.index];
        other = std::sqrt(other / static_cast<double>(count + 1));
        const double guided = std::sqrt(lobe_second_moment) * double{caustic[i]};
        fractions[i] = std::clamp(static_cast<float>(guided / (guided + other)), least_fraction, most_fraction);
    }
    return fractions;
}

}  // namespace nephroid

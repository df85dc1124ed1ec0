#include "tests/guided_renders.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/casters.h"
#include "integrators/bdpt/bdpt_integrator.h"
#include "integrators/driver.h"
#include "integrators/guided/combined_worker.h"
#include "integrators/guided/fraction_recorder.h"
#include "integrators/path/path_integrator.h"
#include "integrators/path/recorded_worker.h"
#include "tests/statistics.h"

namespace nephroid::testing {

namespace {

/// A path tracer with a guide that the test owns, and with the light paths of `made`.
class GuidedBy final : public Integrator {
  public:
    GuidedBy(const GuidedIntegrator& made, const DirectionalGuide& guide, FractionLearner* learner)
        : context_(made.context()), guide_(guide), learner_(learner) {
        if (made.light_tracing() == nullptr) return;
        light_tracing_.emplace(*made.light_tracing());
        light_tracing_->guide = &guide;
        light_tracing_->adaptive = nullptr;
    }
    std::string name() const override { return "guided by a test"; }
    std::unique_ptr<IntegratorWorker> make_worker() const override {
        if (learner_ != nullptr && light_tracing_) {
            return std::make_unique<RecordedWorker<CombinedWorker, FractionRecorder>>(*learner_, nullptr,
                                                                                      *light_tracing_);
        }
        if (learner_ != nullptr) {
            return std::make_unique<RecordedWorker<PathWorker, FractionRecorder>>(*learner_, context_, &guide_);
        }
        if (light_tracing_) return std::make_unique<CombinedWorker>(nullptr, *light_tracing_);
        return std::make_unique<PathWorker>(context_, &guide_);
    }
    Learner* learner() const override { return learner_; }
    bool makes_splats() const override { return light_tracing_.has_value(); }

  private:
    const RenderContext& context_;
    const DirectionalGuide& guide_;
    FractionLearner* learner_;  ///< Null: nothing is learned.
    std::optional<LightTracing> light_tracing_;
};

PreparedScene prepare(const CausticScene& caustic, const RenderSize& size) {
    return {caustic.scene, caustic.camera, size.width, size.height};
}

void set_up(RenderContext& context, const RenderSize& size, uint32_t first_seed) {
    context.max_depth = size.max_depth;
    context.sampler = SamplerKind::independent;
    context.seed = first_seed + size.seed;
}

CheckedPicture render_counted(const Integrator& integrator, const RenderSize& size) {
    AovSelection aovs;
    aovs.variance = true;
    Film film(size.width, size.height, {0, 0, size.width, size.height}, aovs, true);
    DriverSettings settings;
    settings.spp = size.spp;
    settings.threads = 2;
    settings.process_start = std::chrono::steady_clock::now();
    Progress progress(Verbosity::quiet);
    run_render(integrator, film, settings, progress);
    return {{size.width, size.height, film.beauty(), film.variance()}, film.nonfinite_samples()};
}

struct BlockSum {
    double sum = 0.0;
    double variance = 0.0;
};

BlockSum sum_of_block(const Picture& picture, int block_x, int block_y, int block) {
    BlockSum result;
    for (int y = block_y * block; y < (block_y + 1) * block; ++y) {
        for (int x = block_x * block; x < (block_x + 1) * block; ++x) {
            const size_t green = static_cast<size_t>(y * picture.width + x) * 3 + 1;
            result.sum += double{picture.rgb[green]};
            result.variance += double{picture.variance[green]};
        }
    }
    return result;
}

}  // namespace

CheckedPicture render_path(const CausticScene& caustic, const RenderSize& size) {
    PreparedScene prepared = prepare(caustic, size);
    set_up(prepared.context, size, 0);
    return render_counted(PathIntegrator(prepared.context), size);
}

CheckedPicture render_bdpt(const CausticScene& caustic, const RenderSize& size) {
    PreparedScene prepared = prepare(caustic, size);
    set_up(prepared.context, size, 2000);
    const BdptIntegrator integrator(prepared.context, find_casters(caustic.scene),
                                    {size.width, size.height, {0, 0, size.width, size.height}}, {.aim_emission = true});
    return render_counted(integrator, size);
}

CheckedPicture render_guided(const CausticScene& caustic, const RenderSize& size, const GuidedSettings& settings,
                             const CacheChange& change) {
    PreparedScene prepared = prepare(caustic, size);
    set_up(prepared.context, size, 1000);
    const GuidedIntegrator integrator(prepared.context, find_casters(caustic.scene),
                                      {size.width, size.height, {0, 0, size.width, size.height}}, settings);
    const auto finish = [&](const Integrator& used) {
        CheckedPicture picture = render_counted(used, size);
        picture.guided = integrator.guide() != nullptr;
        return picture;
    };
    if ((!change.sg && !change.slope) || integrator.guide() == nullptr) return finish(integrator);
    if (settings.lobe == LobeKind::slope) {
        const auto& made = *integrator.slope_lobes();
        MixtureCache<SlopeMixtures> mixtures(made.cache, made.options);
        change.slope(mixtures.cache);
        const std::vector<CachedPoint>& points = mixtures.cache.points;
        FractionLearner learner(mixtures.cache, std::vector<OddsMoments>(points.size()));
        const double before = mean_fraction(points);
        const bool learns = integrator.learner() != nullptr;
        CheckedPicture picture = finish(GuidedBy(integrator, mixtures.guide, learns ? &learner : nullptr));
        picture.fraction_before = before;
        picture.fraction_after = mean_fraction(points);
        return picture;
    }
    const auto& made = *integrator.spherical_gaussians();
    MixtureCache<SgMixtures> mixtures(made.cache, made.options);
    change.sg(mixtures.cache);
    return finish(GuidedBy(integrator, mixtures.guide, nullptr));
}

void check_clean(const CheckedPicture& picture) {
    CHECK(picture.nonfinite_samples == 0);
    const auto bad = std::count_if(picture.rgb.begin(), picture.rgb.end(),
                                   [](float value) { return !(value >= 0.0F && std::isfinite(value)); });
    CHECK(bad == 0);
}

void check_same_mean(const Picture& a, const Picture& b, const std::string& name) {
    constexpr int block = 4;
    const int columns = a.width / block, rows = a.height / block;
    const double limit = critical_z(sidak(0.002, columns * rows));
    double worst = 0.0;
    for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < columns; ++x) {
            const BlockSum first = sum_of_block(a, x, y, block), second = sum_of_block(b, x, y, block);
            const double deviation = std::sqrt(first.variance + second.variance);
            const double z = (first.sum - second.sum) / (deviation + 1e-6 * second.sum + 1e-12);
            worst = std::max(worst, std::abs(z));
            INFO(name, ": block ", x, ",", y, ": ", first.sum, " against ", second.sum, ", z ", z);
            CHECK(std::abs(z) < limit);
        }
    }
    MESSAGE(name << ": largest |z| of " << columns * rows << " blocks " << worst << ", limit " << limit);
}

Camera floor_camera(const CausticScene& caustic, const Vec3& x, float width) {
    const Vec3 offset(0.05F, 1.5F, 0.1F);
    return look_at(x + caustic.scale * offset, x, width / glm::length(offset));
}

void check_caustic_at(const CausticScene& caustic, const Vec3& x, const GuidedSettings& settings, uint32_t spp,
                      const std::string& name, double precision) {
    const FloorRadiance expected = floor_radiance_parts(caustic, x);
    CausticScene close = caustic;
    close.camera = floor_camera(caustic, x, 1e-5F);
    // Two tiles, one for each thread.
    const CheckedPicture picture =
        render_guided(close, {.width = 32, .height = 16, .spp = spp, .max_depth = 2}, settings);
    check_clean(picture);
    const std::vector<uint8_t> casters = find_casters(caustic.scene).is_caster;
    CHECK(picture.guided == (std::count(casters.begin(), casters.end(), 1) > 0));
    const double pixels = static_cast<double>(picture.width) * picture.height;
    double sum = 0.0, variance = 0.0;
    for (size_t i = 1; i < picture.rgb.size(); i += 3) {
        sum += double{picture.rgb[i]};
        variance += double{picture.variance[i]};
    }
    const double caustic_mean = sum / pixels - expected.direct;
    const double deviation = std::sqrt(variance) / pixels;
    // Direct light and quadrature have errors of their own.
    const double z =
        (caustic_mean - expected.reflected) / (deviation + 1.5e-3 * expected.reflected + 1e-5 * expected.direct);
    INFO(name, ", ", caustic.name, ", scale ", caustic.scale, ": ", caustic_mean, " against ", expected.reflected,
         ", deviation ", deviation, ", z ", z);
    CHECK(std::abs(z) < 4.0);
    CHECK(deviation < precision * expected.reflected);
}

}  // namespace nephroid::testing

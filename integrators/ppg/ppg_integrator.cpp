#include "integrators/ppg/ppg_integrator.h"

#include "integrators/path/path_worker.h"
#include "integrators/path/recorded_worker.h"
#include "integrators/ppg/path_recorder.h"
#include "integrators/ppg/ppg_learner.h"

namespace nephroid {

PpgIntegrator::PpgIntegrator(const RenderContext& context, const PpgSettings& settings)
    : context_(context), learner_(std::make_unique<PpgLearner>(world_bounds(context.scene), settings)) {}

PpgIntegrator::~PpgIntegrator() = default;

std::unique_ptr<IntegratorWorker> PpgIntegrator::make_worker() const {
    return std::make_unique<RecordedWorker<PathWorker, PathRecorder>>(*learner_, context_, &learner_->guide());
}

Learner* PpgIntegrator::learner() const {
    return learner_.get();
}

std::optional<IntegratorStatistics> PpgIntegrator::statistics() const {
    return learner_->statistics();
}

const SdTree& PpgIntegrator::tree() const {
    return learner_->tree();
}

}  // namespace nephroid

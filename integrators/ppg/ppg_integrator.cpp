#include "integrators/ppg/ppg_integrator.h"

#include "integrators/path/path_worker.h"
#include "integrators/ppg/path_recorder.h"
#include "integrators/ppg/ppg_learner.h"

namespace nephroid {

namespace {

class PpgWorker final : public IntegratorWorker {
  public:
    PpgWorker(const RenderContext& context, PpgLearner& learner)
        : learner_(learner), recorder_(learner.tree()), path_(context, &learner.guide()) {}

    void render(const SampleBlock& block, SampleBuffer& samples) override {
        path_.set_observer(learner_.recording() ? &recorder_ : nullptr);
        path_.render(block, samples);
    }
    uint64_t rays() const override { return path_.rays(); }

  private:
    const PpgLearner& learner_;
    PathRecorder recorder_;
    PathWorker path_;
};

}  // namespace

PpgIntegrator::PpgIntegrator(const RenderContext& context, const PpgSettings& settings)
    : context_(context), learner_(std::make_unique<PpgLearner>(world_bounds(context.scene), settings)) {}

PpgIntegrator::~PpgIntegrator() = default;

std::unique_ptr<IntegratorWorker> PpgIntegrator::make_worker() const {
    return std::make_unique<PpgWorker>(context_, *learner_);
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

// A worker whose camera paths are watched, for integrators that learn from them.
#pragma once

#include <utility>

#include "integrators/integrator.h"

namespace nephroid {

/// Renders with a worker that has a set_observer (PathWorker), watched by a recorder (a PathObserver that is made of
/// its learner) while the learner wants samples.
template <class Worker, class Recorder>
class RecordedWorker final : public IntegratorWorker {
  public:
    /// Keeps a reference to the learner, of the type that the recorder takes. The worker is made of `arguments`.
    template <class RecordersLearner, class... Arguments>
    explicit RecordedWorker(RecordersLearner& learner, Arguments&&... arguments)
        : learner_(learner), recorder_(learner), worker_(std::forward<Arguments>(arguments)...) {}
    void render(const SampleBlock& block, SampleBuffer& samples) override {
        worker_.set_observer(learner_.recording() ? &recorder_ : nullptr);
        worker_.render(block, samples);
    }
    uint64_t rays() const override { return worker_.rays(); }

  private:
    const Learner& learner_;
    Recorder recorder_;
    Worker worker_;
};

}  // namespace nephroid

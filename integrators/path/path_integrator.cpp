#include "integrators/path/path_integrator.h"

#include "integrators/path/path_worker.h"

namespace nephroid {

std::unique_ptr<IntegratorWorker> PathIntegrator::make_worker() const {
    return std::make_unique<PathWorker>(context_, nullptr, nullptr, nullptr, adaptive_.get());
}

std::optional<IntegratorStatistics> PathIntegrator::statistics() const {
    if (!adaptive_) return std::nullopt;
    return IntegratorStatistics{"path", {}, {{"mean_camera_paths", adaptive_->mean_paths()}}};
}

}  // namespace nephroid

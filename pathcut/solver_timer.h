// Adds the time of its life to a sum: how long solves take, which are spread over the whole search.
#pragma once

#include <chrono>

namespace nephroid {

class SolverTimer {
  public:
    explicit SolverTimer(double& seconds) : seconds_(seconds) {}
    ~SolverTimer() { seconds_ += std::chrono::duration<double>(Clock::now() - start_).count(); }
    SolverTimer(const SolverTimer&) = delete;
    SolverTimer& operator=(const SolverTimer&) = delete;

  private:
    using Clock = std::chrono::steady_clock;
    double& seconds_;
    Clock::time_point start_ = Clock::now();
};

}  // namespace nephroid

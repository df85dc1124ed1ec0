// What a render tells while it runs, on stderr: a bar on a terminal, plain lines elsewhere, nothing when quiet.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace nephroid {

enum class Verbosity : uint8_t { quiet, normal, verbose };

class Progress {
  public:
    explicit Progress(Verbosity verbosity);
    ~Progress();

    /// `share` of the work in [0, 1]; throttled, so it may be called after every tile by one thread at a time.
    void update(double share, uint32_t pass, uint32_t spp, std::optional<double> noise);
    /// A line for --verbose.
    void verbose(const std::string& line);

  private:
    using Clock = std::chrono::steady_clock;
    void clear_bar();

    Verbosity verbosity_;
    bool terminal_;
    bool bar_shown_ = false;
    Clock::time_point start_;
    std::optional<Clock::time_point> last_;
};

}  // namespace nephroid

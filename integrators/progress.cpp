#include "integrators/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace nephroid {

namespace {

std::string format_seconds(double seconds) {
    char text[32];
    const auto whole = static_cast<long>(seconds);
    if (whole < 60) {
        std::snprintf(text, sizeof(text), "%.1f s", seconds);
    } else if (whole < 3600) {
        std::snprintf(text, sizeof(text), "%ld:%02ld min", whole / 60, whole % 60);
    } else {
        std::snprintf(text, sizeof(text), "%ld:%02ld h", whole / 3600, whole / 60 % 60);
    }
    return text;
}

}  // namespace

Progress::Progress(Verbosity verbosity)
    : verbosity_(verbosity), terminal_(::isatty(STDERR_FILENO) == 1), start_(Clock::now()) {}

Progress::~Progress() {
    clear_bar();
}

void Progress::clear_bar() {
    if (bar_shown_) std::fputs("\r\033[K", stderr);
    bar_shown_ = false;
}

void Progress::update(double share, uint32_t pass, uint32_t spp, std::optional<double> noise) {
    if (verbosity_ == Verbosity::quiet) return;
    const Clock::time_point now = Clock::now();
    const double interval = terminal_ ? 0.1 : 5.0;
    if (last_ && std::chrono::duration<double>(now - *last_).count() < interval) return;
    last_ = now;
    const double elapsed = std::chrono::duration<double>(now - start_).count();
    const std::string eta = share > 0.0 ? format_seconds(elapsed * (1.0 - share) / share) : "?";
    char text[160];
    int length = std::snprintf(text, sizeof(text), "%3.0f%%  pass %u  %u spp  %s  ETA %s", 100.0 * share, pass, spp,
                               format_seconds(elapsed).c_str(), eta.c_str());
    if (noise && length > 0) {
        std::snprintf(text + length, sizeof(text) - static_cast<size_t>(length), "  noise %.4f", *noise);
    }
    if (!terminal_) {
        std::fprintf(stderr, "%s\n", text);
        return;
    }
    constexpr int width = 24;
    const int filled = static_cast<int>(std::clamp(share, 0.0, 1.0) * width);
    std::fprintf(stderr, "\r\033[K[%s%s] %s", std::string(static_cast<size_t>(filled), '#').c_str(),
                 std::string(static_cast<size_t>(width - filled), '.').c_str(), text);
    std::fflush(stderr);
    bar_shown_ = true;
}

void Progress::verbose(const std::string& line) {
    if (verbosity_ != Verbosity::verbose) return;
    clear_bar();
    std::fprintf(stderr, "%s\n", line.c_str());
}

}  // namespace nephroid

// The one render loop: passes, limits, threads, checkpoints, progress and error curves, for every integrator.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/film.h"
#include "core/metrics.h"
#include "integrators/integrator.h"
#include "integrators/progress.h"

namespace nephroid {

struct DriverSettings {
    std::optional<uint32_t> spp;    ///< Stop at this many samples per pixel.
    std::optional<double> seconds;  ///< Stop so that the process ends this long after its start.
    std::optional<double> noise;    ///< Stop at this relative noise (Film::relative_noise).
    int threads = 1;
    std::chrono::steady_clock::time_point process_start;
    double reserved_seconds = 0.0;   ///< Kept free at the end of `seconds` for writing the output.
    std::vector<float> reference;    ///< RGB of the crop to measure the error against; empty: none.
    std::string checkpoint;          ///< File; empty: none.
    double checkpoint_every = 60.0;  ///< Seconds.
    bool resume = false;
    uint64_t fingerprint = 0;  ///< Of scene and settings, for checkpoints.
};

struct PassRecord {
    double seconds;  ///< Since process start, at the end of the pass.
    double spp;      ///< Mean samples per pixel traced so far.
    std::optional<ImageError> error;
};

struct RenderResult {
    std::string stop_reason;  ///< "spp", "time", "noise" or "interrupted".
    double render_seconds = 0.0;
    uint64_t rays = 0;
    std::vector<PassRecord> passes;
};

/// Set by signal handlers: the render stops after the current pass.
extern std::atomic<bool> interrupt_requested;

/// Adds samples to the film until a limit is met. The samples depend on nothing but scene, settings and seed: not on
/// threads, passes, limits or interruptions.
RenderResult run_render(const Integrator& integrator, Film& film, const DriverSettings& settings, Progress& progress);

}  // namespace nephroid

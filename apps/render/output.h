// Results to files: pictures and statistics.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/render/options.h"
#include "core/film.h"
#include "integrators/driver.h"

namespace nephroid {

/// What the statistics and the pictures' attributes report.
struct RenderReport {
    const Options& options;
    const Parameters& parameters;
    const RenderResult& result;
    const Film& film;
    double load_seconds = 0.0;
    double build_seconds = 0.0;
    double precompute_seconds = 0.0;
    double write_seconds = 0.0;
    std::chrono::steady_clock::time_point process_start;
    std::optional<IntegratorStatistics> integrator_statistics;
};

/// Writes every output of the options. Throws Error(output_failed).
void write_outputs(const RenderReport& report, const std::vector<std::string>& outputs);

/// Writes the statistics (docs/formats.md). Throws Error(output_failed).
void write_statistics(const RenderReport& report, const std::string& path);

}  // namespace nephroid

// Saving a render to continue it later.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/film.h"

namespace nephroid {

/// What a render needs to go on: the film and how far every tile has come.
struct CheckpointData {
    std::vector<uint32_t> tile_samples;  ///< Next sample index per tile.
    double render_seconds = 0.0;         ///< Spent so far, all runs together.
    uint64_t rays = 0;
    uint32_t last_lesson = 0;         ///< Sample count at which the integrator has last learned.
    std::vector<uint8_t> learned;     ///< Learner::state; empty: nobody learns.
    std::vector<Film> earlier_films;  ///< IterationFilms::earlier.
};

/// Writes film and data, whole or not at all. `fingerprint` identifies scene and settings. Throws Error(output_failed).
void save_checkpoint(const std::string& path, uint64_t fingerprint, Film& film, const CheckpointData& data);

/// Restores what save_checkpoint wrote. Throws Error(resume_mismatch) for another scene, other settings or a damaged
/// file, Error(invalid_input) where it cannot be read.
CheckpointData load_checkpoint(const std::string& path, uint64_t fingerprint, Film& film);

}  // namespace nephroid

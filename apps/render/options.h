// The command line.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/render/parameters.h"
#include "core/film.h"
#include "integrators/progress.h"

namespace nephroid {

struct Options {
    std::string scene;
    std::vector<std::string> outputs;  ///< Empty: scene name + .exr.
    std::string integrator = "guided";
    std::optional<uint32_t> spp;
    std::optional<double> time;
    std::optional<double> noise;
    uint32_t seed = 0;
    int threads = 0;  ///< 0 is replaced by the number of processors.
    std::optional<int> width, height;
    std::optional<PixelRegion> crop;
    std::string camera;
    uint32_t max_depth = 12;
    std::string env;
    float env_scale = 1.0F;
    AovSelection aovs;
    std::string reference;
    std::string stats;
    std::string checkpoint;
    double checkpoint_every = 60.0;
    bool resume = false;
    std::string quality = "standard";
    std::vector<std::string> assignments;  ///< After those that `quality` implies.
    /// Pixel whose sampling is to be shown instead of a picture.
    struct Pixel {
        int x, y;
    };
    std::optional<Pixel> inspect;
    bool info = false;
    Verbosity verbosity = Verbosity::normal;
};

/// Parses the arguments; nothing where the request was answered (--help, --version, --list-parameters).
/// Throws Error(usage) with one line that names the option.
std::optional<Options> parse_options(int argc, char** argv);

}  // namespace nephroid

// What can be set about the guided integrator, and what it reports.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "core/film.h"
#include "guiding/sg_lobe.h"
#include "guiding/slope_warp.h"
#include "pathcut/path_cut_search.h"

namespace nephroid {

enum class LobeKind : uint8_t {
    spherical_gaussian,  ///< The paper's.
    slope,               ///< The material's profile in slope space: lobes.md.
};

/// How light of two and more reflections is found.
enum class LongPaths : uint8_t {
    photons,  ///< Lobes fitted to photons, of any number of reflections. Slope lobes only.
    search,   ///< Representative paths, as for one reflection.
};

struct GuidedSettings {
    LobeKind lobe = LobeKind::slope;
    uint32_t cached_points = 10000;  ///< About so many; more follow the caustic's shape better and take longer to make.
    /// Fewer points where paths of one reflection to all of them would take longer than about so many processor
    /// seconds, told from the number of solves that some of them take: not from a clock, so that the picture does not
    /// depend on the machine. With slope lobes nothing is searched where fewer than 512 would be left: photons tell
    /// all.
    double search_seconds = 5.0;
    double photons = 32.0;  ///< For each cached point: they tell where points are missing, and how much to guide.
    /// So many times, points are added where photons are covered worst, at most a quarter as many as there are.
    uint32_t refinements = 2;
    /// The search for paths ends at this time at the latest; none: when it is done.
    std::optional<std::chrono::steady_clock::time_point> search_end;
    int bounces = 2;  ///< Reflections of the longest paths; 1 .. max_chain_length. Photons: one, or any number.
    LongPaths long_paths = LongPaths::photons;
    /// Which paths count: below this normal distribution (Eq. 1), or within this multiple of alpha if it is above zero.
    AcceptanceOptions acceptance{.epsilon = 0.01, .alpha_multiple = 6.0, .enough_slope = 0.12};
    bool newton = true;           ///< Otherwise the triangles' centres stand for the paths' vertices (Fig. 13).
    double merge_distance = 0.1;  ///< SearchOptions::merge_distance.
    Selection selection = Selection::local_minima;
    SgWarp sg_warp = SgWarp::mirror;
    SlopeWarp slope_warp = SlopeWarp::newton;
    /// Probability of the guide against the BSDF, 0 .. 1 exclusive; none: as each cached point expects, then learned.
    std::optional<float> guide_fraction;
    /// Splats of light paths aimed at casters, beside camera paths: of so many samples one brings a light path (a power
    /// of two up to 64; 0: none). None: where photons tell that it pays.
    std::optional<uint32_t> light_path_per;
    /// Where something is guided to: see AdaptiveSampling.
    bool adaptive = true;
};

/// The paper's method (preset=paper).
inline GuidedSettings paper_settings() {
    GuidedSettings settings;
    settings.lobe = LobeKind::spherical_gaussian;
    settings.long_paths = LongPaths::search;
    settings.selection = Selection::every_triangle;
    settings.acceptance.alpha_multiple = 0.0;
    settings.guide_fraction = 0.5F;
    settings.light_path_per = 0;
    settings.adaptive = false;
    return settings;
}

/// The film that the cache is made for.
struct GuidedView {
    int width = 0;
    int height = 0;
    PixelRegion crop;
};

struct GuidedStatistics {
    SearchStatistics search;
    size_t cached_points = 0;
    size_t lobes = 0;
    size_t paths = 0;
    size_t photons = 0;              ///< That landed.
    size_t served_photons = 0;       ///< Of these, near a cached point.
    size_t added_points = 0;         ///< Of cached_points: where photons found them missing.
    size_t reflector_points = 0;     ///< Of cached_points: on casters, for paths of more reflections.
    size_t bytes = 0;                ///< Of the cache while rendering.
    double seconds_receivers = 0.0;  ///< Including the pilot search that tells how many are affordable.
    double seconds_hierarchy = 0.0;
    double seconds_highlights = 0.0;
    double seconds_search = 0.0;  ///< Path cuts and Newton solves, which take turns.
    double seconds_solve = 0.0;   ///< Of these, Newton solves: processor seconds over threads.
    double seconds_lobes = 0.0;
    double seconds_photons = 0.0;
    double seconds_fractions = 0.0;
};

}  // namespace nephroid

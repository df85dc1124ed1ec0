// Pictures by the guided integrator inside tests, and what they must agree with.
#pragma once

#include <functional>
#include <string>

#include "integrators/guided/guided_integrator.h"
#include "tests/caustic_scenes.h"
#include "tests/test_scenes.h"

namespace nephroid::testing {

struct RenderSize {
    int width = 16;
    int height = 16;
    uint32_t spp = 1024;
    uint32_t max_depth = 4;
    uint32_t seed = 0;
};

struct CheckedPicture : Picture {
    uint64_t nonfinite_samples = 0;
    bool guided = false;  ///< Otherwise there was nothing to guide to.
    /// Of slope lobes in a changed cache: the points' mean before and after rendering.
    double fraction_before = 0.0, fraction_after = 0.0;
};

/// Changes that make a cache wrong.
struct CacheChange {
    std::function<void(SgCache&)> sg;
    std::function<void(SlopeCache&)> slope;
};

/// Samples are independent, as the tests' variances assume.
CheckedPicture render_path(const CausticScene& caustic, const RenderSize& size);
CheckedPicture render_bdpt(const CausticScene& caustic, const RenderSize& size);
/// Slope lobes' fractions are learned, from changed caches too.
CheckedPicture render_guided(const CausticScene& caustic, const RenderSize& size, const GuidedSettings& settings,
                             const CacheChange& change = {});

/// Every pixel finite and not negative, every sample finite.
void check_clean(const CheckedPicture& picture);

/// Sums over 4 x 4 blocks, compared with the Sidak correction. Green channel.
void check_same_mean(const Picture& a, const Picture& b, const std::string& name);

/// The caustic at floor point x, looked at closely (direct light and one reflection), against quadrature. The
/// picture's relative deviation must be below `precision`: with 0.01 a bias of 5 % of the caustic fails.
void check_caustic_at(const CausticScene& caustic, const Vec3& x, const GuidedSettings& settings, uint32_t spp,
                      const std::string& name, double precision = 0.01);

/// A camera that sees the floor about x alone, a patch of `width` metres at scale 1.
Camera floor_camera(const CausticScene& caustic, const Vec3& x, float width);

}  // namespace nephroid::testing

// Bidirectional path tracing (Lafortune and Willems 1993, Veach and Guibas 1994): every camera sample comes with a
// light sub-path; all their vertices are connected, to each other, to the lights and to the camera, weighted by the
// power heuristic.
//
// Use it where light arrives by detours that the camera cannot guess: lamps in shades, light through gaps, caustics
// that the camera sees directly, even of point lights in perfect mirrors (strategy t = 1). It has no strategy for
// caustics of lights of no size that are seen in perfect mirrors, and light paths that miss the picture are work for
// nothing. docs/bdpt.md has the formulas.
#pragma once

#include "core/casters.h"
#include "integrators/subpaths/light_tracing.h"

namespace nephroid {

/// The picture that is rendered.
struct BdptView {
    int width = 0;
    int height = 0;
    PixelRegion crop;
};

struct BdptSettings {
    bool aim_emission = false;  ///< Light sub-paths of small lights go to casters rather than everywhere.
};

class BdptIntegrator final : public Integrator {
  public:
    /// Keeps a reference to the context.
    BdptIntegrator(const RenderContext& context, const CasterReport& casters, const BdptView& view,
                   const BdptSettings& settings);
    std::string name() const override { return "bdpt"; }
    std::unique_ptr<IntegratorWorker> make_worker() const override;
    bool makes_splats() const override { return true; }

  private:
    LightTracing context_;
};

}  // namespace nephroid

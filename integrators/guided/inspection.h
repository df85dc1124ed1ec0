// What guided sampling does at one surface point: the density of its directions beside the light that arrives, as
// pictures over directions (Fig. 6, Li et al. 2022).
//
// Slow and thorough: the light by brute force, the density by adaptive quadrature. It asks nothing of a guide but the
// DirectionalGuide interface, so it shows every kind of mixture.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/frame.h"
#include "guiding/directional_guide.h"
#include "integrators/integrator.h"

namespace nephroid {

/// The first vertex of a camera path whose direction is drawn from a density: what lies before it are perfect mirrors.
struct InspectedVertex {
    SurfaceInteraction surface;
    Vec3 wo{0.0F, 0.0F, 1.0F};  ///< Unit, towards the viewer or the last mirror.
    uint32_t object = 0;        ///< Index into Scene::objects.
    uint32_t mirrors = 0;       ///< Scatterings before this one.
};

/// The vertex seen through a film position (pixels from the top left corner); nothing where the path leaves the scene,
/// ends on a lamp or a black surface, or uses up its depth on mirrors.
std::optional<InspectedVertex> find_inspected_vertex(const RenderContext& context, const Vec2& film);

/// A square picture over directions. Positions are in cells from the top left corner.
class DirectionMap {
  public:
    struct Point {
        Vec3 direction{0.0F};   ///< Unit, world space.
        float jacobian = 0.0F;  ///< Solid angle per area, sr per square cell; zero: no direction is shown here.
    };

    /// All directions about a unit `normal`, equal areas for equal solid angles (Lambert's azimuthal projection, seen
    /// from outside); the top of the picture is where `up` points.
    static DirectionMap hemisphere(const Vec3& normal, const Vec3& up, int size);
    /// The view along a unit `axis`, gnomonic; half_width (radians, below pi/2) from the middle to an edge.
    static DirectionMap window(const Vec3& axis, const Vec3& up, float half_width, int size);

    int size() const { return size_; }
    size_t cell_count() const { return static_cast<size_t>(size_) * static_cast<size_t>(size_); }
    Point at(const Vec2& position) const;
    /// Where a unit direction is shown, if it is.
    std::optional<Vec2> find(const Vec3& direction) const;
    /// Whether every point of a cell shows a direction: not where the hemisphere's rim cuts it.
    bool is_whole(size_t cell) const;
    /// Solid angle of a cell (row by row from the top), sr; that of a whole one where the hemisphere's rim cuts it.
    float solid_angle(size_t cell) const;

  private:
    DirectionMap(const Vec3& axis, const Vec3& up, int size, float extent, bool gnomonic);

    Frame<float> frame_;  ///< s to the right, t to the top of the picture.
    int size_;
    float extent_;  ///< Half the picture's width, in the projection's plane.
    bool gnomonic_;
};

/// Values are means over cells.
struct DirectionPictures {
    DirectionMap map;
    std::vector<float> density;   ///< Per solid angle: fraction * guide's + (1 - fraction) * BSDF's.
    std::vector<float> radiance;  ///< RGB, W/(m^2 sr): what arrives.
    std::vector<float> target;    ///< Luminance of radiance * cosine; after normalise() per solid angle.
    /// The same from every second ray: two independent estimates, so that noise can be told from light. Equal for one
    /// ray per cell.
    std::array<std::vector<float>, 2> target_halves;
    uint64_t nonfinite_samples = 0;

    /// Integral of a layer of one channel over the picture's directions.
    double integral(const std::vector<float>& layer) const;
    /// Divides target and halves by the target's integral over all directions; leaves it where that is zero.
    void normalise(double target_integral);
};

struct InspectionSettings {
    uint32_t rays_per_cell = 64;  ///< Of the brute force.
    int threads = 1;
};

/// Density and light at a vertex. `guide` may be null: the BSDF alone. The target is not normalised. Deterministic for
/// any number of threads. Throws Error(interrupted) where an interrupt was requested.
DirectionPictures make_direction_pictures(const RenderContext& context, const InspectedVertex& vertex,
                                          const DirectionalGuide* guide, const DirectionMap& map,
                                          const InspectionSettings& settings);

/// Probability of the guide against the BSDF at the vertex; 0 where the guide knows nothing.
float guide_fraction_at(const RenderContext& context, const InspectedVertex& vertex, const DirectionalGuide* guide);

/// How well the density fits its normalised target. Without the cells that the hemisphere's rim cuts, of which the
/// quadrature may see less than the rays: their cosines are below 0.012 (512 x 512 cells).
struct DensityFit {
    double covered = 0.0;  ///< Share of the target that lies where the density is at least a tenth of it.
    /// Of the estimator radiance * cosine / density, as far as cells resolve it: sqrt(integral of target^2 / density
    /// - 1); zero for the ideal density, infinite where light arrives that is never sampled.
    double relative_deviation = 0.0;
};
/// Products of both halves stand for squares, and one half judges the other: noise of the brute force then averages out
/// instead of counting as light that was missed.
DensityFit measure_fit(const DirectionPictures& pictures);

}  // namespace nephroid

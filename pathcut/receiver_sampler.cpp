#include "pathcut/receiver_sampler.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/casters.h"
#include "core/rounding.h"
#include "core/sampler.h"
#include "pathcut/receiver_spacing.h"

namespace nephroid {

namespace {

constexpr size_t cells_per_task = 512;
constexpr uint32_t most_cells_per_point = 16;
constexpr int max_rounds = 4;
/// Between these shares of the wanted count no other grid is tried.
constexpr double close_below = 0.9, close_above = 1.1;
/// A square of surface is never seen more slanted than this cosine says: at the horizon it would be endless.
constexpr float smallest_cosine = 0.05F;
constexpr float largest_footprint = 0.25F;  // Of the scene's diagonal.
/// Where this share of the distance to the so many-th neighbour is so many times what a point stands for (of evenly
/// spaced points it is less than that), there are holes, and it stands for that share.
constexpr float spacing_share = 0.5F;
constexpr uint32_t spacing_neighbours = 4;
constexpr float least_widening = 2.0F;

/// The crop divided into cells of nearly square shape, numbered row by row.
struct CellGrid {
    PixelRegion crop;
    uint32_t columns;
    uint32_t rows;

    CellGrid(const PixelRegion& region, uint32_t cells) : crop(region) {
        const double aspect = static_cast<double>(region.width()) / region.height();
        columns =
            static_cast<uint32_t>(std::clamp(std::round(std::sqrt(cells * aspect)), 1.0, static_cast<double>(cells)));
        rows = (cells + columns / 2) / columns;
    }
    size_t size() const { return size_t{columns} * rows; }
    float cell_width() const { return static_cast<float>(crop.width()) / static_cast<float>(columns); }
    float cell_height() const { return static_cast<float>(crop.height()) / static_cast<float>(rows); }
    /// A random point of a cell, in pixels of the film.
    Vec2 point(size_t cell, uint32_t seed) const {
        const auto column = static_cast<uint32_t>(cell % columns), row = static_cast<uint32_t>(cell / columns);
        const uint32_t cell_seed = pixel_seed(column, row, seed);
        const auto [u, v] = sample_2d(SamplerKind::independent, cell_seed, 0U, 0);
        return {static_cast<float>(crop.x0) + (static_cast<float>(column) + u) * cell_width(),
                static_cast<float>(crop.y0) + (static_cast<float>(row) + v) * cell_height()};
    }
};

/// How far apart the rays of neighbouring cells are: grows linearly along the path.
struct RaySpacing {
    float at_origin;  ///< Metres.
    float growth;     ///< Per metre.
};

/// From the area and the solid angle of a cell about a film position.
RaySpacing ray_spacing(const CameraRays& camera, const Vec2& film, float cell_area) {
    const Vec3 d = camera.direction_base + film.x * camera.direction_dx + film.y * camera.direction_dy;
    const float length = glm::length(d);
    const float area = glm::dot(glm::cross(camera.origin_dx, camera.origin_dy), d) / length;
    const float solid_angle =
        glm::dot(glm::cross(camera.direction_dx, camera.direction_dy), d) / (length * length * length);
    return {std::sqrt(std::abs(area) * cell_area), std::sqrt(std::abs(solid_angle) * cell_area)};
}

struct PathState {
    RaySpacing spacing;
    float length;  ///< Up to the current ray's origin, metres.
};

bool is_unit(const Vec3& v) {
    return std::abs(glm::dot(v, v) - 1.0F) < 1e-3F;  // False for NaN.
}

bool is_finite(const Receiver& r) {
    return std::isfinite(r.position.x + r.position.y + r.position.z) &&
           std::isfinite(r.error.x + r.error.y + r.error.z) && std::isfinite(r.alpha) && std::isfinite(r.footprint);
}

/// Whether a mirror of alpha zero leaves nothing else of the surface.
bool is_pure_mirror(const BsdfParameters<float>& bsdf) {
    const bool has_diffuse_base = bsdf.metallic < 1.0F && max_component(bsdf.base) > 0.0F;
    return bsdf.alpha < delta_alpha && !has_diffuse_base;
}

/// Follows the paths of one grid.
class PathTracer {
  public:
    PathTracer(const Accelerator& accelerator, const Surfaces& surfaces, const CameraRays& camera,
               const ReceiverSampling& sampling, const CellGrid& grid, float footprint_limit)
        : accelerator_(accelerator),
          surfaces_(surfaces),
          camera_(camera),
          sampling_(sampling),
          grid_(grid),
          footprint_limit_(footprint_limit) {}

    /// The receivers of all cells, in an order that does not depend on the threads.
    std::vector<Receiver> trace() const {
        const size_t tasks = (grid_.size() + cells_per_task - 1) / cells_per_task;
        std::vector<std::vector<Receiver>> parts(tasks);
        tbb::parallel_for(size_t{0}, tasks, [&](size_t task) { parts[task] = trace_cells(task * cells_per_task); });
        std::vector<Receiver> receivers;
        for (const auto& part : parts) receivers.insert(receivers.end(), part.begin(), part.end());
        return receivers;
    }

  private:
    std::vector<Receiver> trace_cells(size_t first) const {
        RayBatch rays(cells_per_task);
        HitBatch hits(cells_per_task);
        std::vector<PathState> states(cells_per_task);
        std::vector<Receiver> receivers;
        receivers.reserve(cells_per_task);
        start_paths(first, rays, states);
        for (int bounce = 0; rays.count > 0; ++bounce) {
            accelerator_.intersect(rays, bounce == 0, hits);
            const size_t count = rays.count;
            rays.count = 0;  // The paths that go on overwrite those already handled.
            for (size_t i = 0; i < count; ++i) {
                visit_hit(hits, i, states[i], bounce < sampling_.max_bounces, rays, states, receivers);
            }
        }
        return receivers;
    }

    void start_paths(size_t first, RayBatch& rays, std::vector<PathState>& states) const {
        const float cell_area = grid_.cell_width() * grid_.cell_height();
        const size_t end = std::min(first + cells_per_task, grid_.size());
        for (size_t cell = first; cell < end; ++cell) {
            const Vec2 film = grid_.point(cell, sampling_.seed);
            states[rays.count] = {ray_spacing(camera_, film, cell_area), 0.0F};
            rays.push(to_vec3(camera_.origin(film.x, film.y)), to_vec3(camera_.direction(film.x, film.y)));
        }
    }

    /// Adds the receiver that ray i has found, and its continuation in a mirror.
    void visit_hit(const HitBatch& hits, size_t i, PathState state, bool may_continue, RayBatch& rays,
                   std::vector<PathState>& states, std::vector<Receiver>& receivers) const {
        const uint32_t object = hits.object[i];
        if (object >= surfaces_.object_count() || surfaces_.emits(object)) return;
        const Vec3 wo = -rays.direction(i);
        const SurfaceInteraction surface = surfaces_.interact(object, hits.primitive[i], hits.u[i], hits.v[i], wo);
        if (!(surface.area > 0.0F) || !is_unit(surface.geometric_normal) || !is_unit(surface.shading_normal)) return;
        state.length += hits.t[i];
        if (!is_pure_mirror(surface.bsdf)) {
            const Receiver receiver = make_receiver(surface, object, wo, state);
            if (is_finite(receiver)) receivers.push_back(receiver);
        }
        if (!may_continue || !reflects_sharply(surface, object, wo)) return;
        const Vec3& n = surface.shading_normal;
        const float cosine = glm::dot(n, wo);
        const Vec3 wi = glm::normalize(2.0F * cosine * n - wo);
        if (!(cosine > 0.0F) || !(glm::dot(surface.geometric_normal, wi) > 0.0F)) return;
        states[rays.count] = state;
        rays.push(offset_ray_origin(surface.position, surface.error, surface.geometric_normal, wi), wi);
    }

    Receiver make_receiver(const SurfaceInteraction& surface, uint32_t object, const Vec3& wo,
                           const PathState& state) const {
        const float cosine = std::max(glm::dot(surface.geometric_normal, wo), smallest_cosine);
        const float spacing = state.spacing.at_origin + state.spacing.growth * state.length;
        // A point cannot stand for less than its rounding; the smallest float keeps points at the origin positive.
        const float smallest = max_component(surface.error) + std::numeric_limits<float>::min();
        const float footprint = std::max(std::min(spacing / std::sqrt(cosine), footprint_limit_), smallest);
        return {surface.position, surface.error, surface.geometric_normal, surface.shading_normal, surface.bsdf.alpha,
                footprint,        object};
    }

    /// Whether a mirror image is seen at the surface.
    bool reflects_sharply(const SurfaceInteraction& surface, uint32_t object, const Vec3& wo) const {
        const BsdfParameters<float>& bsdf = surface.bsdf;
        const bool sharp = bsdf.alpha < delta_alpha || (surfaces_.is_caster(object) && bsdf.alpha <= max_caster_alpha);
        return sharp && max_component(specular_reflectance(bsdf, glm::dot(surface.shading_normal, wo))) > 0.0F;
    }

    const Accelerator& accelerator_;
    const Surfaces& surfaces_;
    const CameraRays& camera_;
    const ReceiverSampling& sampling_;
    const CellGrid& grid_;
    float footprint_limit_;
};

/// Finds points near others of similar footprint: hash grids whose cells grow fourfold from level to level.
class MergeGrid {
  public:
    explicit MergeGrid(const std::vector<Receiver>& receivers) : next_(receivers.size(), none) {
        size_t buckets = 16;
        while (buckets < 2 * receivers.size()) buckets *= 2;
        heads_.assign(buckets, none);
        for (const Receiver& receiver : receivers) levels_.push_back(level_of(receiver));
        std::sort(levels_.begin(), levels_.end());
        levels_.erase(std::unique(levels_.begin(), levels_.end()), levels_.end());
    }

    /// Whether a point that was inserted stands for the receiver as well.
    bool holds_like(const std::vector<Receiver>& kept, const Receiver& receiver) const {
        return std::any_of(levels_.begin(), levels_.end(), [&](int level) {
            const Cell corner = cell_at(Vec3d(receiver.position) / cell_size(level) - 0.5);
            for (int64_t k = 0; k < 8; ++k) {
                const Cell cell{corner.x + (k & 1), corner.y + ((k >> 1) & 1), corner.z + (k >> 2)};
                for (uint32_t i = heads_[bucket(cell, level)]; i != none; i = next_[i]) {
                    if (are_alike(kept[i], receiver)) return true;
                }
            }
            return false;
        });
    }

    void insert(uint32_t index, const Receiver& receiver) {
        const int level = level_of(receiver);
        uint32_t& head = heads_[bucket(cell_at(Vec3d(receiver.position) / cell_size(level)), level)];
        next_[index] = head;
        head = index;
    }

  private:
    static constexpr uint32_t none = ~0U;
    struct Cell {
        int64_t x, y, z;
    };

    /// Merge distances in [4^level, 4^(level + 1)).
    static int level_of(const Receiver& receiver) { return std::ilogb(merge_distance * receiver.footprint) >> 1; }
    /// Twice the level's merge distances at least: what may be merged lies in the 2 x 2 x 2 cells about a point.
    static double cell_size(int level) { return std::ldexp(2.0, 2 * (level + 1)); }
    static Cell cell_at(const Vec3d& scaled) {
        const Vec3d limited = glm::clamp(glm::floor(scaled), -0x1p62, 0x1p62);
        return {static_cast<int64_t>(limited.x), static_cast<int64_t>(limited.y), static_cast<int64_t>(limited.z)};
    }
    size_t bucket(const Cell& cell, int level) const {
        uint64_t key = static_cast<uint64_t>(level) * 0x9e3779b97f4a7c15U;
        for (const int64_t part : {cell.x, cell.y, cell.z}) {
            key = (key ^ static_cast<uint64_t>(part)) * 0xff51afd7ed558ccdU;
            key ^= key >> 32;
        }
        return static_cast<size_t>(key) & (heads_.size() - 1);
    }
    static bool are_alike(const Receiver& a, const Receiver& b) {
        const float reach = merge_distance * std::min(a.footprint, b.footprint);
        return glm::length(a.position - b.position) < reach &&
               glm::dot(a.geometric_normal, b.geometric_normal) > merge_normal_cosine;
    }

    std::vector<uint32_t> heads_;  ///< By bucket: the point inserted last.
    std::vector<uint32_t> next_;   ///< By point: the one inserted before it in the same bucket.
    std::vector<int> levels_;      ///< Those that occur.
};

/// The receivers without those that an earlier one stands for.
std::vector<Receiver> merged(const std::vector<Receiver>& receivers) {
    MergeGrid grid(receivers);
    std::vector<Receiver> kept;
    kept.reserve(receivers.size());
    for (const Receiver& receiver : receivers) {
        if (grid.holds_like(kept, receiver)) continue;
        grid.insert(static_cast<uint32_t>(kept.size()), receiver);
        kept.push_back(receiver);
    }
    return kept;
}

/// The lowest 21 bits, two zeros before each.
uint64_t spread_bits(uint64_t x) {
    x = (x | x << 32) & 0x001f00000000ffffU;
    x = (x | x << 16) & 0x001f0000ff0000ffU;
    x = (x | x << 8) & 0x100f00f00f00f00fU;
    x = (x | x << 4) & 0x10c30c30c30c30c3U;
    return (x | x << 2) & 0x1249249249249249U;
}

std::vector<Receiver> sorted_along_morton_curve(const std::vector<Receiver>& receivers) {
    Bounds bounds;
    for (const Receiver& receiver : receivers) bounds.extend(receiver.position);
    const double extent = std::max(double{max_component(bounds.max - bounds.min)}, 1e-30);
    std::vector<std::pair<uint64_t, uint32_t>> order;
    order.reserve(receivers.size());
    for (const Receiver& receiver : receivers) {
        const Vec3d unit = Vec3d(receiver.position - bounds.min) / extent * double{(1 << 21) - 1};
        const auto bits = [](double x) { return spread_bits(static_cast<uint64_t>(x)); };
        const auto index = static_cast<uint32_t>(order.size());
        order.emplace_back(bits(unit.x) | bits(unit.y) << 1 | bits(unit.z) << 2, index);
    }
    std::sort(order.begin(), order.end());
    std::vector<Receiver> sorted;
    sorted.reserve(receivers.size());
    for (const auto& [code, index] : order) sorted.push_back(receivers[index]);
    return sorted;
}

/// Curved mirrors spread rays further than flat ones: what points seen in them stand for is told by how far apart they
/// are.
void widen_to_neighbours(std::vector<Receiver>& receivers, float footprint_limit) {
    const std::vector<float> spacing = receiver_spacing(receivers, spacing_neighbours);
    for (size_t i = 0; i < receivers.size(); ++i) {
        const float wider = std::min(spacing_share * spacing[i], footprint_limit);
        if (wider > least_widening * receivers[i].footprint) receivers[i].footprint = wider;
    }
}

/// Keeps `count` points, evenly along the curve that they are sorted by; each then stands for more surface.
void thin_out(std::vector<Receiver>& receivers, size_t count, float footprint_limit) {
    const size_t before = receivers.size();
    const float growth = std::sqrt(static_cast<float>(before) / static_cast<float>(count));
    for (size_t i = 0; i < count; ++i) {
        receivers[i] = receivers[i * before / count];
        float& footprint = receivers[i].footprint;
        footprint = std::max(footprint, std::min(footprint * growth, footprint_limit));
    }
    receivers.resize(count);
}

PixelRegion inside_film(const ReceiverSampling& sampling) {
    const PixelRegion& crop = sampling.crop;
    return {std::max(crop.x0, 0), std::max(crop.y0, 0), std::min(crop.x1, sampling.width),
            std::min(crop.y1, sampling.height)};
}

/// The largest footprint, metres.
float find_footprint_limit(const Scene& scene) {
    const Bounds bounds = world_bounds(scene);
    return bounds.empty() ? 0.0F : largest_footprint * glm::length(bounds.max - bounds.min);
}

}  // namespace

std::vector<Receiver> sample_receivers(const Scene& scene, const Accelerator& accelerator, const Surfaces& surfaces,
                                       const CameraRays& camera, const ReceiverSampling& sampling) {
    const PixelRegion crop = inside_film(sampling);
    if (crop.width() <= 0 || crop.height() <= 0 || sampling.count == 0 || scene.objects.empty()) return {};
    const float limit = find_footprint_limit(scene);
    const double count = sampling.count;
    const double most_cells = std::min(count * most_cells_per_point, 1e9);
    double cells = count;
    std::vector<Receiver> receivers;
    for (int round = 0; round < max_rounds; ++round) {
        const CellGrid grid(crop, static_cast<uint32_t>(cells));
        receivers = merged(PathTracer(accelerator, surfaces, camera, sampling, grid, limit).trace());
        const double share = static_cast<double>(receivers.size()) / count;
        if (share >= close_below && share <= close_above) break;
        const double wanted = std::clamp(cells / std::max(share, 1.0 / most_cells_per_point), 1.0, most_cells);
        if (wanted == cells) break;
        cells = wanted;
    }
    receivers = sorted_along_morton_curve(receivers);
    if (static_cast<double>(receivers.size()) > 1.25 * count) thin_out(receivers, sampling.count, limit);
    widen_to_neighbours(receivers, limit);
    return receivers;
}

}  // namespace nephroid

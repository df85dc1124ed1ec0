#include "integrators/guided/mirrored_lamps.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <unordered_map>

#include "core/rounding.h"
#include "core/scene.h"
#include "pathcut/path_visibility.h"
#include "pathcut/tuple_solver.h"

namespace nephroid {

namespace {

/// Sides of the grid's cells in pixels at least, and how many there are at most.
constexpr double smallest_step = 0.5, most_cells = 262144.0;

/// A lamp may be seen where the half vector leaves the normal by at most so many times what it changes by to the next
/// cell, and so many alpha more.
constexpr float margin = 1.5F, margin_alphas = 2.0F;
/// What it is taken to change by where the next cell sees something else.
constexpr float change_at_edges = 0.1F;

/// Triangles that a path is followed through.
constexpr int longest_walk = 16;

/// Paths closer than this, in triangle edges, are one (SearchOptions).
constexpr double merge_distance_in_edges = 0.1;

/// A mirror path from the pinhole.
struct MirrorChain {
    struct Vertex {
        Vec3 position{0.0F};
        Vec3 normal{0.0F};  ///< For shading, on the side of wo.
        Vec3 wo{0.0F};
        uint32_t object = 0, primitive = 0;
        float alpha = 0.0F;
    };
    PerVertex<Vertex> vertices;
    size_t length = 0;
    size_t cell = 0;
};

/// The reflectors' triangles by what hits tell.
class TriangleIndex {
  public:
    explicit TriangleIndex(const ReflectorTree& reflectors) {
        indices_.reserve(reflectors.size());
        for (uint32_t i = 0; i < reflectors.size(); ++i) {
            indices_.emplace(key(reflectors.ids[i].object, reflectors.ids[i].primitive), i);
        }
    }

    uint32_t find(uint32_t object, uint32_t primitive) const {
        const auto found = indices_.find(key(object, primitive));
        return found == indices_.end() ? no_triangle : found->second;
    }

  private:
    static uint64_t key(uint32_t object, uint32_t primitive) { return uint64_t{object} << 32U | primitive; }
    std::unordered_map<uint64_t, uint32_t> indices_;
};

/// The mirror paths of two and more reflections, and the cells that they run through.
class ChainGrid {
  public:
    ChainGrid(const RenderContext& context, const PixelRegion& crop, size_t longest)
        : context_(context), crop_(crop), longest_(longest) {
        const double pixels = static_cast<double>(crop.width()) * crop.height();
        step_ = static_cast<float>(std::max(smallest_step, std::sqrt(pixels / most_cells)));
        columns_ = static_cast<size_t>(std::ceil(static_cast<float>(crop.width()) / step_));
        rows_ = static_cast<size_t>(std::ceil(static_cast<float>(crop.height()) / step_));
        std::vector<std::vector<MirrorChain>> of_rows(rows_);
        tbb::parallel_for(size_t{0}, rows_, [&](size_t row) {
            for (size_t column = 0; column < columns_; ++column) {
                const MirrorChain chain = trace(column, row);
                if (chain.length > 1) of_rows[row].push_back(chain);
            }
        });
        chain_at_.assign(columns_ * rows_, no_chain);
        for (const auto& row : of_rows) {
            for (const MirrorChain& chain : row) {
                chain_at_[chain.cell] = static_cast<uint32_t>(chains_.size());
                chains_.push_back(chain);
            }
        }
    }

    /// In the order of their cells.
    const std::vector<MirrorChain>& chains() const { return chains_; }

    /// Whether a path of so many reflections from the light may run through the chain's cell.
    bool may_see(const MirrorChain& chain, size_t length, const PathLight& light) const {
        const std::optional<Vec3> own = deviation(chain, length, light);
        if (!own) return false;
        const size_t cell = chain.cell, column = cell % columns_, row = cell / columns_;
        float change = 0.0F;
        const auto compare = [&](bool exists, size_t other) {
            std::optional<Vec3> its;
            if (exists && chain_at_[other] != no_chain && goes_alike(chain, chains_[chain_at_[other]], length)) {
                its = deviation(chains_[chain_at_[other]], length, light);
            }
            change = std::max(change, its ? glm::length(*its - *own) : change_at_edges);
        };
        compare(column > 0, cell - 1);
        compare(column + 1 < columns_, cell + 1);
        compare(row > 0, cell - columns_);
        compare(row + 1 < rows_, cell + columns_);
        return glm::length(*own) <= margin * change + margin_alphas * chain.vertices[length - 1].alpha;
    }

  private:
    static constexpr uint32_t no_chain = std::numeric_limits<uint32_t>::max();

    MirrorChain trace(size_t column, size_t row) const {
        const float x = static_cast<float>(crop_.x0) + (static_cast<float>(column) + 0.5F) * step_;
        const float y = static_cast<float>(crop_.y0) + (static_cast<float>(row) + 0.5F) * step_;
        Vec3 origin = to_vec3(context_.camera_rays.origin(x, y));
        Vec3 direction = to_vec3(context_.camera_rays.direction(x, y));
        MirrorChain chain;
        chain.cell = row * columns_ + column;
        while (chain.length < longest_) {
            const Hit hit = context_.accelerator.intersect({origin, direction});
            if (hit.object >= context_.surfaces.object_count() || !context_.surfaces.is_caster(hit.object)) break;
            const SurfaceInteraction s =
                context_.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -direction);
            const float cosine = -glm::dot(s.shading_normal, direction);
            if (!(cosine > 0.0F)) break;
            chain.vertices[chain.length++] = {s.position, s.shading_normal, -direction,
                                              hit.object, hit.primitive,    s.bsdf.alpha};
            direction = glm::normalize(direction + 2.0F * cosine * s.shading_normal);
            if (!(glm::dot(s.geometric_normal, direction) > 0.0F)) break;
            origin = offset_ray_origin(s.position, s.error, s.geometric_normal, direction);
        }
        return chain;
    }

    static bool goes_alike(const MirrorChain& a, const MirrorChain& b, size_t length) {
        if (b.length < length) return false;
        for (size_t i = 0; i < length; ++i) {
            if (a.vertices[i].object != b.vertices[i].object) return false;
        }
        return true;
    }

    /// Half vector minus normal at the last vertex. None where light would come from behind.
    static std::optional<Vec3> deviation(const MirrorChain& chain, size_t length, const PathLight& light) {
        if (chain.length < length) return std::nullopt;
        const MirrorChain::Vertex& last = chain.vertices[length - 1];
        const Vec3 wi = glm::normalize(light.at_infinity ? light.point : light.point - last.position);
        if (!(glm::dot(wi, last.normal) > 0.0F)) return std::nullopt;
        return glm::normalize(wi + last.wo) - last.normal;
    }

    const RenderContext& context_;
    PixelRegion crop_;
    size_t longest_;
    float step_ = 1.0F;  ///< Pixels.
    size_t columns_ = 0, rows_ = 0;
    std::vector<MirrorChain> chains_;
    std::vector<uint32_t> chain_at_;  ///< By cell.
};

/// Where the solver starts.
struct Start {
    PerVertex<uint32_t> triangles{};
    uint8_t length = 0;
    uint16_t light = 0;
    auto operator<=>(const Start&) const = default;
};

/// The first triangles of a chain; none if one of them is no reflector (degenerate ones are not).
std::optional<Start> start_of(const MirrorChain& chain, size_t length, size_t light, const TriangleIndex& index) {
    Start start;
    start.length = static_cast<uint8_t>(length);
    start.light = static_cast<uint16_t>(light);
    for (size_t i = 0; i < length; ++i) {
        start.triangles[i] = index.find(chain.vertices[i].object, chain.vertices[i].primitive);
        if (start.triangles[i] == no_triangle) return std::nullopt;
    }
    return start;
}

std::vector<Start> find_starts(const ChainGrid& grid, const GuidedPaths& prepared) {
    if (grid.chains().empty()) return {};
    const TriangleIndex index(prepared.reflectors);
    std::vector<std::vector<Start>> of_lights(prepared.lights.size());
    tbb::parallel_for(size_t{0}, of_lights.size(), [&](size_t light) {
        for (const MirrorChain& chain : grid.chains()) {
            for (size_t length = 2; length <= chain.length; ++length) {
                if (!grid.may_see(chain, length, prepared.lights[light])) continue;
                if (const auto start = start_of(chain, length, light, index)) of_lights[light].push_back(*start);
            }
        }
    });
    std::vector<Start> starts;
    for (const auto& more : of_lights) starts.insert(starts.end(), more.begin(), more.end());
    std::sort(starts.begin(), starts.end());
    starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
    return starts;
}

/// The pinhole as the start of a path.
SurfacePoint pinhole_towards(const CameraRays& rays, const Vec3& y) {
    return {Vec3d(rays.origin_base), glm::normalize(y - rays.origin_base)};
}

}  // namespace

std::vector<FoundPath> find_mirrored_lamps(const RenderContext& context, const GuidedPaths& prepared,
                                           const PixelRegion& crop, int longest, const SolverOptions& options) {
    const auto most = static_cast<size_t>(std::clamp(longest, 1, max_chain_length));
    if (most < 2) return {};
    const ChainGrid grid(context, crop, most);
    const std::vector<Start> starts = find_starts(grid, prepared);
    std::vector<std::optional<FoundPath>> solved(starts.size());
    tbb::parallel_for(size_t{0}, starts.size(), [&](size_t i) {
        PerVertex<uint32_t> triangles = starts[i].triangles;
        const auto chain = std::span(triangles).first(starts[i].length);
        SolverWork work;
        const PathLight& light = prepared.lights[starts[i].light];
        const TupleSolution solution = walk_to_minimum(prepared.reflectors, chain, context.camera_rays.origin_base,
                                                       light, options, longest_walk, work);
        if (!solution.accepted) return;
        FoundPath path = make_found_path(prepared.reflectors, chain, solution.path);
        path.path.light = starts[i].light;
        const SurfacePoint pinhole = pinhole_towards(context.camera_rays, path.positions[0]);
        if (is_visible(context.accelerator, prepared.reflectors, pinhole, path, light)) solved[i] = path;
    });
    std::vector<FoundPath> found;
    for (const std::optional<FoundPath>& path : solved) {
        if (path) found.push_back(*path);
    }
    std::sort(found.begin(), found.end(), comes_before);
    merge_paths(found, merge_distance_in_edges);
    return found;
}

}  // namespace nephroid

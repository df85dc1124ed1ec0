#include "integrators/guided/inspection.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <span>

#include "core/error.h"
#include "core/rounding.h"
#include "integrators/driver.h"
#include "integrators/path/path_worker.h"

namespace nephroid {

namespace {

bool is_black(const BsdfParameters<float>& bsdf) {
    const bool coated = bsdf.metallic < 1.0F && (max_component(to_vec3(bsdf.coat_f0)) > 0.0F || bsdf.coat_f90 > 0.0F);
    return max_component(to_vec3(bsdf.base)) <= 0.0F && !coated;
}

/// Whether the path tracer asks the guide at the vertex: it does not for the last scattering, nor without lights, nor
/// where metal is smoother than the guide knows.
bool is_guided(const RenderContext& context, const InspectedVertex& vertex, const DirectionalGuide* guide) {
    const BsdfParameters<float>& bsdf = vertex.surface.bsdf;
    return guide != nullptr && vertex.mirrors + 1 < context.max_depth && !context.lights.empty() &&
           !is_narrow_metal(bsdf.metallic, bsdf.alpha, guide->least_alpha());
}

/// Points of one vertex at a time in a batch.
constexpr size_t batch_size = 16;

/// What the path tracer draws directions from at the vertex, and how it draws them. One per thread.
class DirectionSampling {
  public:
    DirectionSampling(const RenderContext& context, const InspectedVertex& vertex, const DirectionalGuide* guide)
        : vertex_(vertex),
          frame_(make_frame(to_triple(vertex.surface.shading_normal))),
          wo_(frame_.to_local(to_triple(vertex.wo))),
          batch_(batch_size),
          vertices_(batch_size),
          light_directions_(batch_size) {
        if (is_guided(context, vertex, guide)) worker_ = guide->make_worker();
        for (size_t k = 0; k < batch_size; ++k) {
            vertices_.position.set(k, vertex.surface.position);
            vertices_.geometric_normal.set(k, vertex.surface.geometric_normal);
            vertices_.shading_normal.set(k, vertex.surface.shading_normal);
            vertices_.wo.set(k, vertex.wo);
            vertices_.set_bsdf(k, vertex.surface.bsdf);
        }
    }

    /// Densities of at most batch_size unit directions, per solid angle; the guide's fraction is kept.
    void density(std::span<const Vec3> directions, std::span<float> densities) {
        // To prepare a mixture is most of the work, and a query has room for two directions: its own and the light's.
        const size_t pairs = (directions.size() + 1) / 2;
        for (size_t k = 0; k < pairs; ++k) {
            batch_.direction.set(k, directions[2 * k]);
            light_directions_.set(k, directions[std::min(2 * k + 1, directions.size() - 1)]);
            batch_.u_choice[k] = 0x1.fffffep-1F;  // The guide must not replace the direction: the BSDF's turn.
            batch_.u[k] = batch_.v[k] = 0.5F;
        }
        ask_guide(pairs, true);
        for (size_t i = 0; i < directions.size(); ++i) {
            const Triple<float> wi = frame_.to_local(to_triple(directions[i]));
            const float bsdf_pdf = evaluate_bsdf(vertex_.surface.bsdf, wo_, wi).pdf;
            fraction_ = batch_.fraction[i / 2];
            const float guide_pdf = i % 2 == 0 ? batch_.pdf[i / 2] : batch_.light_pdf[i / 2];
            densities[i] = (1.0F - fraction_) * bsdf_pdf + (fraction_ > 0.0F ? fraction_ * guide_pdf : 0.0F);
        }
    }

    /// Draws a direction as the path tracer does; nothing where the BSDF absorbs or chooses the mirror direction of a
    /// smooth coat, which has no density.
    std::optional<Vec3> sample(uint32_t seed, uint32_t index) {
        const auto [u_lobe, u_choice] = sample_2d(SamplerKind::independent, seed, index, 0);
        const auto [u, v] = sample_2d(SamplerKind::independent, seed, index, 1);
        const BsdfSample<float> bsdf = sample_bsdf(vertex_.surface.bsdf, wo_, u_lobe, u, v);
        batch_.direction.set(0, to_vec3(frame_.to_world(bsdf.wi)));
        batch_.u_choice[0] = u_choice;
        batch_.u[0] = u;
        batch_.v[0] = v;
        ask_guide(1, false);
        if (batch_.guided[0] == 0.0F && (bsdf.delta || bsdf.wi.z <= 0.0F)) return std::nullopt;
        return batch_.direction.get(0);
    }

    float fraction() const { return fraction_; }

  private:
    void ask_guide(size_t count, bool both) {
        batch_.count = count;
        batch_.wants_light_pdf = both;
        std::fill_n(batch_.guided.data(), count, 0.0F);
        std::fill_n(batch_.fraction.data(), count, worker_ ? 1.0F : 0.0F);
        if (worker_) worker_->guide(guide_points(vertices_, vertices_.wo, light_directions_), batch_);
    }

    const InspectedVertex& vertex_;
    Frame<float> frame_;
    Triple<float> wo_;
    std::unique_ptr<GuideWorker> worker_;
    GuideBatch batch_;
    VertexWave vertices_;
    TripleArray light_directions_;
    float fraction_ = 0.0F;
};

/// Directions that the path tracer would draw, sorted by the cell that shows them: they tell where lobes are that the
/// quadrature's points would miss.
struct DrawnDirections {
    std::vector<Vec2> positions;
    std::vector<uint32_t> first;  ///< Per cell, and one more.
};

constexpr uint32_t drawn_count = 1U << 17;

DrawnDirections draw_directions(DirectionSampling& sampling, const DirectionMap& map, uint32_t seed) {
    std::vector<std::pair<uint32_t, Vec2>> shown;
    for (uint32_t i = 0; i < drawn_count; ++i) {
        const std::optional<Vec3> direction = sampling.sample(seed, i);
        const std::optional<Vec2> position = direction ? map.find(*direction) : std::nullopt;
        if (!position) continue;
        const auto x = static_cast<uint32_t>(position->x), y = static_cast<uint32_t>(position->y);
        shown.emplace_back(y * static_cast<uint32_t>(map.size()) + x, *position);
    }
    std::stable_sort(shown.begin(), shown.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    DrawnDirections drawn;
    drawn.first.assign(map.cell_count() + 1, 0);
    for (const auto& [cell, position] : shown) {
        ++drawn.first[cell + 1];
        drawn.positions.push_back(position);
    }
    for (size_t cell = 0; cell < map.cell_count(); ++cell) drawn.first[cell + 1] += drawn.first[cell];
    return drawn;
}

/// Integrates the density over squares of a map: four midpoints, then smaller squares where these differ, or where
/// more or fewer directions were drawn than they promise.
class DensityQuadrature {
  public:
    DensityQuadrature(DirectionSampling& sampling, const DirectionMap& map) : sampling_(sampling), map_(map) {}

    /// Probability of the square's directions; reorders the positions drawn inside.
    double integrate(const Vec2& corner, float side, std::span<Vec2> drawn, int depth = 0) {
        std::array<Vec3, 4> directions{};
        std::array<float, 4> jacobians{}, densities{};
        for (size_t i = 0; i < 4; ++i) {
            const Vec2 offset(i % 2 == 0 ? 0.25F : 0.75F, i < 2 ? 0.25F : 0.75F);
            const DirectionMap::Point point = map_.at(corner + side * offset);
            directions[i] = point.direction;
            jacobians[i] = point.jacobian;
        }
        const bool shows_nothing = *std::max_element(jacobians.begin(), jacobians.end()) <= 0.0F;
        if (shows_nothing && depth >= rim_depth) return 0.0;
        sampling_.density(directions, densities);
        double sum = 0.0, least = std::numeric_limits<double>::infinity(), most = 0.0;
        for (size_t i = 0; i < 4; ++i) {
            const double value = jacobians[i] > 0.0F ? double{densities[i]} * double{jacobians[i]} : 0.0;
            sum += value;
            least = std::min(least, value);
            most = std::max(most, value);
        }
        const double area = double{side} * double{side};
        const double probability = 0.25 * sum * area;
        const bool smooth = (most - least) * area < std::max(0.25 * probability, smallest_difference);
        if (depth == deepest || (smooth && !shows_nothing && agrees(probability, drawn.size()))) return probability;
        return integrate_quarters(corner, 0.5F * side, drawn, depth + 1);
    }

  private:
    static constexpr int deepest = 9;    ///< A 512th of a cell: 1e-5 rad in a hemisphere of 512 x 512 cells.
    static constexpr int rim_depth = 4;  ///< Squares at the hemisphere's rim whose middle is outside: down to a 16th.
    static constexpr double smallest_difference = 2e-8;

    static bool agrees(double probability, size_t drawn) {
        const double expected = probability * drawn_count;
        return std::abs(static_cast<double>(drawn) - expected) <= 5.0 * std::sqrt(expected) + 5.0;
    }

    double integrate_quarters(const Vec2& corner, float side, std::span<Vec2> drawn, int depth) {
        const Vec2 middle = corner + side;
        const auto lower =
            std::partition(drawn.begin(), drawn.end(), [&middle](const Vec2& p) { return p.y < middle.y; });
        double sum = 0.0;
        for (const bool bottom : {false, true}) {
            const std::span<Vec2> row = bottom ? std::span(lower, drawn.end()) : std::span(drawn.begin(), lower);
            const auto right =
                std::partition(row.begin(), row.end(), [&middle](const Vec2& p) { return p.x < middle.x; });
            const float y = bottom ? middle.y : corner.y;
            sum += integrate({corner.x, y}, side, std::span(row.begin(), right), depth);
            sum += integrate({middle.x, y}, side, std::span(right, row.end()), depth);
        }
        return sum;
    }

    DirectionSampling& sampling_;
    const DirectionMap& map_;
};

void stop_if_interrupted() {
    if (interrupt_requested) throw Error(ExitCode::interrupted, "--inspect: interrupted; nothing was written");
}

/// Calls body(first, end) for runs of cells, each with no more than a path tracer's block; stops on an interrupt.
void for_cell_runs(const DirectionMap& map, int threads, const std::function<void(size_t, size_t)>& body) {
    constexpr size_t run = max_slots_per_block;
    const size_t runs = (map.cell_count() + run - 1) / run;
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
    tbb::task_arena arena(threads);
    arena.execute([&] {
        tbb::parallel_for(
            tbb::blocked_range<size_t>(0, runs, 1),
            [&](const tbb::blocked_range<size_t>& range) {
                for (size_t i = range.begin(); i < range.end() && !interrupt_requested; ++i) {
                    body(i * run, std::min((i + 1) * run, map.cell_count()));
                }
            },
            tbb::simple_partitioner());
    });
    stop_if_interrupted();
}

Vec2 corner_of(const DirectionMap& map, size_t cell) {
    const auto size = static_cast<size_t>(map.size());
    return {static_cast<float>(cell % size), static_cast<float>(cell / size)};
}

void add_density(const RenderContext& context, const InspectedVertex& vertex, const DirectionalGuide* guide,
                 int threads, DirectionPictures& pictures) {
    const DirectionMap& map = pictures.map;
    pictures.density.assign(map.cell_count(), 0.0F);
    tbb::enumerable_thread_specific<DirectionSampling> samplings(
        [&] { return DirectionSampling(context, vertex, guide); });
    DrawnDirections drawn = draw_directions(samplings.local(), map, context.seed);
    for_cell_runs(map, threads, [&](size_t first, size_t end) {
        DensityQuadrature quadrature(samplings.local(), map);
        for (size_t cell = first; cell < end; ++cell) {
            const std::span<Vec2> inside =
                std::span(drawn.positions).subspan(drawn.first[cell], drawn.first[cell + 1] - drawn.first[cell]);
            const double probability = quadrature.integrate(corner_of(map, cell), 1.0F, inside);
            pictures.density[cell] = static_cast<float>(probability / double{map.solid_angle(cell)});
        }
    });
}

/// Sums the light that arrives in a run of cells. One per thread.
class IncidentLight {
  public:
    IncidentLight(const RenderContext& context, const InspectedVertex& vertex)
        : context_(context), vertex_(vertex), worker_(context, nullptr), rays_(max_slots_per_block) {}

    void add(size_t first, size_t end, uint32_t samples, DirectionPictures& pictures) {
        for (uint32_t sample = 0; sample < samples && !interrupt_requested; ++sample) {
            push_rays(pictures.map, first, end, sample);
            worker_.incident_radiance(rays_, seeds_, sample, buffer_);
            for (size_t i = 0; i < rays_.count; ++i) add_ray(i, sample, samples, pictures);
        }
    }
    uint64_t nonfinite() const { return nonfinite_; }

  private:
    void push_rays(const DirectionMap& map, size_t first, size_t end, uint32_t sample) {
        const SurfaceInteraction& surface = vertex_.surface;
        rays_.count = 0;
        seeds_.clear();
        cells_.clear();
        weights_.clear();
        for (size_t cell = first; cell < end; ++cell) {
            const Vec2 corner = corner_of(map, cell);
            const uint32_t seed =
                pixel_seed(static_cast<uint32_t>(corner.x), static_cast<uint32_t>(corner.y), context_.seed);
            // The dimension of the film position, which rays that do not come from a camera leave unused.
            const auto [u, v] = sample_2d(context_.sampler, seed, sample, 0);
            const DirectionMap::Point point = map.at(corner + Vec2(u, v));
            if (point.jacobian <= 0.0F || glm::dot(surface.geometric_normal, point.direction) <= 0.0F ||
                glm::dot(surface.shading_normal, point.direction) <= 0.0F) {
                continue;
            }
            rays_.push(offset_ray_origin(surface.position, surface.error, surface.geometric_normal, point.direction),
                       point.direction);
            seeds_.push_back(seed);
            cells_.push_back(cell);
            weights_.push_back(point.jacobian / map.solid_angle(cell));
        }
    }

    void add_ray(size_t i, uint32_t sample, uint32_t samples, DirectionPictures& pictures) {
        Rgb radiance = buffer_.radiance_of(i);
        if (!std::isfinite(radiance.r + radiance.g + radiance.b)) {
            ++nonfinite_;
            return;
        }
        radiance *= weights_[i];
        const size_t cell = cells_[i];
        const Rgb mean = radiance / static_cast<float>(samples);
        for (int c = 0; c < 3; ++c) pictures.radiance[3 * cell + static_cast<size_t>(c)] += mean[c];
        const float target = luminance(radiance) * glm::dot(vertex_.surface.shading_normal, rays_.direction(i));
        pictures.target[cell] += target / static_cast<float>(samples);
        for (uint32_t half = 0; half < 2; ++half) {
            const uint32_t rays = samples > 1 ? (samples + 1 - half) / 2 : 1;
            if (samples == 1 || sample % 2 == half) {
                pictures.target_halves[half][cell] += target / static_cast<float>(rays);
            }
        }
    }

    const RenderContext& context_;
    const InspectedVertex& vertex_;
    PathWorker worker_;
    RayBatch rays_;
    SampleBuffer buffer_;
    std::vector<uint32_t> seeds_;
    std::vector<size_t> cells_;
    std::vector<float> weights_;  ///< Solid angle per area against the cell's mean.
    uint64_t nonfinite_ = 0;
};

void add_light(const RenderContext& context, const InspectedVertex& vertex, const InspectionSettings& settings,
               DirectionPictures& pictures) {
    pictures.radiance.assign(3 * pictures.map.cell_count(), 0.0F);
    pictures.target.assign(pictures.map.cell_count(), 0.0F);
    for (auto& half : pictures.target_halves) half.assign(pictures.map.cell_count(), 0.0F);
    RenderContext rest = context;
    rest.max_depth = context.max_depth - vertex.mirrors - 1;
    rest.aovs = {};
    tbb::enumerable_thread_specific<std::unique_ptr<IncidentLight>> lights(
        [&] { return std::make_unique<IncidentLight>(rest, vertex); });
    for_cell_runs(pictures.map, settings.threads,
                  [&](size_t first, size_t end) { lights.local()->add(first, end, settings.rays_per_cell, pictures); });
    for (const auto& light : lights) pictures.nonfinite_samples += light->nonfinite();
}

/// A unit vector perpendicular to `axis`, towards `wanted` as far as that is possible.
Vec3 perpendicular_towards(const Vec3& axis, const Vec3& wanted) {
    const Vec3 across = wanted - glm::dot(wanted, axis) * axis;
    const float length = glm::length(across);
    return length > 1e-3F ? across / length : to_vec3(make_frame(to_triple(axis)).t);
}

}  // namespace

std::optional<InspectedVertex> find_inspected_vertex(const RenderContext& context, const Vec2& film) {
    Ray ray{to_vec3(context.camera_rays.origin(film.x, film.y)),
            to_vec3(context.camera_rays.direction(film.x, film.y))};
    for (uint32_t mirrors = 0; mirrors < context.max_depth; ++mirrors) {
        const Hit hit = context.accelerator.intersect(ray);
        if (hit.object >= context.surfaces.object_count()) return std::nullopt;
        const Vec3 wo = -ray.direction;
        const SurfaceInteraction surface = context.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, wo);
        if (is_black(surface.bsdf) || glm::dot(surface.shading_normal, wo) <= 0.0F) return std::nullopt;
        const bool is_mirror = is_narrow_metal(surface.bsdf.metallic, surface.bsdf.alpha, delta_alpha);
        if (!is_mirror) return InspectedVertex{surface, wo, hit.object, mirrors};
        const Vec3 mirrored = glm::normalize(2.0F * glm::dot(surface.shading_normal, wo) * surface.shading_normal - wo);
        if (glm::dot(surface.geometric_normal, mirrored) <= 0.0F) return std::nullopt;
        ray = {offset_ray_origin(surface.position, surface.error, surface.geometric_normal, mirrored), mirrored};
    }
    return std::nullopt;
}

DirectionMap::DirectionMap(const Vec3& axis, const Vec3& up, int size, float extent, bool gnomonic)
    : size_(size), extent_(extent), gnomonic_(gnomonic) {
    const Vec3 top = perpendicular_towards(axis, up);
    // From outside one looks against the axis, through a window along it.
    const Vec3 right = gnomonic ? glm::cross(axis, top) : glm::cross(top, axis);
    frame_ = {to_triple(right), to_triple(top), to_triple(axis)};
}

DirectionMap DirectionMap::hemisphere(const Vec3& normal, const Vec3& up, int size) {
    return {normal, up, size, 1.0F, false};
}

DirectionMap DirectionMap::window(const Vec3& axis, const Vec3& up, float half_width, int size) {
    return {axis, up, size, std::tan(half_width), true};
}

DirectionMap::Point DirectionMap::at(const Vec2& position) const {
    const float cell = 2.0F * extent_ / static_cast<float>(size_);
    const float x = position.x * cell - extent_, y = extent_ - position.y * cell;
    const float r2 = x * x + y * y;
    if (gnomonic_) {
        const float cosine = 1.0F / std::sqrt(1.0F + r2);
        return {to_vec3(frame_.to_world({x * cosine, y * cosine, cosine})), cell * cell * cosine * cosine * cosine};
    }
    if (r2 >= 1.0F) return {};
    const float scale = std::sqrt(2.0F - r2);
    return {to_vec3(frame_.to_world({x * scale, y * scale, 1.0F - r2})), 2.0F * cell * cell};
}

std::optional<Vec2> DirectionMap::find(const Vec3& direction) const {
    const Triple<float> local = frame_.to_local(to_triple(direction));
    if (local.z <= 0.0F) return std::nullopt;
    const float scale = gnomonic_ ? 1.0F / local.z : 1.0F / std::sqrt(1.0F + local.z);
    const float cells = 0.5F * static_cast<float>(size_) / extent_;
    const Vec2 position((extent_ + local.x * scale) * cells, (extent_ - local.y * scale) * cells);
    const auto end = static_cast<float>(size_);
    if (!(position.x >= 0.0F && position.y >= 0.0F && position.x < end && position.y < end)) return std::nullopt;
    return position;
}

bool DirectionMap::is_whole(size_t cell) const {
    const Vec2 corner = corner_of(*this, cell);
    for (const Vec2 offset : {Vec2(0, 0), Vec2(1, 0), Vec2(0, 1), Vec2(1, 1)}) {
        if (at(corner + offset).jacobian <= 0.0F) return false;
    }
    return true;
}

float DirectionMap::solid_angle(size_t cell) const {
    const float side = 2.0F * extent_ / static_cast<float>(size_);
    return gnomonic_ ? at(corner_of(*this, cell) + 0.5F).jacobian : 2.0F * side * side;
}

double DirectionPictures::integral(const std::vector<float>& layer) const {
    double sum = 0.0;
    for (size_t cell = 0; cell < layer.size(); ++cell) sum += double{layer[cell]} * double{map.solid_angle(cell)};
    return sum;
}

void DirectionPictures::normalise(double target_integral) {
    if (!(target_integral > 0.0)) return;
    for (std::vector<float>* layer : {&target, &target_halves[0], &target_halves[1]}) {
        for (float& value : *layer) value = static_cast<float>(double{value} / target_integral);
    }
}

DirectionPictures make_direction_pictures(const RenderContext& context, const InspectedVertex& vertex,
                                          const DirectionalGuide* guide, const DirectionMap& map,
                                          const InspectionSettings& settings) {
    DirectionPictures pictures{map, {}, {}, {}, {}};
    add_density(context, vertex, guide, settings.threads, pictures);
    add_light(context, vertex, settings, pictures);
    return pictures;
}

float guide_fraction_at(const RenderContext& context, const InspectedVertex& vertex, const DirectionalGuide* guide) {
    DirectionSampling sampling(context, vertex, guide);
    float density = 0.0F;
    sampling.density({&vertex.surface.geometric_normal, 1}, {&density, 1});
    return sampling.fraction();
}

DensityFit measure_fit(const DirectionPictures& pictures) {
    double total = 0.0, covered = 0.0, second_moment = 0.0;
    for (size_t cell = 0; cell < pictures.target.size(); ++cell) {
        if (pictures.target[cell] <= 0.0F || !pictures.map.is_whole(cell)) continue;
        const double density = double{pictures.density[cell]}, solid_angle = double{pictures.map.solid_angle(cell)};
        const std::array<double, 2> halves{double{pictures.target_halves[0][cell]},
                                           double{pictures.target_halves[1][cell]}};
        for (size_t half = 0; half < 2; ++half) {
            const double light = 0.5 * halves[half] * solid_angle;
            total += light;
            if (density >= 0.1 * halves[1 - half]) covered += light;
        }
        const double square = halves[0] * halves[1];
        if (square > 0.0) second_moment += square / density * solid_angle;
    }
    if (total <= 0.0) return {};
    // Noise can bring the moment below one where density and target agree.
    return {covered / total, std::sqrt(std::max(second_moment / (total * total) - 1.0, 0.0))};
}

}  // namespace nephroid

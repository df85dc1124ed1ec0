#include "guiding/sd_tree.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/sampler.h"
#include "guiding/cylindrical_map.h"
#include "guiding/learned_fraction.h"

namespace nephroid {

namespace {

constexpr float largest_below_one = 0x1.fffffep-1F;
/// Larger records count as this: far below what the sums can hold.
constexpr double largest_record = 0x1p40;

/// Three numbers in [0, 1) that the record alone decides.
Vec3 random_point(const LightRecord& record) {
    uint32_t hash = 0x2f8a51c3U;
    for (int c = 0; c < 3; ++c) {
        hash = hash_combine(hash, std::bit_cast<uint32_t>(record.position[c]));
        hash = hash_combine(hash, std::bit_cast<uint32_t>(record.direction[c]));
    }
    const uint32_t second = hash_uint(hash + 0x68bc21ebU);
    return {unit_float(hash), unit_float(second), unit_float(hash_uint(second + 0x02e5be93U))};
}

}  // namespace

SdTree::SdTree(const Bounds& bounds, const SdTreeSettings& settings) : settings_(settings), nodes_(1) {
    if (!bounds.empty()) {
        const Vec3 extent = bounds.max - bounds.min;
        origin_ = bounds.min;
        size_ = std::max({extent.x, extent.y, extent.z, std::numeric_limits<float>::min()});
    }
    leaves_[0].bsdf_fraction = settings.bsdf_fraction.value_or(0.5F);
    reset_training();
}

SdTree::Cell SdTree::find_cell(const Vec3& position) const {
    Vec3 p = glm::clamp((position - origin_) / size_, 0.0F, largest_below_one);
    uint32_t index = 0;
    int depth = 0;
    for (int axis = 0; spatial_[index].child != 0; ++depth, axis = axis == 2 ? 0 : axis + 1) {
        p[axis] *= 2.0F;
        const bool upper = p[axis] >= 1.0F;
        if (upper) p[axis] -= 1.0F;
        index = spatial_[index].child + (upper ? 1 : 0);
    }
    return {spatial_[index].leaf, depth};
}

float SdTree::pdf(const Leaf& leaf, const Vec3& direction) const {
    return quad_tree_density(directions(leaf), direction_to_square(direction)) * (1.0F / cylindrical_map_area);
}

GuidedDirection SdTree::sample(const Leaf& leaf, Vec2 u) const {
    const QuadSample sample = sample_quad_tree(directions(leaf), u);
    return {square_to_direction(sample.point), sample.density * (1.0F / cylindrical_map_area)};
}

// The stochastic filter: a box of the cell's size about the record, so that neighbouring cells learn from each other.
Vec3 SdTree::jittered(const LightRecord& record, int depth) const {
    const Vec3 u = random_point(record);
    Vec3 result = record.position;
    for (int axis = 0; axis < 3; ++axis) {
        const float edge = std::ldexp(size_, -((depth + 2 - axis) / 3));
        result[axis] += edge * (u[axis] - 0.5F);
    }
    return result;
}

void SdTree::record(const LightRecord& record, std::vector<QuadShare>& scratch) {
    Cell cell = find_cell(record.position);
    if (record.bsdf_share >= 0.0F && learns_fraction()) record_choice(record, cell.leaf);
    if (record.pdf == 0.0F) return;
    if (settings_.stochastic_spatial_filter) cell = find_cell(jittered(record, cell.depth));
    std::atomic_ref<uint64_t>(counts_[cell.leaf]).fetch_add(1, std::memory_order_relaxed);
    const double value = static_cast<double>(record.radiance) / static_cast<double>(record.pdf);
    // "Not above" rather than "below": NaN is left out too.
    if (!(value > 0.0)) return;
    const Leaf& leaf = leaves_[cell.leaf];
    const Vec2 point = direction_to_square(record.direction);
    const QuadLeaf quadrant = quad_leaf_at(directions(leaf), point);
    scratch.clear();
    if (settings_.box_directional_filter) {
        shares_of_square(directions(leaf), point, quadrant.size, scratch);
    } else {
        scratch.push_back({quadrant.quadrant, 1.0F});
    }
    for (const QuadShare& share : scratch) add_to_quadrant(leaf, share, std::min(value, largest_record));
}

void SdTree::add_to_quadrant(const Leaf& leaf, const QuadShare& share, double value) {
    sums_.add(4 * size_t{leaf.first_node} + share.quadrant, static_cast<double>(share.share) * value);
}

void SdTree::record_choice(const LightRecord& record, uint32_t leaf) {
    if (!(record.product_over_pdf > 0.0F)) return;
    choices_.add(choice_bins * size_t{leaf} + choice_bin(record.bsdf_share),
                 std::min(static_cast<double>(record.product_over_pdf), largest_record));
}

void SdTree::refine(uint32_t samples_per_pixel) {
    if (std::accumulate(counts_.begin(), counts_.end(), uint64_t{0}) == 0) return;
    collect_energies();
    split_leaves(settings_.split_count * std::sqrt(samples_per_pixel / 4.0));
    refine_directions();
    reset_training();
}

void SdTree::collect_energies() {
    for (uint32_t leaf = 0; leaf < leaves_.size(); ++leaf) {
        const size_t end = leaf + 1 < leaves_.size() ? leaves_[leaf + 1].first_node : nodes_.size();
        collect_energy(leaf, static_cast<uint32_t>(end));
        if (learns_fraction()) learn_fraction(leaf);
    }
}

// Children come after their parents, so from the last node on every sum that is needed is there.
void SdTree::collect_energy(uint32_t leaf, uint32_t end_node) {
    const uint32_t first = leaves_[leaf].first_node;
    std::vector<std::array<double, 4>> energies(end_node - first);
    for (size_t n = energies.size(); n-- > 0;) {
        for (size_t q = 0; q < 4; ++q) {
            const uint32_t child = nodes_[first + n].child[q];
            const auto& below = energies[child];
            energies[n][q] = child != 0 ? below[0] + below[1] + below[2] + below[3] : sums_.sum(4 * (first + n) + q);
        }
    }
    const double total = energies[0][0] + energies[0][1] + energies[0][2] + energies[0][3];
    leaves_[leaf].energy = total;
    for (size_t n = 0; n < energies.size(); ++n) {
        for (size_t q = 0; q < 4; ++q) {
            nodes_[first + n].energy[q] = total > 0.0 ? static_cast<float>(energies[n][q] / total) : 0.0F;
        }
    }
}

void SdTree::learn_fraction(uint32_t leaf) {
    std::array<double, choice_bins> weights;
    for (size_t i = 0; i < choice_bins; ++i) weights[i] = choices_.sum(choice_bins * leaf + i);
    leaves_[leaf].bsdf_fraction = learn_bsdf_fraction(weights, leaves_[leaf].bsdf_fraction);
}

// Halves are taken to have half of the records and of the energy each, and the same directions, until they are trained.
void SdTree::split_leaves(double most_records) {
    for (size_t n = 0; n < spatial_.size(); ++n) {
        while (spatial_[n].child == 0) {
            const uint32_t leaf = spatial_[n].leaf;
            if (!(static_cast<double>(counts_[leaf]) > most_records)) break;
            counts_[leaf] /= 2;
            leaves_[leaf].energy *= 0.5;
            counts_.push_back(counts_[leaf]);
            leaves_.push_back(Leaf(leaves_[leaf]));
            spatial_[n].child = static_cast<uint32_t>(spatial_.size());
            spatial_.push_back({0, leaf});
            spatial_.push_back({0, static_cast<uint32_t>(leaves_.size() - 1)});
        }
    }
}

void SdTree::refine_directions() {
    std::vector<QuadNode> refined;
    for (Leaf& leaf : leaves_) {
        const auto first = static_cast<uint32_t>(refined.size());
        append_refined(directions(leaf), settings_.directions, refined);
        leaf.first_node = first;
    }
    nodes_ = std::move(refined);
}

void SdTree::reset_training() {
    sums_ = ExactSums();
    sums_.resize(4 * nodes_.size());
    counts_.assign(leaves_.size(), 0);
    choices_ = ExactSums();
    if (learns_fraction()) choices_.resize(choice_bins * leaves_.size());
}

size_t SdTree::bytes() const {
    const size_t sums = sums_.digits().size() + choices_.digits().size() + counts_.size();
    return spatial_.size() * sizeof(SpatialNode) + leaves_.size() * sizeof(Leaf) + nodes_.size() * sizeof(QuadNode) +
           sums * sizeof(uint64_t);
}

double SdTree::total_energy() const {
    double sum = 0.0;
    for (const Leaf& leaf : leaves_) sum += leaf.energy;
    return sum;
}

double SdTree::mean_bsdf_fraction() const {
    double sum = 0.0, known = 0.0;
    for (const Leaf& leaf : leaves_) {
        if (leaf.energy == 0.0) continue;
        sum += static_cast<double>(leaf.bsdf_fraction);
        known += 1.0;
    }
    return known > 0.0 ? sum / known : 1.0;
}

void SdTree::save(ByteWriter& writer) const {
    writer.array(spatial_);
    writer.array(leaves_);
    writer.array(nodes_);
    writer.array(sums_.digits());
    writer.array(counts_);
    writer.array(choices_.digits());
}

void SdTree::load(ByteReader& reader) {
    reader.array(spatial_);
    reader.array(leaves_);
    reader.array(nodes_);
    reader.array(sums_.digits());
    reader.array(counts_);
    reader.array(choices_.digits());
}

}  // namespace nephroid

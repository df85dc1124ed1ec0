// What is known of the light that arrives in a scene: a binary tree over space with a quadtree over directions in each
// leaf (Mueller et al., "Practical Path Guiding for Efficient Light-Transport Simulation", 2017).
//
// While a pass runs, the tree guides and is trained at once: guiding reads the energies of the last refinement,
// training adds to sums beside them. These are integers, added atomically: no thread waits, and the result does not
// depend on the order. Between passes `refine` turns the sums into energies and divides what has got too much.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/byte_stream.h"
#include "core/exact_sums.h"
#include "core/scene.h"
#include "guiding/quad_tree.h"

namespace nephroid {

struct SdTreeSettings {
    double split_count = 4000.0;             ///< c: see SdTree::refine.
    bool stochastic_spatial_filter = false;  ///< Records go to a random point of a box as large as their cell.
    bool box_directional_filter = false;     ///< Records are spread over a square as large as their leaf.
    std::optional<float> bsdf_fraction;      ///< Of all leaves; none: learned, from 1/2 on.
    QuadRefinement directions;
};

/// Light that a path found to arrive at a point.
struct LightRecord {
    Vec3 position{0.0F};
    Vec3 direction{0.0F};   ///< Unit, away from the point.
    float radiance = 0.0F;  ///< Mean of the channels.
    float pdf = 0.0F;       ///< Density that the direction was sampled with, per solid angle; 0: it has none (mirrors).
    /// Where guide and BSDF competed: learned_fraction.h's r; below zero elsewhere.
    float bsdf_share = -1.0F;
    float product_over_pdf = 0.0F;  ///< The same: f L cos over the density of the mixture.
};

struct GuidedDirection {
    Vec3 direction;
    float pdf;  ///< Per solid angle.
};

class SdTree {
  public:
    /// A leaf of the spatial tree.
    struct Leaf {
        uint32_t first_node = 0;  ///< Of its quadtree.
        float bsdf_fraction = 0.5F;
        double energy = 0.0;  ///< Sum of radiance / pdf; the quadtree holds shares of it. 0: nothing is known.
    };

    SdTree(const Bounds& bounds, const SdTreeSettings& settings);

    uint32_t leaf_at(const Vec3& position) const { return find_cell(position).leaf; }
    const Leaf& leaf(uint32_t index) const { return leaves_[index]; }
    const QuadNode* directions(const Leaf& leaf) const { return &nodes_[leaf.first_node]; }
    /// Density of the leaf's quadtree per solid angle; direction unit. The leaf must have energy.
    float pdf(const Leaf& leaf, const Vec3& direction) const;
    GuidedDirection sample(const Leaf& leaf, Vec2 u) const;

    /// Thread-safe, without locks. `scratch` is the caller's, to be kept from call to call.
    void record(const LightRecord& record, std::vector<QuadShare>& scratch);
    bool learns_fraction() const { return !settings_.bsdf_fraction.has_value(); }

    /// Energies become what was recorded since the last time; leaves with more than
    /// split_count * sqrt(samples_per_pixel / 4) records are halved (2017, where samples_per_pixel is
    /// 2^k * 4), quadtrees refined. Nothing happens where nothing was recorded.
    void refine(uint32_t samples_per_pixel);

    size_t leaf_count() const { return leaves_.size(); }
    size_t direction_node_count() const { return nodes_.size(); }
    size_t bytes() const;
    /// Of all leaves.
    double total_energy() const;
    /// Of the leaves that know something.
    double mean_bsdf_fraction() const;

    /// Everything, for checkpoints.
    void save(ByteWriter& writer) const;
    void load(ByteReader& reader);

  private:
    struct SpatialNode {
        uint32_t child = 0;  ///< The first of two, one after the other; 0: a leaf.
        uint32_t leaf = 0;
    };
    struct Cell {
        uint32_t leaf;
        int depth;  ///< Level d halves the axis d modulo 3.
    };

    Cell find_cell(const Vec3& position) const;
    void record_choice(const LightRecord& record, uint32_t leaf);
    Vec3 jittered(const LightRecord& record, int depth) const;
    void add_to_quadrant(const Leaf& leaf, const QuadShare& share, double value);
    void collect_energies();
    void collect_energy(uint32_t leaf, uint32_t end_node);
    void learn_fraction(uint32_t leaf);
    void split_leaves(double most_records);
    void refine_directions();
    void reset_training();

    SdTreeSettings settings_;
    Vec3 origin_{0.0F};
    float size_ = 1.0F;  ///< Edge of the cube that the root covers.
    std::vector<SpatialNode> spatial_{1};
    std::vector<Leaf> leaves_{1};
    std::vector<QuadNode> nodes_;

    // Training.
    ExactSums sums_;                ///< Radiance / pdf by quadrant; what has children gets nothing.
    std::vector<uint64_t> counts_;  ///< Records by leaf.
    ExactSums choices_;             ///< By leaf and choice_bin.
};

}  // namespace nephroid

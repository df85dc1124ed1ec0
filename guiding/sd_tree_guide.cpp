#include "guiding/sd_tree_guide.h"

#include "core/bsdf.h"

namespace nephroid {

namespace {

class SdTreeWorker final : public GuideWorker {
  public:
    explicit SdTreeWorker(const SdTree& tree) : tree_(tree) {}

    void guide(const GuidePoints& points, GuideBatch& batch) override {
        for (size_t k = 0; k < batch.count; ++k) {
            batch.guided[k] = 0.0F;
            if (batch.fraction[k] == 0.0F) continue;
            const uint32_t place = tree_.leaf_at(points.position.get(k));
            const SdTree::Leaf& leaf = tree_.leaf(place);
            batch.place[k] = place;
            batch.fraction[k] = leaf.energy > 0.0 ? 1.0F - leaf.bsdf_fraction : 0.0F;
            if (batch.fraction[k] > 0.0F) choose_direction(leaf, points, batch, k);
        }
    }

  private:
    void choose_direction(const SdTree::Leaf& leaf, const GuidePoints& points, GuideBatch& batch, size_t k) const {
        if (batch.u_choice[k] < batch.fraction[k]) {
            const GuidedDirection sample = tree_.sample(leaf, {batch.u[k], batch.v[k]});
            batch.direction.set(k, sample.direction);
            batch.pdf[k] = sample.pdf;
            batch.guided[k] = 1.0F;
        } else {
            batch.pdf[k] = tree_.pdf(leaf, batch.direction.get(k));
        }
        if (batch.wants_light_pdf) batch.light_pdf[k] = light_pdf(leaf, points, k);
    }

    /// What comes from below the surface lights nothing: its density does not matter.
    float light_pdf(const SdTree::Leaf& leaf, const GuidePoints& points, size_t k) const {
        const Vec3 direction = points.light_direction.get(k);
        return glm::dot(direction, points.geometric_normal.get(k)) > 0.0F ? tree_.pdf(leaf, direction) : 0.0F;
    }

    const SdTree& tree_;
};

}  // namespace

std::unique_ptr<GuideWorker> SdTreeGuide::make_worker() const {
    return std::make_unique<SdTreeWorker>(tree_);
}

float SdTreeGuide::least_alpha() const {
    return delta_alpha;
}

}  // namespace nephroid

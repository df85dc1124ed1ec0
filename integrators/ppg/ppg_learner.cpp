#include "integrators/ppg/ppg_learner.h"

#include <bit>

#include "integrators/stopwatch.h"

namespace nephroid {

PpgLearner::PpgLearner(const Bounds& bounds, const PpgSettings& settings)
    : tree_(bounds, settings.tree), guide_(tree_), earlier_samples_(settings.earlier_samples) {}

std::optional<uint32_t> PpgLearner::next_lesson(uint32_t samples) const {
    constexpr uint32_t last = 1U << 30;
    if (samples >= last) return std::nullopt;
    return std::bit_ceil(samples + 1);
}

void PpgLearner::learn(uint32_t samples) {
    Stopwatch stopwatch;
    tree_.refine(samples);
    ++lessons_;
    seconds_refine_ += stopwatch.lap();
}

std::vector<uint8_t> PpgLearner::state() const {
    ByteWriter writer;
    writer.value(lessons_);
    tree_.save(writer);
    return writer.take();
}

void PpgLearner::restore(const std::vector<uint8_t>& state) {
    ByteReader reader(state);
    lessons_ = reader.value<uint64_t>();
    tree_.load(reader);
}

IntegratorStatistics PpgLearner::statistics() const {
    return {"ppg",
            {{"lessons", lessons_},
             {"spatial_leaves", tree_.leaf_count()},
             {"direction_nodes", tree_.direction_node_count()},
             {"bytes", tree_.bytes()}},
            {{"mean_bsdf_fraction", tree_.mean_bsdf_fraction()}, {"seconds_refine", seconds_refine_}}};
}

}  // namespace nephroid

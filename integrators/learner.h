// Integrators that learn from their own samples while they render: what the driver asks of them between passes.
//
// Samples are numbered through, whatever is learned between them: a sample depends on its pixel, its index, the seed
// and on what had been learned when it was traced. Lessons take place at sample counts, not at times, so that a render
// to a number of samples gives the same bits wherever its passes end; with a time limit, how many lessons there are
// depends on the clock.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace nephroid {

/// What becomes of the samples before a lesson.
enum class EarlierSamples : uint8_t {
    kept,       ///< They count like those after it.
    discarded,  ///< The picture is made of those after the last lesson, once there are as many as before it.
    combined,   ///< The last iterations' pictures are weighted by the inverse of their variance.
};

class Learner {
  public:
    virtual ~Learner() = default;
    /// Sample count of every pixel, above `samples`, at which there is something to learn; the end of a block
    /// (samples_in_block). None: never again.
    virtual std::optional<uint32_t> next_lesson(uint32_t samples) const = 0;
    /// Before the first pass and after each lesson: whether another lesson will follow within the render's limits.
    /// Otherwise no pass has to be learned from any more.
    virtual void expect_lesson(bool expected) { recording_ = expected; }
    /// Whether the next pass is to be learned from.
    bool recording() const { return recording_; }
    /// While nobody traces. Every pixel has `samples` samples since the last lesson.
    virtual void learn(uint32_t samples) = 0;
    virtual EarlierSamples earlier_samples() const = 0;

    /// All that has been learned and gathered, for checkpoints.
    virtual std::vector<uint8_t> state() const = 0;
    /// From what `state` gave, with the same scene and settings; what a time limit had made otherwise is learned anew.
    virtual void restore(const std::vector<uint8_t>& state) = 0;

  private:
    bool recording_ = true;
};

/// Two that learn at the same lessons and keep earlier samples, as one.
class LearnerPair final : public Learner {
  public:
    /// Keeps references.
    LearnerPair(Learner& first, Learner& second) : first_(first), second_(second) {}
    std::optional<uint32_t> next_lesson(uint32_t samples) const override { return first_.next_lesson(samples); }
    void expect_lesson(bool expected) override;
    void learn(uint32_t samples) override;
    EarlierSamples earlier_samples() const override { return EarlierSamples::kept; }
    std::vector<uint8_t> state() const override;
    void restore(const std::vector<uint8_t>& state) override;

  private:
    Learner& first_;
    Learner& second_;
};

}  // namespace nephroid

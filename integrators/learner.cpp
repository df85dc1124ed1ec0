#include "integrators/learner.h"

#include "core/byte_stream.h"

namespace nephroid {

void LearnerPair::expect_lesson(bool expected) {
    Learner::expect_lesson(expected);
    first_.expect_lesson(expected);
    second_.expect_lesson(expected);
}

void LearnerPair::learn(uint32_t samples) {
    first_.learn(samples);
    second_.learn(samples);
}

std::vector<uint8_t> LearnerPair::state() const {
    ByteWriter writer;
    writer.array(first_.state());
    writer.array(second_.state());
    return writer.take();
}

void LearnerPair::restore(const std::vector<uint8_t>& state) {
    ByteReader reader(state);
    std::vector<uint8_t> part;
    reader.array(part);
    first_.restore(part);
    reader.array(part);
    second_.restore(part);
}

}  // namespace nephroid

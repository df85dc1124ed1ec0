#include "integrators/guided/fraction_recorder.h"

namespace nephroid {

void FractionRecorder::scattered(const ScatteredPaths& scattered, const SampleBuffer& samples) {
    if (scattered.directions == nullptr) return;
    const GuideBatch& directions = *scattered.directions;
    const PathWave& paths = scattered.paths;
    for (size_t i = 0; i < paths.rays.count; ++i) {
        const size_t vertex = scattered.vertex[i];
        const float fraction = directions.fraction[vertex];
        if (fraction == 0.0F || directions.place[vertex] == GuideBatch::no_place) continue;
        // A mirror direction is the BSDF's, whose density is as good as infinite.
        float density = 1.0F - fraction;
        uint32_t bin = 0;
        if (paths.pdf[i] > 0.0F) {
            const float pdf = paths.pdf[i], guide_pdf = directions.pdf[vertex];
            const float bsdf_pdf = bsdf_pdf_within(pdf, fraction, guide_pdf);
            density = pdf / (guide_pdf + bsdf_pdf);
            bin = static_cast<uint32_t>(odds_bin(guide_pdf, bsdf_pdf));
        }
        const uint32_t slot = paths.slot[i];
        choices_.push_back({slot, directions.place[vertex], bin, density, luminance(samples.radiance_of(slot))});
    }
}

void FractionRecorder::finished(const SampleBuffer& samples) {
    for (const Choice& choice : choices_) {
        const float found = luminance(samples.radiance_of(choice.slot)) - choice.reached;
        if (found > 0.0F) learner_.record(choice.point, choice.bin, found * found * choice.density);
    }
    choices_.clear();
}

}  // namespace nephroid

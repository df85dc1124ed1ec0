#include "integrators/ppg/path_recorder.h"

#include <algorithm>

namespace nephroid {

namespace {

/// r = b / (b + g) of the densities of BSDF and guide, from the density of both together; below 0: the guide had no
/// say.
float bsdf_share_of(float pdf, const GuideBatch* directions, size_t vertex) {
    if (directions == nullptr || directions->fraction[vertex] == 0.0F) return -1.0F;
    if (pdf == 0.0F) return 1.0F;
    const float guide_pdf = directions->pdf[vertex];
    const float bsdf_pdf = bsdf_pdf_within(pdf, directions->fraction[vertex], guide_pdf);
    const float sum = bsdf_pdf + guide_pdf;
    return sum > 0.0F ? bsdf_pdf / sum : -1.0F;
}

/// Mean of the channels of a / b, of those where b is not zero.
float mean_ratio(const Rgb& a, const Rgb& b) {
    float sum = 0.0F;
    for (int c = 0; c < 3; ++c) sum += b[c] > 0.0F ? std::max(a[c], 0.0F) / b[c] : 0.0F;
    return sum * (1.0F / 3.0F);
}

}  // namespace

void PathRecorder::scattered(const ScatteredPaths& scattered, const SampleBuffer& samples) {
    const PathWave& paths = scattered.paths;
    for (size_t i = 0; i < paths.rays.count; ++i) {
        const size_t vertex = scattered.vertex[i];
        const float pdf = paths.pdf[i];
        const float bsdf_share = tree_.learns_fraction() ? bsdf_share_of(pdf, scattered.directions, vertex) : -1.0F;
        if (pdf == 0.0F && bsdf_share < 0.0F) continue;
        const uint32_t slot = paths.slot[i];
        vertices_.push_back({scattered.vertices.position.get(vertex), paths.rays.direction(i), paths.throughput.get(i),
                             scattered.vertices.throughput.get(vertex), samples.radiance_of(slot), pdf, bsdf_share,
                             slot});
    }
}

void PathRecorder::finished(const SampleBuffer& samples) {
    for (const Vertex& vertex : vertices_) record(vertex, samples.radiance_of(vertex.slot) - vertex.reached);
    vertices_.clear();
}

void PathRecorder::record(const Vertex& vertex, const Rgb& gathered) {
    tree_.record({vertex.position, vertex.direction, mean_ratio(gathered, vertex.throughput), vertex.pdf,
                  vertex.bsdf_share, mean_ratio(gathered, vertex.throughput_before)},
                 quadrants_);
}

}  // namespace nephroid

// Sample points: stratification, scrambling, equality of scalar and vector code.
#include <doctest/doctest.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "core/sampler.h"
#include "tests/statistics.h"

using namespace nephroid;

TEST_CASE("every power-of-two run of the Sobol pairs is a (0,2)-net") {
    for (const uint32_t seed : {1U, 77U, 0xdeadbeefU}) {
        for (const uint32_t dimension : {0U, 5U}) {
            for (uint32_t bits = 1; bits <= 8; ++bits) {
                const uint32_t n = 1U << bits;
                for (const uint32_t first : {0U, n, 6 * n}) {
                    for (uint32_t x_bits = 0; x_bits <= bits; ++x_bits) {
                        std::set<uint32_t> cells;
                        for (uint32_t i = first; i < first + n; ++i) {
                            const auto [x, y] = sample_2d(SamplerKind::sobol, seed, i, dimension);
                            const auto column = static_cast<uint32_t>(x * static_cast<float>(1U << x_bits));
                            const auto row = static_cast<uint32_t>(y * static_cast<float>(1U << (bits - x_bits)));
                            cells.insert(column << 16 | row);
                        }
                        CHECK(cells.size() == n);
                    }
                }
            }
        }
    }
}

TEST_CASE("every power-of-two run of the Sobol triples is a (1,3)-net whose pairs are samples in two dimensions") {
    for (const uint32_t seed : {1U, 0xdeadbeefU}) {
        for (uint32_t bits = 1; bits <= 8; ++bits) {
            const uint32_t n = 1U << bits;
            for (uint32_t x_bits = 0; x_bits < bits; ++x_bits) {
                for (uint32_t y_bits = 0; x_bits + y_bits < bits; ++y_bits) {
                    std::map<uint32_t, uint32_t> cells;
                    for (uint32_t i = 5 * n; i < 6 * n; ++i) {
                        const auto [x, y, z] = sample_3d(SamplerKind::sobol, seed, i, 3);
                        const auto cell = [](float value, uint32_t cell_bits) {
                            return static_cast<uint32_t>(value * static_cast<float>(1U << cell_bits));
                        };
                        ++cells[cell(x, x_bits) << 20 | cell(y, y_bits) << 10 | cell(z, bits - 1 - x_bits - y_bits)];
                        CHECK(std::pair(x, y) == sample_2d(SamplerKind::sobol, seed, i, 3));
                    }
                    for (const auto& [cell, count] : cells) CHECK(count == 2);
                }
            }
        }
    }
}

TEST_CASE("one-dimensional samples are stratified") {
    for (uint32_t bits = 1; bits <= 10; ++bits) {
        const uint32_t n = 1U << bits;
        std::set<uint32_t> cells;
        for (uint32_t i = 0; i < n; ++i) {
            cells.insert(static_cast<uint32_t>(sample_1d(SamplerKind::sobol, 42U, i, 3) * static_cast<float>(n)));
        }
        CHECK(cells.size() == n);
    }
}

TEST_CASE("vector and scalar samples are the same bits") {
    alignas(simd_alignment) uint32_t seeds[simd_width];
    alignas(simd_alignment) uint32_t indices[simd_width];
    for (uint32_t i = 0; i < simd_width; ++i) {
        seeds[i] = pixel_seed(i, 3 * i, 9);
        indices[i] = 1000 * i + 17;
    }
    for (const SamplerKind kind : {SamplerKind::sobol, SamplerKind::independent}) {
        const auto [x, y] =
            sample_2d(kind, UintV(seeds, stdx::vector_aligned), UintV(indices, stdx::vector_aligned), 4);
        const auto triple =
            sample_3d(kind, UintV(seeds, stdx::vector_aligned), UintV(indices, stdx::vector_aligned), 4);
        for (size_t i = 0; i < simd_width; ++i) {
            const auto [sx, sy] = sample_2d(kind, seeds[i], indices[i], 4);
            CHECK(static_cast<float>(x[i]) == sx);
            CHECK(static_cast<float>(y[i]) == sy);
            const std::array<float, 3> scalar = sample_3d(kind, seeds[i], indices[i], 4);
            for (size_t axis = 0; axis < 3; ++axis) CHECK(static_cast<float>(triple[axis][i]) == scalar[axis]);
        }
    }
}

TEST_CASE("pixels, dimensions and samples are uncorrelated") {
    // Pearson correlation of n independent pairs is N(0, 1/n).
    constexpr int n = 100000;
    for (const SamplerKind kind : {SamplerKind::sobol, SamplerKind::independent}) {
        double across_pixels = 0.0, across_dimensions = 0.0, across_axes = 0.0;
        for (uint32_t i = 0; i < n; ++i) {
            const uint32_t seed = pixel_seed(i % 317, i / 317, 1);
            const uint32_t neighbour = pixel_seed(i % 317 + 1, i / 317, 1);
            const auto a = sample_2d(kind, seed, 0U, 0);
            across_pixels += (a.first - 0.5) * (sample_2d(kind, neighbour, 0U, 0).first - 0.5);
            across_dimensions += (a.first - 0.5) * (sample_2d(kind, seed, 0U, 1).first - 0.5);
            across_axes += (a.first - 0.5) * (a.second - 0.5);
        }
        for (const double sum : {across_pixels, across_dimensions, across_axes}) {
            CHECK(std::abs(sum * 12.0 / std::sqrt(double{n})) < 4.5);
        }
    }
}

TEST_CASE("independent samples are uniform") {
    constexpr int n = 200000;
    constexpr int cells = 32;
    std::vector<double> counts(cells * cells, 0.0);
    for (uint32_t i = 0; i < n; ++i) {
        const auto [x, y] = sample_2d(SamplerKind::independent, 5U, i, 2);
        counts[static_cast<size_t>(x * cells) * cells + static_cast<size_t>(y * cells)] += 1.0;
    }
    const double expected = double{n} / (cells * cells);
    double chi2 = 0.0;
    for (const double c : counts) chi2 += (c - expected) * (c - expected) / expected;
    CHECK(testing::chi_square_tail(chi2, cells * cells - 1) > 1e-4);
}

TEST_CASE("samples stay inside [0, 1)") {
    CHECK(unit_float(0xffffffffU) < 1.0F);
    CHECK(unit_float(0U) == 0.0F);
}

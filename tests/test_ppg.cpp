// Practical path guiding: quadtrees, the SD-tree, the learned fraction, and whole renders against the path tracer.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "guiding/cylindrical_map.h"
#include "guiding/learned_fraction.h"
#include "integrators/driver.h"
#include "integrators/iteration_films.h"
#include "integrators/path/path_integrator.h"
#include "integrators/ppg/ppg_integrator.h"
#include "tests/statistics.h"
#include "tests/test_scenes.h"

using namespace nephroid;

namespace {

Vec2 random_2d(uint32_t index, uint32_t dimension) {
    const auto [x, y] = sample_2d(SamplerKind::independent, 99U, index, dimension);
    return {x, y};
}

/// A tree trained with light from a small spot and a faint rest, for `lessons` passes.
SdTree trained_tree(const SdTreeSettings& settings, int lessons, int records = 20000) {
    SdTree tree({Vec3(-1.0F), Vec3(1.0F, 2.0F, 3.0F)}, settings);
    std::vector<QuadShare> scratch;
    const Vec3 spot = glm::normalize(Vec3(0.3F, -0.8F, 0.4F));
    for (int lesson = 0; lesson < lessons; ++lesson) {
        for (int i = 0; i < records; ++i) {
            const auto index = static_cast<uint32_t>(lesson * records + i);
            const Vec2 xy = random_2d(index, 0), z = random_2d(index, 1);
            const Vec3 direction = square_to_direction(random_2d(index, 2));
            const float radiance = glm::dot(direction, spot) > 0.98F ? 200.0F : 0.1F + std::max(direction.z, 0.0F);
            tree.record({{2.0F * xy.x - 1.0F, 3.0F * xy.y - 1.0F, 4.0F * z.x * z.x - 1.0F},
                         direction,
                         radiance,
                         0.25F * inv_pi},
                        scratch);
        }
        tree.refine(4);
    }
    return tree;
}

SdTreeSettings fine_settings(bool filters) {
    SdTreeSettings settings;
    settings.split_count = 1500.0;
    settings.stochastic_spatial_filter = filters;
    settings.box_directional_filter = filters;
    return settings;
}

/// A box with a lamp that faces its ceiling, and a glossy ball: all light is indirect, but on the ceiling.
Scene upward_lamp() {
    Scene scene;
    scene.materials = {testing::lambert(Rgb(0.7F, 0.6F, 0.5F)), testing::metal(Rgb(0.9F, 0.8F, 0.7F), 0.2F),
                       testing::emitter(Rgb(20.0F, 18.0F, 15.0F)), Material()};
    scene.materials[3].base_color = Vec4(0.2F, 0.5F, 0.8F, 1.0F);
    scene.materials[3].metallic = 0.0F;
    scene.materials[3].roughness = 0.0F;
    using testing::quad;
    for (const Mesh& wall : {quad({-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, 0), quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 0),
                             quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, 0), quad({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, 0),
                             quad({-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, 0), quad({1, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0)}) {
        testing::add_mesh(scene, wall);
    }
    testing::add_mesh(scene, quad({-0.9F, 0.7F, -0.9F}, {0, 0, 0.3F}, {0.3F, 0, 0}, 2));
    testing::add_mesh(scene, testing::sphere({-0.4F, -0.6F, -0.3F}, 0.4F, 16, 1));
    testing::add_mesh(scene, testing::sphere({0.45F, -0.65F, 0.1F}, 0.35F, 16, 3));
    return scene;
}

constexpr int size = 32;

struct Run {
    uint32_t spp = 256;
    int threads = 2;
    std::string checkpoint = {};
};

RenderResult render_to(Film& film, const Integrator& integrator, const Run& run) {
    DriverSettings settings;
    settings.spp = run.spp;
    settings.threads = run.threads;
    settings.process_start = std::chrono::steady_clock::now();
    settings.checkpoint = run.checkpoint;
    settings.resume = !run.checkpoint.empty();
    Progress progress(Verbosity::quiet);
    return run_render(integrator, film, settings, progress);
}

Film new_film() {
    AovSelection aovs;
    aovs.variance = true;
    return {size, size, {0, 0, size, size}, aovs, true};
}

struct World {
    World() : scene(upward_lamp()), prepared(scene, testing::look_at({0, 0, 0.95F}, {0, -0.2F, 0}, 1.4F), size, size) {
        prepared.context.max_depth = 6;
        prepared.context.sampler = SamplerKind::independent;
    }
    Scene scene;
    testing::PreparedScene prepared;
};

PpgSettings scaled(PpgSettings settings) {
    settings.tree.split_count *= 0.1;  // For so small a picture.
    return settings;
}

double mean_of(const std::vector<float>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

TEST_CASE("cylindrical map: back and forth") {
    for (uint32_t i = 0; i < 1000; ++i) {
        const Vec2 p = random_2d(i, 7);
        const Vec2 again = direction_to_square(square_to_direction(p));
        INFO(p.x, " ", p.y);
        CHECK(again.x == doctest::Approx(p.x).epsilon(1e-5));
        CHECK(again.y == doctest::Approx(p.y).epsilon(1e-4));
    }
}

TEST_CASE("SD-tree: samples follow the density (chi-square)") {
    for (const bool filters : {false, true}) {
        const SdTree tree = trained_tree(fine_settings(filters), 3);
        CHECK(tree.leaf_count() > 8);
        CHECK(tree.direction_node_count() > 10 * tree.leaf_count());
        constexpr int cells = 32, draws = 200000;
        for (const Vec3& position : {Vec3(0.0F), Vec3(-0.9F, 1.9F, 2.9F), Vec3(0.2F, 1.5F, -7.0F)}) {
            const SdTree::Leaf& leaf = tree.leaf(tree.leaf_at(position));
            REQUIRE(leaf.energy > 0.0);
            std::vector<double> observed(cells * cells), expected(cells * cells);
            double integral = 0.0;
            // Each cell by 16 x 16 points: finer than most leaves of the quadtree, which end at powers of two.
            for (int i = 0; i < cells * 16; ++i) {
                for (int j = 0; j < cells * 16; ++j) {
                    const Vec2 p((static_cast<float>(i) + 0.5F) / (cells * 16),
                                 (static_cast<float>(j) + 0.5F) / (cells * 16));
                    const double mass =
                        static_cast<double>(quad_tree_density(tree.directions(leaf), p)) / (256.0 * cells * cells);
                    expected[static_cast<size_t>(i / 16 * cells + j / 16)] += mass * draws;
                    integral += mass;
                }
            }
            CHECK(integral == doctest::Approx(1.0).epsilon(1e-4));
            double worst_pdf = 0.0;
            for (uint32_t i = 0; i < draws; ++i) {
                const GuidedDirection drawn = tree.sample(leaf, random_2d(i, 11));
                const Vec2 p = direction_to_square(drawn.direction);
                observed[static_cast<size_t>(p.x * cells) * cells + static_cast<size_t>(p.y * cells)] += 1.0;
                const double pdf = tree.pdf(leaf, drawn.direction);
                worst_pdf += std::abs(pdf - static_cast<double>(drawn.pdf)) > 1e-3 * pdf ? 1.0 : 0.0;
            }
            // But for directions that rounding moves across an edge.
            CHECK(worst_pdf < 1e-3 * draws);
            double chi2 = 0.0, pooled_expected = 0.0, pooled_observed = 0.0;
            int used = 0;
            for (size_t i = 0; i < observed.size(); ++i) {
                if (expected[i] < 10.0) {
                    pooled_expected += expected[i];
                    pooled_observed += observed[i];
                    continue;
                }
                chi2 += std::pow(observed[i] - expected[i], 2.0) / expected[i];
                ++used;
            }
            if (pooled_expected >= 10.0) chi2 += std::pow(pooled_observed - pooled_expected, 2.0) / pooled_expected;
            INFO("filters ", filters, " cells ", used, " chi2 ", chi2);
            CHECK(testing::chi_square_tail(chi2, used) > testing::sidak(0.001, 6));
        }
    }
}

TEST_CASE("SD-tree: dividing keeps all energy and every density") {
    SdTreeSettings coarse = fine_settings(false);
    const SdTree tree = trained_tree(coarse, 3);
    // What was recorded is what the leaves hold, whatever they were divided into.
    std::vector<QuadShare> scratch;
    SdTree other = tree;
    double recorded = 0.0;
    for (uint32_t i = 0; i < 50000; ++i) {
        const Vec2 xy = random_2d(i, 20);
        other.record({{2.0F * xy.x - 1.0F, xy.y, 0.5F}, square_to_direction(random_2d(i, 21)), 2.0F + xy.x, 0.3F},
                     scratch);
        recorded += static_cast<double>(2.0F + xy.x) / static_cast<double>(0.3F);
    }
    const size_t leaves_before = other.leaf_count();
    other.refine(1);
    CHECK(other.leaf_count() > leaves_before);
    CHECK(other.total_energy() == doctest::Approx(recorded).epsilon(1e-9));

    // Quadtrees: finer thresholds divide without changing what is sampled.
    const QuadNode* directions = tree.directions(tree.leaf(0));
    std::vector<QuadNode> finer;
    append_refined(directions, {1e-5, 20}, finer);
    CHECK(total_energy(finer.data()) == total_energy(directions));
    for (uint32_t i = 0; i < 2000; ++i) {
        const Vec2 p = random_2d(i, 22);
        CHECK(quad_tree_density(finer.data(), p) == doctest::Approx(quad_tree_density(directions, p)).epsilon(1e-5));
    }
    // Coarser ones merge and keep the sum.
    std::vector<QuadNode> coarser;
    append_refined(directions, {0.2, 20}, coarser);
    CHECK(coarser.size() < finer.size());
    CHECK(total_energy(coarser.data()) == total_energy(directions));
    // No level beyond the limit.
    std::vector<QuadNode> flat;
    append_refined(directions, {1e-5, 1}, flat);
    CHECK(flat.size() == 1);
}

TEST_CASE("quadtree: the shares of a square add up to one, at the ends too") {
    const SdTree tree = trained_tree(fine_settings(true), 2);
    const QuadNode* directions = tree.directions(tree.leaf(0));
    std::vector<QuadShare> shares;
    for (uint32_t i = 0; i < 5000; ++i) {
        Vec2 p = random_2d(i, 30);
        if (i % 5 == 0) p = glm::round(p) * 0.999999F;
        const float edge = std::ldexp(1.0F, -1 - static_cast<int>(i % 9));
        shares.clear();
        shares_of_square(directions, p, edge, shares);
        double sum = 0.0;
        for (const QuadShare& share : shares) sum += static_cast<double>(share.share);
        INFO(p.x, " ", p.y, " edge ", edge);
        CHECK(sum == doctest::Approx(1.0).epsilon(1e-3));
    }
}

TEST_CASE("SD-tree: saved and loaded, in the middle of training") {
    SdTree tree = trained_tree(fine_settings(true), 2);
    std::vector<QuadShare> scratch;
    const auto record = [&scratch](SdTree& to, uint32_t i) {
        to.record({Vec3(0.1F), square_to_direction(random_2d(i, 40)), 1.0F, 0.1F, 0.3F, 1.0F}, scratch);
    };
    for (uint32_t i = 0; i < 1000; ++i) record(tree, i);
    ByteWriter writer;
    tree.save(writer);
    const std::vector<uint8_t> bytes = writer.take();
    SdTree loaded({Vec3(-1.0F), Vec3(1.0F, 2.0F, 3.0F)}, fine_settings(true));
    ByteReader reader(bytes);
    loaded.load(reader);
    for (SdTree* t : {&tree, &loaded}) {
        record(*t, 5000);
        t->refine(2);
    }
    ByteWriter first, second;
    tree.save(first);
    loaded.save(second);
    CHECK(first.take() == second.take());
}

TEST_CASE("learned fraction: the minimum of the divergence") {
    std::array<double, choice_bins> weights{};
    CHECK(learn_bsdf_fraction(weights, 0.3F) == 0.3F);
    // All light where the guide's density is higher, then the BSDF's: the limits.
    weights[0] = 7.0;
    CHECK(learn_bsdf_fraction(weights, 0.5F) == doctest::Approx(least_choice_probability).epsilon(0.02));
    weights[0] = 0.0;
    weights[choice_bins - 1] = 1e-6;
    CHECK(learn_bsdf_fraction(weights, 0.5F) == doctest::Approx(1.0F - least_choice_probability).epsilon(0.02));
    // Between: against a search, with the regularisation.
    weights[0] = 1.0;
    weights[choice_bins - 1] = 2.0;
    weights[6] = 4.0;
    double best = 1e9, best_fraction = 0.0;
    for (double x = -2.9; x < 2.9; x += 1e-3) {
        const double a = 1.0 / (1.0 + std::exp(-x));
        double loss = 0.005 * x * x;
        for (size_t i = 0; i < choice_bins; ++i) {
            const double r = (static_cast<double>(i) + 0.5) / choice_bins;
            const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
            loss -= weights[i] / total * std::log(a * r + (1.0 - a) * (1.0 - r));
        }
        if (loss < best) best = loss, best_fraction = a;
    }
    CHECK(learn_bsdf_fraction(weights, 0.5F) == doctest::Approx(best_fraction).epsilon(0.02));
}

TEST_CASE("ppg: discarding passes agrees with path, block by block") {
    World world;
    PpgSettings settings = scaled(ppg_settings_2017());
    SUBCASE("as in 2017") {}
    SUBCASE("with the filters and the learned fraction of 2019") {
        settings = scaled(ppg_settings_2019());
        settings.earlier_samples = EarlierSamples::discarded;
    }
    const PpgIntegrator ppg(world.prepared.context, settings);
    Film ours = new_film(), theirs = new_film();
    const RenderResult result = render_to(ours, ppg, {.spp = 512});
    CHECK(result.passes.back().spp == 512.0);
    CHECK(ours.min_spp() == 256);
    CHECK(ours.nonfinite_samples() == 0);
    CHECK(ppg.tree().leaf_count() > 20);
    world.prepared.context.seed = 1;
    render_to(theirs, PathIntegrator(world.prepared.context), {.spp = 512});
    const std::vector<float> a = ours.beauty(), b = theirs.beauty(), va = ours.variance(), vb = theirs.variance();
    constexpr int blocks = size / 8;
    const double limit = testing::critical_z(testing::sidak(0.001, 2 * blocks * blocks));
    for (int block = 0; block < blocks * blocks; ++block) {
        double difference = 0.0, variance = 0.0;
        for (int i = 0; i < 64; ++i) {
            const int x = block % blocks * 8 + i % 8, y = block / blocks * 8 + i / 8;
            const size_t at = static_cast<size_t>(y * size + x) * 3 + 1;
            difference += static_cast<double>(a[at]) - static_cast<double>(b[at]);
            variance += static_cast<double>(va[at]) + static_cast<double>(vb[at]);
        }
        const double z = difference / std::sqrt(variance);
        INFO("block ", block, " z ", z);
        CHECK(std::abs(z) < limit);
    }
    // It pays: the indirect light has less variance.
    const double gain = theirs.sample_variance() / ours.sample_variance();
    MESSAGE("variance of a sample, path over ppg: " << gain);
    CHECK(gain > 1.0);
}

TEST_CASE("ppg: combining passes is nearly unbiased") {
    World world;
    world.prepared.context.seed = 7;
    Film reference = new_film();
    render_to(reference, PathIntegrator(world.prepared.context), {.spp = 2048});
    const double expected = mean_of(reference.beauty());
    // 48 pictures of 32 samples: the bias, if any, is the mean's deviation.
    double sum = 0.0, squares = 0.0;
    constexpr int pictures = 48;
    for (uint32_t seed = 0; seed < pictures; ++seed) {
        world.prepared.context.seed = 100 + seed;
        Film film = new_film();
        render_to(film, PpgIntegrator(world.prepared.context, scaled(ppg_settings_2019())), {.spp = 32});
        const double relative = mean_of(film.beauty()) / expected - 1.0;
        sum += relative;
        squares += relative * relative;
    }
    const double bias = sum / pictures;
    const double deviation = std::sqrt((squares / pictures - bias * bias) / (pictures - 1));
    MESSAGE("relative bias of combining at 32 samples: " << bias << " +- " << deviation);
    CHECK(std::abs(bias) < 0.02);
}

TEST_CASE("ppg: the same bits for any number of threads") {
    World world;
    Film films[2] = {new_film(), new_film()};
    for (const int threads : {1, 3}) {
        const PpgIntegrator ppg(world.prepared.context, scaled(ppg_settings_2019()));
        render_to(films[threads == 1 ? 0 : 1], ppg, {.spp = 37, .threads = threads});
    }
    CHECK(films[0].beauty() == films[1].beauty());
    CHECK(films[0].variance() == films[1].variance());
}

TEST_CASE("ppg: interrupted after every pass and resumed, the same bits; every picture whole") {
    World world;
    const std::string checkpoint = (std::filesystem::temp_directory_path() / "nephroid_test_ppg.state").string();
    for (const PpgSettings& settings : {scaled(ppg_settings_2019()), scaled(ppg_settings_2017())}) {
        Film whole = new_film();
        render_to(whole, PpgIntegrator(world.prepared.context, settings), {.spp = 21});
        std::filesystem::remove(checkpoint);
        Film parts = new_film();
        for (int run = 0;; ++run) {
            REQUIRE(run < 30);
            interrupt_requested = true;
            Film film = new_film();
            const RenderResult result =
                render_to(film, PpgIntegrator(world.prepared.context, settings), {.spp = 21, .checkpoint = checkpoint});
            CHECK(film.min_spp() >= 1);
            CHECK(mean_of(film.beauty()) > 0.1 * mean_of(whole.beauty()));
            parts = film;
            interrupt_requested = false;
            if (result.passes.back().spp >= 21.0) break;
        }
        CHECK(parts.beauty() == whole.beauty());
        CHECK(parts.variance() == whole.variance());
        CHECK(parts.min_spp() == whole.min_spp());
    }
    std::filesystem::remove(checkpoint);
}

TEST_CASE("films combine to the weighted mean of their samples and its variance") {
    Film a = new_film(), b = new_film();
    SampleBlock block = make_tile_block(0, 0, size, size);
    SampleBuffer samples;
    const auto add = [&](Film& film, uint32_t count, float value) {
        for (uint32_t s = 0; s < count; ++s) {
            block.sample_count = 1;
            for (auto& channel : samples.radiance)
                std::fill_n(channel.data(), block.slot_count(), value + static_cast<float>(s));
            film.add(block, 0, 1, samples);
        }
    };
    add(a, 2, 1.0F);  // Mean 1.5, variance of the mean 1/4.
    add(b, 4, 3.0F);  // Mean 4.5, variance of the mean 5/12.
    const std::array<const Film*, 2> films = {&a, &b};
    const std::array<double, 2> weights = {3.0, 0.5};
    const Film both = Film::combine(films, weights);
    CHECK(both.beauty()[0] == doctest::Approx((6.0 * 1.5 + 2.0 * 4.5) / 8.0));
    CHECK(both.variance()[0] == doctest::Approx((36.0 * 0.25 + 4.0 * 5.0 / 12.0) / 64.0));
    CHECK(both.spp()[0] == 6.0F);
}

// Interval arithmetic: nothing that a member of the operands gives may lie outside of the result.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "pathcut/interval_vector.h"

using namespace nephroid;

namespace {

constexpr size_t members_per_interval = 10;
constexpr size_t samples_per_operation = 10000000;

/// xorshift64*: fast enough not to be what the test measures.
struct Random {
    uint64_t state = 0x9E3779B97F4A7C15ULL;
    uint32_t bits() {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        return static_cast<uint32_t>((state * 0x2545F4914F6CDD1DULL) >> 32);
    }
    uint32_t below_count(uint32_t count) { return static_cast<uint32_t>((uint64_t{bits()} * count) >> 32); }
    float unit() { return static_cast<float>(bits() >> 8) * 0x1p-24F; }
};

/// Random sign and mantissa; 2^low <= |x| < 2^(high + 1), low = -127 gives denormals.
float random_number(Random& random, int low, int high) {
    const uint32_t exponent =
        static_cast<uint32_t>(low + 127) + random.below_count(static_cast<uint32_t>(high - low + 1));
    return std::bit_cast<float>((random.bits() & 0x807FFFFFU) | exponent << 23);
}

/// Scales 1e-4 .. 1e5, sometimes huge, denormal or zero; often a point, or around zero.
Interval<float> random_interval(Random& random) {
    const uint32_t kind = random.below_count(16);
    const bool huge = kind == 0, tiny = kind == 1;
    const float a = kind == 2 ? 0.0F
                              : random_number(random,
                                              huge   ? 50
                                              : tiny ? -127
                                                     : -13,
                                              huge   ? 127
                                              : tiny ? -80
                                                     : 16);
    if (kind == 3 || kind == 4) return {a, a};
    float b = a;
    if (kind < 10) {
        b = random_number(random, huge ? 50 : tiny ? -127 : -13, huge ? 127 : tiny ? -80 : 16);
    } else {
        b = std::clamp(a + a * random_number(random, -24, 0), -largest_float, largest_float);
    }
    return {std::min(a, b), std::max(a, b)};
}

float random_member(Random& random, const Interval<float>& a) {
    const uint32_t kind = random.below_count(8);
    if (kind == 0) return a.lower;
    if (kind == 1) return a.upper;
    const float t = random.unit();
    return std::clamp((1.0F - t) * a.lower + t * a.upper, a.lower, a.upper);
}

using Box = std::array<Interval<float>, 3>;
using Point = std::array<long double, 3>;
using BoxV = IntervalVector<FloatV>;

/// One box per lane.
struct Boxes {
    std::array<Box, simd_width> lane;
    BoxV packed() const {
        const auto pack = [&](size_t axis) -> Interval<FloatV> {
            return {FloatV([&](auto i) { return lane[i][axis].lower; }),
                    FloatV([&](auto i) { return lane[i][axis].upper; })};
        };
        return {pack(0), pack(1), pack(2)};
    }
};

Boxes random_boxes(Random& random) {
    Boxes boxes;
    for (Box& box : boxes.lane) {
        for (Interval<float>& side : box) side = random_interval(random);
    }
    return boxes;
}

Point random_member(Random& random, const Box& box) {
    return {random_member(random, box[0]), random_member(random, box[1]), random_member(random, box[2])};
}

long double norm(const Point& v) {
    return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

bool holds(const Interval<FloatV>& a, size_t lane, long double x) {
    // Written so that NaN bounds fail; an undefined x (a direction of the zero vector) is held by anything.
    return std::isnan(x) || (static_cast<float>(a.lower[lane]) <= x && x <= static_cast<float>(a.upper[lane]));
}
bool holds(const BoxV& a, size_t lane, const Point& v) {
    return holds(a.x, lane, v[0]) && holds(a.y, lane, v[1]) && holds(a.z, lane, v[2]);
}

/// Counts members of random operands whose exact result (in long double) is outside the interval result.
template <class Operation, class Exact>
size_t count_outside(Operation operation, Exact exact, uint64_t seed) {
    Random random;
    random.state ^= seed * 0xD1342543DE82EF95ULL;
    size_t outside = 0;
    for (size_t n = 0; n < samples_per_operation; n += simd_width * members_per_interval) {
        const Boxes a = random_boxes(random), b = random_boxes(random);
        const auto result = operation(a.packed(), b.packed());
        for (size_t lane = 0; lane < simd_width; ++lane) {
            for (size_t m = 0; m < members_per_interval; ++m) {
                const Point p = random_member(random, a.lane[lane]), q = random_member(random, b.lane[lane]);
                outside += holds(result, lane, exact(p, q)) ? 0 : 1;
            }
        }
    }
    return outside;
}

}  // namespace

TEST_CASE("scalar interval operations are conservative") {
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return a.x + b.x; },
                        [](const Point& p, const Point& q) { return p[0] + q[0]; }, 1) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return a.x - b.x; },
                        [](const Point& p, const Point& q) { return p[0] - q[0]; }, 2) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return a.x * b.x; },
                        [](const Point& p, const Point& q) { return p[0] * q[0]; }, 3) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return a.x / b.x; },
                        [](const Point& p, const Point& q) { return p[0] / q[0]; }, 4) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV&) { return square(a.x); },
                        [](const Point& p, const Point&) { return p[0] * p[0]; }, 5) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV&) { return square_root(a.x); },
                        [](const Point& p, const Point&) { return std::sqrt(p[0]); }, 6) == 0);
}

TEST_CASE("vector interval operations are conservative") {
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return dot(a, b); },
                        [](const Point& p, const Point& q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; },
                        7) == 0);
    CHECK(count_outside(
              [](const BoxV& a, const BoxV& b) {
                  return Interval<FloatV>{FloatV(-infinity), upper_dot(a, b)};
              },
              [](const Point& p, const Point& q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; }, 8) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return cross(a, b); },
                        [](const Point& p, const Point& q) -> Point {
                            return {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
                        },
                        9) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV&) { return squared_length(a); },
                        [](const Point& p, const Point&) { return p[0] * p[0] + p[1] * p[1] + p[2] * p[2]; }, 10) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return distance(a, b); },
                        [](const Point& p, const Point& q) {
                            return norm({p[0] - q[0], p[1] - q[1], p[2] - q[2]});
                        },
                        11) == 0);
}

TEST_CASE("interval normalisation and half vectors are conservative") {
    const auto unit = [](const Point& v) -> Point {
        const long double n = norm(v);
        return {v[0] / n, v[1] / n, v[2] / n};
    };
    CHECK(count_outside([](const BoxV& a, const BoxV&) { return normalized(a); },
                        [&](const Point& p, const Point&) { return unit(p); }, 12) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return directions_between(a, b); },
                        [&](const Point& p, const Point& q) {
                            return unit({q[0] - p[0], q[1] - p[1], q[2] - p[2]});
                        },
                        13) == 0);
    CHECK(count_outside([](const BoxV& a, const BoxV& b) { return half_vectors<FloatV>(normalized(a), normalized(b)); },
                        [&](const Point& p, const Point& q) {
                            const Point wi = unit(p), wo = unit(q);
                            return unit({wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]});
                        },
                        14) == 0);
}

TEST_CASE("nearest rounding moved outwards is conservative where the processor cannot round") {
    // The fallback of directed_rounding.h, tested also where it is not used.
    Random random;
    size_t outside = 0;
    const auto brackets = [](float rounded, long double exact) {
        return static_cast<long double>(below(rounded)) <= exact && exact <= static_cast<long double>(above(rounded));
    };
    for (size_t n = 0; n < samples_per_operation; ++n) {
        const float a = random_interval(random).lower, b = random_interval(random).upper;
        const long double x = a, y = b;
        outside += brackets(a + b, x + y) && brackets(a * b, x * y) ? 0 : 1;
        if (b != 0.0F) outside += brackets(a / b, x / y) ? 0 : 1;
        outside += brackets(std::sqrt(std::abs(a)), std::sqrt(std::abs(x))) ? 0 : 1;
    }
    CHECK(outside == 0);
}

TEST_CASE("intervals: one float computes what a vector lane computes") {
    Random random;
    size_t different = 0;
    const auto same = [](const Interval<float>& a, const Interval<FloatV>& b, size_t lane) {
        return a.lower == b.lower[lane] && a.upper == b.upper[lane];
    };
    for (int n = 0; n < 20000; ++n) {
        const Boxes a = random_boxes(random), b = random_boxes(random);
        const BoxV direction = directions_between(a.packed(), b.packed());
        const Interval<FloatV> product = dot(a.packed(), b.packed());
        const Interval<FloatV> quotient = a.packed().x / b.packed().y;
        for (size_t lane = 0; lane < simd_width; ++lane) {
            const Box& p = a.lane[lane];
            const Box& q = b.lane[lane];
            const IntervalVector<float> u{p[0], p[1], p[2]}, v{q[0], q[1], q[2]};
            const IntervalVector<float> d = directions_between(u, v);
            different += same(d.x, direction.x, lane) && same(d.y, direction.y, lane) && same(d.z, direction.z, lane) &&
                                 same(dot(u, v), product, lane) && same(u.x / v.y, quotient, lane)
                             ? 0
                             : 1;
        }
    }
    CHECK(different == 0);
}

TEST_CASE("intervals: exact results stay tight, degenerate operands are defined") {
    const Interval<float> three = point_interval(3.0F), around{-1.0F, 2.0F}, zero = point_interval(0.0F);
    CHECK(square(around).lower == 0.0F);
    CHECK(square(around).upper == doctest::Approx(4.0F));
    CHECK((three / around).lower == -infinity);
    CHECK((three / around).upper == infinity);
    CHECK((three / zero).upper == infinity);
    const Interval<float> unbounded = unbounded_interval<float>();
    CHECK(contains(zero * unbounded, 0.0F));
    CHECK((unbounded * unbounded).upper == infinity);
    CHECK((unbounded + unbounded).lower == -infinity);
    CHECK((unbounded / unbounded).lower == -infinity);
    CHECK(smallest_magnitude(around) == 0.0F);
    CHECK(largest_magnitude(around) == 2.0F);
    CHECK(hull(empty_interval<float>(), around).lower == -1.0F);

    // The direction of a point is known to a few units in the last place, at any scale that float can square.
    for (const float scale : {1e-15F, 1e-4F, 1.0F, 1e5F, 1e15F}) {
        const IntervalVector<float> d = normalized(point_box(Triple<float>{2.0F * scale, -3.0F * scale, 6.0F * scale}));
        CHECK(d.x.upper - d.x.lower < 1e-6F);
        CHECK(contains(d.z, 6.0F / 7.0F));
        CHECK(contains(d.y, -3.0F / 7.0F));
    }
    const IntervalVector<float> none = normalized(point_box(Triple<float>{0.0F, 0.0F, 0.0F}));
    CHECK((none.x.lower >= -1.0F && none.x.upper <= 1.0F));
    const IntervalVector<float> all = normalized(IntervalVector<float>{around, around, around});
    CHECK((all.x.lower == -1.0F && all.x.upper == 1.0F));
}

namespace {

/// The neighbouring float below x, by its bit pattern: the alternative to `below`.
FloatV bit_step_below(const FloatV& x) {
    const IntV bits = std::bit_cast<IntV>(x);
    const IntV stepped = bits + stdx::static_simd_cast<IntV>(select(x > FloatV(0.0F), FloatV(-1.0F), FloatV(1.0F)));
    return select(x == FloatV(0.0F), FloatV(-1e-45F), std::bit_cast<FloatV>(stepped));
}

struct Embedded {
    static FloatV multiply(const FloatV& a, const FloatV& b) { return multiply_down(a, b); }
    static FloatV add(const FloatV& a, const FloatV& b) { return add_down(a, b); }
    static FloatV outward(const FloatV& x) { return x; }
};
struct Inflation {
    static FloatV multiply(const FloatV& a, const FloatV& b) { return a * b; }
    static FloatV add(const FloatV& a, const FloatV& b) { return below<FloatV>(a + b); }
    static FloatV outward(const FloatV& x) { return below(x); }
};
struct BitStep {
    static FloatV multiply(const FloatV& a, const FloatV& b) { return a * b; }
    static FloatV add(const FloatV& a, const FloatV& b) { return bit_step_below(a + b); }
    static FloatV outward(const FloatV& x) { return bit_step_below(x); }
};
struct None {
    static FloatV multiply(const FloatV& a, const FloatV& b) { return a * b; }
    static FloatV add(const FloatV& a, const FloatV& b) { return a + b; }
    static FloatV outward(const FloatV& x) { return x; }
};

template <class Rounding>
FloatV lower_product(const Interval<FloatV>& a, const Interval<FloatV>& b) {
    const FloatV ll = Rounding::multiply(a.lower, b.lower), lu = Rounding::multiply(a.lower, b.upper);
    const FloatV ul = Rounding::multiply(a.upper, b.lower), uu = Rounding::multiply(a.upper, b.upper);
    return Rounding::outward(minimum<FloatV>(minimum<FloatV>(ll, lu), minimum<FloatV>(ul, uu)));
}
template <class Rounding>
FloatV lower_dot(const BoxV& a, const BoxV& b) {
    return Rounding::add(Rounding::add(lower_product<Rounding>(a.x, b.x), lower_product<Rounding>(a.y, b.y)),
                         lower_product<Rounding>(a.z, b.z));
}

/// Nanoseconds per box of `operation(a, b)` over boxes that stay in the cache; the best of several runs.
template <class Operation>
double cost(const std::vector<BoxV>& boxes, Operation operation) {
    double best = 1e30;
    for (int run = 0; run < 7; ++run) {
        FloatV sum = 0.0F;
        const auto start = std::chrono::steady_clock::now();
        for (int repeat = 0; repeat < 400; ++repeat) {
            for (size_t i = 0; i + 1 < boxes.size(); ++i) sum += operation(boxes[i], boxes[i + 1]);
        }
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        volatile float sink = sum[0];
        static_cast<void>(sink);
        best = std::min(best, seconds / (400.0 * static_cast<double>((boxes.size() - 1) * simd_width)));
    }
    return best * 1e9;
}

}  // namespace

// Run with --no-skip --test-case="*cost*".
TEST_CASE("interval operations: cost of the rounding strategies" * doctest::skip()) {
    Random random;
    std::vector<BoxV> boxes;
    for (int i = 0; i < 64; ++i) {
        Boxes b;
        for (Box& box : b.lane) {
            for (Interval<float>& side : box) {
                const float x = random.unit() - 0.3F;
                side = {x, x + 0.1F * random.unit()};
            }
        }
        boxes.push_back(b.packed());
    }
    const auto report = [](const std::string& name, double ns) { MESSAGE(name << ": " << ns << " ns per box"); };
    report("dot bound, round to nearest (not conservative)", cost(boxes, lower_dot<None>));
    report("dot bound, rounding in the instruction", cost(boxes, lower_dot<Embedded>));
    report("dot bound, relative inflation", cost(boxes, lower_dot<Inflation>));
    report("dot bound, step of the bit pattern", cost(boxes, lower_dot<BitStep>));
    report("upper_dot", cost(boxes, [](const BoxV& a, const BoxV& b) { return upper_dot(a, b); }));
    const auto all_sides = [](const BoxV& d) {
        return d.x.lower + d.x.upper + d.y.lower + d.y.upper + d.z.lower + d.z.upper;
    };
    report("cross", cost(boxes, [&](const BoxV& a, const BoxV& b) { return all_sides(cross(a, b)); }));
    report("normalized", cost(boxes, [&](const BoxV& a, const BoxV&) { return all_sides(normalized(a)); }));
    report("directions_between",
           cost(boxes, [&](const BoxV& a, const BoxV& b) { return all_sides(directions_between(a, b)); }));
}

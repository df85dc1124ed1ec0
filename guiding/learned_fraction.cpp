#include "guiding/learned_fraction.h"

#include <cmath>
#include <numeric>

namespace nephroid {

namespace {

// The moments' decay and the regularisation of the course notes. A step here sees all samples of a pass instead of one,
// so there are fewer and longer ones: enough to cross the whole range.
constexpr int steps = 300;
constexpr double step_size = 0.03;
constexpr double first_decay = 0.9, second_decay = 0.999, epsilon = 1e-8;
constexpr double regularisation = 0.01;

double sigmoid(double x) {
    return 1.0 / (1.0 + std::exp(-x));
}

double logit_of(double probability) {
    return std::log(probability / (1.0 - probability));
}

/// Derivative of the divergence, for weights of sum one, by the logit.
double slope(std::span<const double, choice_bins> weights, double sum, double logit) {
    const double a = sigmoid(logit);
    double by_fraction = 0.0;
    for (size_t i = 0; i < choice_bins; ++i) {
        const double r = (static_cast<double>(i) + 0.5) / static_cast<double>(choice_bins);
        by_fraction -= weights[i] * (2.0 * r - 1.0) / (a * r + (1.0 - a) * (1.0 - r));
    }
    return by_fraction / sum * a * (1.0 - a) + regularisation * logit;
}

}  // namespace

float learn_bsdf_fraction(std::span<const double, choice_bins> weights, float fraction) {
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    if (!(sum > 0.0)) return fraction;
    const double limit = -logit_of(static_cast<double>(least_choice_probability));
    double x = logit_of(static_cast<double>(fraction)), first = 0.0, second = 0.0, first_power = 1.0,
           second_power = 1.0;
    for (int i = 0; i < steps; ++i) {
        const double gradient = slope(weights, sum, x);
        first = first_decay * first + (1.0 - first_decay) * gradient;
        second = second_decay * second + (1.0 - second_decay) * gradient * gradient;
        first_power *= first_decay;
        second_power *= second_decay;
        const double mean = first / (1.0 - first_power), square = second / (1.0 - second_power);
        x = std::clamp(x - step_size * mean / (std::sqrt(square) + epsilon), -limit, limit);
    }
    return static_cast<float>(sigmoid(x));
}

}  // namespace nephroid

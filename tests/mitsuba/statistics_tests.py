"""Welch's t-test without SciPy, and the Sidak correction for many tests at once."""

from __future__ import annotations

import math


def incomplete_beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function, by Lentz's continued fraction."""
    if x <= 0.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    if x > (a + 1.0) / (a + b + 2.0):
        return 1.0 - incomplete_beta(b, a, 1.0 - x)
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)) / a
    tiny = 1e-300
    c, d = 1.0, 1.0 / avoid_zero(1.0 - (a + b) * x / (a + 1.0), tiny)
    result = d
    for m in range(1, 400):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            d = 1.0 / avoid_zero(1.0 + term * d, tiny)
            c = avoid_zero(1.0 + term / c, tiny)
            result *= c * d
        if abs(c * d - 1.0) < 1e-14:
            break
    return front * result


def avoid_zero(value: float, tiny: float) -> float:
    return value if abs(value) > tiny else tiny


def two_sided_p(t: float, degrees_of_freedom: float) -> float:
    """Probability of a Student t at least as far from 0 as `t`."""
    return incomplete_beta(0.5 * degrees_of_freedom, 0.5, degrees_of_freedom / (degrees_of_freedom + t * t))


def welch(first, second, tolerance: float) -> tuple[float, float, float]:
    """(difference of means, its standard error, p) of two lists of independent values.

    `tolerance` is a systematic error (absolute) that is allowed for, added to the standard error in quadrature: where
    neither renderer has noise, rounding and interpolation differences remain.
    """
    mean1, variance1 = mean_and_variance(first)
    mean2, variance2 = mean_and_variance(second)
    of_mean1, of_mean2 = variance1 / len(first), variance2 / len(second)
    noise = of_mean1 + of_mean2
    error = math.sqrt(noise + tolerance * tolerance)
    difference = mean1 - mean2
    if error == 0.0:
        return difference, 0.0, 1.0 if difference == 0.0 else 0.0
    if noise == 0.0:
        return difference, error, math.erfc(abs(difference) / error / math.sqrt(2.0))
    freedom = noise**2 / (of_mean1**2 / (len(first) - 1) + of_mean2**2 / (len(second) - 1))
    return difference, error, two_sided_p(difference / error, freedom)


def mean_and_variance(values) -> tuple[float, float]:
    mean = math.fsum(values) / len(values)
    return mean, math.fsum((value - mean) ** 2 for value in values) / (len(values) - 1)


def sidak_threshold(significance: float, tests: int) -> float:
    """The p below which one of `tests` independent tests is significant, all together at `significance`."""
    return -math.expm1(math.log1p(-significance) / tests)

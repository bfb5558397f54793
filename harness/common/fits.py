"""Fits and confidence intervals, of 95 % everywhere: power laws of positive numbers, means, medians, shares."""

import itertools
from math import sqrt
from statistics import NormalDist

import numpy as np

COVERAGE = 0.95  # Of all intervals.


def power_law(x: np.ndarray, y: np.ndarray) -> tuple[float, tuple[float, float], float]:
    """Exponent of y = c x^exponent by least squares of logarithms, its interval by Student's t, and log₁₀ c.

    x and y are positive, shape (n,), and x has two different values at least. With two points the interval
    is infinite.
    """
    from scipy import stats

    fit = stats.linregress(np.log10(x), np.log10(y))
    slope = float(fit.slope)  # pyright: ignore[reportAttributeAccessIssue]
    error = float(fit.stderr)  # pyright: ignore[reportAttributeAccessIssue]
    intercept = float(fit.intercept)  # pyright: ignore[reportAttributeAccessIssue]
    width = float(stats.t.ppf((1 + COVERAGE) / 2, len(x) - 2)) * error if len(x) > 2 else np.inf
    return slope, (slope - width, slope + width), intercept


def mean_interval(values: np.ndarray) -> tuple[float, float, float]:
    """Mean, lower and upper end of its interval by Student's t; the ends of equal values, or of one, are NaN.

    `values` has shape (n,), n ≥ 1.
    """
    from scipy import stats

    mean = float(np.mean(values))
    low, high = stats.t.interval(COVERAGE, len(values) - 1, mean, stats.sem(values))
    return mean, float(low), float(high)


def quantile_ranks(share: float, count: int) -> tuple[int, int]:
    """Ranks, from 1 on, of the two ordered values between which a quantile lies, by the binomial distribution.

    No value is that small, or that large, where a rank is 0 or count + 1: so few values leave that end open.
    """
    from scipy import stats

    # The number of values below the true quantile is binomial with the probability `share`.
    first, last = stats.binom.ppf([(1 - COVERAGE) / 2, (1 + COVERAGE) / 2], count, share)
    return int(first), int(last) + 1


def least_bodies(share: float) -> int:
    """The least number of values, or bodies, of which a quantile above ½ has an upper end (`quantile_ranks`)."""
    return next(count for count in itertools.count(1) if quantile_ranks(share, count)[1] <= count)


def median_interval(values: np.ndarray) -> tuple[float, float, float]:
    """Median, lower and upper end of its interval: two of the values in order, by the binomial distribution.

    `values` has shape (n,), n ≥ 1. For fewer than six values the interval goes from the least to the
    largest, and covers less than 95 %.
    """
    ordered = np.sort(values)
    first, last = quantile_ranks(0.5, len(ordered))
    low = ordered[max(1, first) - 1]
    high = ordered[min(len(ordered), last) - 1]
    return float(np.median(ordered)), float(low), float(high)


def wilson(count: int, total: int) -> tuple[float, float]:
    """Wilson's score interval of the share count/total (J. Am. Stat. Assoc. 22 (1927) 209): its two ends.

    It holds for shares of 0 and 1 too. Without cases it is (0, 1).
    """
    z = NormalDist().inv_cdf((1 + COVERAGE) / 2)
    middle = count + z**2 / 2
    width = z * sqrt(count * (total - count) / max(1, total) + z**2 / 4)
    # At shares of 0 and 1 rounding would leave the ends just outside.
    return max(0.0, (middle - width) / (total + z**2)), min(1.0, (middle + width) / (total + z**2))

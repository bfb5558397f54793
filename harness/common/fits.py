"""Fits and confidence intervals, of 95 % everywhere: power laws, means, shares."""

import numpy as np
from scipy import stats

COVERAGE = 0.95


def power_law(x: np.ndarray, y: np.ndarray) -> tuple[float, tuple[float, float], float]:
    """Exponent of y = c x^exponent by least squares of logarithms, its interval by Student's distribution, and log₁₀ c.

    With two points the interval is infinite.
    """
    fit = stats.linregress(np.log10(x), np.log10(y))
    slope, error, intercept = float(fit.slope), float(fit.stderr), float(fit.intercept)  # pyright: ignore[reportAttributeAccessIssue]
    width = float(stats.t.ppf((1 + COVERAGE) / 2, len(x) - 2)) * error if len(x) > 2 else np.inf
    return slope, (slope - width, slope + width), intercept


def mean_interval(values: np.ndarray) -> tuple[float, float, float]:
    """Mean and its interval by Student's distribution."""
    mean = float(np.mean(values))
    low, high = stats.t.interval(COVERAGE, len(values) - 1, mean, stats.sem(values))
    return mean, float(low), float(high)


def wilson(count: int, total: int) -> tuple[float, float]:
    """Wilson's score interval of a share (J. Am. Stat. Assoc. 22 (1927) 209), which holds at 0 and 1."""
    interval = stats.binomtest(count, total).proportion_ci(COVERAGE, method="wilson")
    return float(interval.low), float(interval.high)

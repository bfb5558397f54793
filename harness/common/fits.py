"""Fits and intervals of measured numbers: a power law, a share."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np


class PowerLaw(NamedTuple):
    """A power law y = factor x^exponent, and the 95 % interval of its exponent."""

    exponent: float
    low: float
    high: float
    factor: float


def power_law(x: np.ndarray | Sequence[float], y: np.ndarray | Sequence[float]) -> PowerLaw:
    """Least squares of log y on log x, with Student's interval; without bounds where there are only two points."""
    from scipy import stats

    line: Any = stats.linregress(np.log(x), np.log(y))
    width = stats.t.ppf(0.975, len(x) - 2) * line.stderr if len(x) > 2 else np.inf
    numbers = line.slope, line.slope - width, line.slope + width, np.exp(line.intercept)
    return PowerLaw(*(float(each) for each in numbers))


def share_interval(count: int, total: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a share (J. Am. Stat. Assoc. 22 (1927) 209), which holds at 0 and 1 too."""
    from scipy import stats

    interval = stats.binomtest(count, total).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)

"""Exponents of St that follow from the errors of second order away from resonances.

By theory (`docs/second-order.md`) the error of L and E falls like 1/St², that of the orientation like 1/St.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from polhode.harness.averaging.data import SecondOrderErrors
from polhode.harness.common.fits import power_law

# Slopes of log error over log St are fitted to errors between these two: larger ones follow no
# power law yet, smaller ones are blurred by the reference. Both are estimates.
LARGEST_FITTED_ERROR = 1e-2  # Of L and E, over I_max.
LEAST_RESOLVED = 100.0  # Times the reference's uncertainty.


@dataclass(frozen=True)
class Slope:
    """Fitted exponents of St, with the numbers of points that they rest on."""

    shape: str
    start: str
    slow: float  # of the error of L and E; NaN with fewer than two points
    slow_points: int
    orientation: float
    orientation_points: int


def slopes(rows: Sequence[SecondOrderErrors]) -> list[Slope]:
    """Fitted exponents of St, one pair for each case; the orientation's over the top two decades."""
    fitted = []
    for case in dict.fromkeys((row.shape, row.start) for row in rows):
        case_rows = [row for row in rows if (row.shape, row.start) == case]
        top = max(row.stokes for row in case_rows)
        slow = [
            (r.stokes, r.slow)
            for r in case_rows
            if LEAST_RESOLVED * r.slow_uncertainty < r.slow < LARGEST_FITTED_ERROR
        ]
        # Two decades, and a hundredth less: the St of the cases are rounded to three digits.
        turned = [(r.stokes, r.orientation) for r in case_rows if r.stokes >= 0.99e-2 * top]
        fitted.append(Slope(*case, _exponent(slow), len(slow), _exponent(turned), len(turned)))
    return fitted


def _exponent(points: Sequence[tuple[float, float]]) -> float:
    return power_law(*np.transpose(points))[0] if len(points) > 1 else nan

"""Exponents of St that follow from the errors of second order away from resonances.

By theory (`docs/second-order.md`) the error of L and E falls like 1/St², the error of the orientation like 1/St:
their exponents are about -2 and -1. The page reports/second-order states those that are fitted here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from polhode.harness.averaging.data import SecondOrderErrors
from polhode.harness.common.fits import power_law

# Slopes of log error over log St are fitted to errors of L and E between two limits.
# The largest one, over I_max: larger errors follow no power law yet. An estimate.
LARGEST_FITTED_ERROR = 1e-2
# The least one, over the reference's uncertainty, which then changes an error by a percent at most. An
# estimate: with half of this it would be two percent, and a few more points would count.
LEAST_RESOLVED = 100.0
# The orientation's slope is fitted to St from this share of the largest one on. That is two
# decades, and a percent more, as the St of the cases are rounded to three digits. Errors have no
# limits here: in these decades the orientation is off by less than 0.5 rad, and by over 1e6 times
# the reference's uncertainty (reports/second-order/orders.csv).
_TOP_SHARE = 0.99e-2


@dataclass(frozen=True)
class Slope:
    """Fitted exponents of St, with the numbers of points that they rest on."""

    shape: str  # as in `SecondOrderErrors`, like the start
    start: str
    slow: float  # of the error of L and E; NaN with fewer than two points
    slow_points: int
    orientation: float  # of the error of the orientation; NaN likewise
    orientation_points: int


def slopes(rows: Sequence[SecondOrderErrors]) -> list[Slope]:
    """Fitted exponents of St, one pair for each case; the orientation's over the top two decades.

    A case is a shape and a start, in the order of the rows, each of which is one run at one St.
    """
    fitted = []
    for shape, start in dict.fromkeys((row.shape, row.start) for row in rows):
        case_rows = [row for row in rows if (row.shape, row.start) == (shape, start)]
        top = max(row.stokes for row in case_rows)
        slow_points = []
        orientation_points = []
        for row in case_rows:
            if LEAST_RESOLVED * row.slow_uncertainty < row.slow < LARGEST_FITTED_ERROR:
                slow_points.append((row.stokes, row.slow))
            if row.stokes >= _TOP_SHARE * top:
                orientation_points.append((row.stokes, row.orientation))
        fitted.append(
            Slope(
                shape=shape,
                start=start,
                slow=_exponent(slow_points),
                slow_points=len(slow_points),
                orientation=_exponent(orientation_points),
                orientation_points=len(orientation_points),
            )
        )
    return fitted


def _exponent(points: Sequence[tuple[float, float]]) -> float:
    """Fitted exponent of pairs of St and an error; NaN with fewer than two."""
    if len(points) < 2:
        return nan
    stokes, errors = np.transpose(points)
    exponent, _, _ = power_law(stokes, errors)
    return exponent

"""Errors of `averaged-second-order` away from resonances as St grows, and the orders they show."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from polhode.harness.averaging.cases import (
    AGAINST,
    GENTLE,
    PAPER,
    SAMPLES,
    TILTED,
    TOLERANCE,
    Case,
    timed_run,
    true_observables,
)
from polhode.harness.references.errors import errors
from polhode.models.scene import BodyStart, Start
from polhode.models.second_order.form import SecondOrder

# Slopes are fitted where the error is below this and above so many times the reference's uncertainty.
LARGEST_ERROR, FLOORS = 1e-2, 100.0


def _spheroid(kappa: float, start: Start, slow_time: float, exponents: tuple[float, ...] = (4, 4.5, 5, 5.5, 6)) -> Case:
    return Case((1.0, 1.0, kappa), start, slow_time, exponents)


CASES = (
    *(_spheroid(kappa, start, 0.1) for kappa in (0.1, 0.25, 0.5, 2.0) for start in (PAPER, AGAINST)),
    *(_spheroid(kappa, GENTLE, 0.1) for kappa in (0.5, 2.0)),
    *(_spheroid(4.0, start, 0.05) for start in (PAPER, AGAINST)),
    *(_spheroid(10.0, start, 0.02, (4.5, 5, 5.5, 6, 6.5)) for start in (PAPER, AGAINST)),
    *(
        Case(axes, BodyStart(TILTED, spin), 0.03)
        for axes, spin in (
            ((1.0, 0.8, 0.5), (0.3, 0.2, 1.5)),
            ((1.0, 0.8, 0.5), (0.6, 0.5, 1.0)),
            ((1.0, 0.8, 0.5), (1.5, 0.2, 0.1)),
            ((0.5, 1.0, 0.8), (-1.2, 0.5, 0.4)),
            ((1.0, 0.6, 0.4), (0.1, 0.1, -0.8)),
            ((1.0, 0.6, 0.4), (0.3, 0.2, 1.5)),
            ((1.0, 0.9, 0.3), (0.5, -0.4, -1.2)),
            ((1.0, 0.9, 0.3), (0.6, 0.5, 1.0)),
        )
    ),
)


@dataclass(frozen=True)
class Row:
    """Errors of one run over `SAMPLES` equispaced samples; slow ones over I_max, orientation in rad."""

    shape: str
    start: str
    slow_time: float
    stokes: float
    slow: float
    orientation: float
    first_order_slow: float
    estimated_slow: float
    estimated_orientation: float
    slow_uncertainty: float
    orientation_uncertainty: float


@dataclass(frozen=True)
class Slope:
    """Fitted exponents of St, with the numbers of points they rest on; orientation over the top two decades."""

    shape: str
    start: str
    slow: float
    slow_points: int
    orientation: float
    orientation_points: int


def measure(case: Case, stokes: float) -> Row:
    """Errors of first and second order, and the form's own estimate, against the full form in long double."""
    scene = case.scene(stokes)
    form = SecondOrder()
    true, uncertainty = true_observables(scene)
    found = timed_run(scene, form.name, TOLERANCE, SAMPLES).observables
    triaxial = scene.ellipsoid.kind == "triaxial"
    first = timed_run(scene, "averaged" if triaxial else "averaged-spheroid", TOLERANCE, SAMPLES).observables
    error, estimate = errors(scene.ellipsoid, found, true), form.estimate(scene)
    return Row(
        *case.names,
        case.slow_time,
        stokes,
        error.slow,
        nan if error.orientation is None else error.orientation,
        errors(scene.ellipsoid, first, true).slow,
        estimate.slow,
        estimate.orientation,
        uncertainty.slow,
        nan if uncertainty.orientation is None else uncertainty.orientation,
    )


def slopes(rows: Sequence[Row]) -> list[Slope]:
    """Fitted exponents, one per case."""
    cases = dict.fromkeys((row.shape, row.start) for row in rows)
    return [_slope([row for row in rows if (row.shape, row.start) == case]) for case in cases]


def _slope(rows: list[Row]) -> Slope:
    top = max(row.stokes for row in rows)
    slow = [(r.stokes, r.slow) for r in rows if FLOORS * r.slow_uncertainty < r.slow < LARGEST_ERROR]
    turned = [(r.stokes, r.orientation) for r in rows if r.stokes >= 0.99e-2 * top]
    return Slope(rows[0].shape, rows[0].start, _exponent(slow), len(slow), _exponent(turned), len(turned))


def _exponent(points: Sequence[tuple[float, float]]) -> float:
    if len(points) < 2:
        return nan
    x, y = np.log10(np.array(points)).T
    return float(np.polyfit(x, y, 1)[0])

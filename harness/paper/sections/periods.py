"""Section "Governing equations": the period of a tumbling spheroid, from Jeffery's to that of a free top."""

from itertools import product
from math import pi

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.runs import run_form, spheroid
from polhode.models.forms.tumbling import Tumbling
from polhode.models.scene import BodyStart, Scene
from polhode.models.theory.tumbling_period import tumbling_period, weak_inertia_period_change

KAPPAS = (2.0, 4.0, 8.0, 16.0)
# Aspect ratios and Stokes numbers, from Jeffery's limit to the fall of the period, of runs in time.
INTEGRATED = ((2.0, 0.1), (2.0, 1.0), (2.0, 10.0), (2.0, 100.0), (4.0, 1.0), (4.0, 100.0), (8.0, 200.0), (16.0, 1e3))
# A tumbler turns about an equatorial axis.
AXIS = 0


def _periods(stokes: np.ndarray) -> Computed:
    for kappa, number in product(KAPPAS, stokes.tolist()):
        period, jeffery = (tumbling_period(spheroid(kappa), own, AXIS) for own in (number, 0.0))
        change = period - jeffery
        yield "", {"kappa": kappa, "stokes": number, "period": period, "jeffery": jeffery, "change": change}


def compute_change(grid: Grid) -> Computed:
    """Change of the period at small St, and the printed law."""
    for table, row in _periods(np.geomspace(1e-2, 1e4, grid.of(121, 25))):
        yield table, {**row, "printed": weak_inertia_period_change(spheroid(row["kappa"]), row["stokes"], AXIS)}


def validity(part: Table) -> float:
    """St at which the law is 10 % off."""
    error = np.abs(part.change / part.printed - 1)
    last = int(np.argmax(error > 0.1))
    return float(np.exp(np.interp(0.1, error[: last + 1], np.log(part.stokes[: last + 1]))))


def compute_period(grid: Grid) -> Computed:
    """Period at all St, and by integration in time at some."""
    yield from _periods(np.geomspace(1e-3, 1e6, grid.of(73, 19)))
    for kappa, number in grid.of(INTEGRATED, INTEGRATED[1:4:2]):
        period = _integrated_period(kappa, number)
        difference = period / tumbling_period(spheroid(kappa), number, AXIS) - 1
        yield "integrated", {"kappa": kappa, "stokes": number, "period": period, "difference": difference}


def _integrated_period(kappa: float, stokes: float) -> float:
    """Time of one turn by integration in time, after the transient."""
    ellipsoid = spheroid(kappa)
    settled = 40 * stokes / ellipsoid.damping[AXIS]
    scene = Scene(ellipsoid, stokes, BodyStart((0.5, 0.5, 0.5, 0.5), (0.0, -0.5, 0.0)), settled + 60 * kappa)
    times = np.concatenate([[0.0], np.arange(settled, scene.time, 0.01)])
    states = run_form(Tumbling(), scene, times, 1e-14).states
    angle, rate = np.unwrap(states[1:, 0]), states[1:, 1]
    goals = angle[0] - 2 * pi * np.arange(1, 1 + int((angle[0] - angle[-1]) / (2 * pi)))
    passed = [CubicHermiteSpline(times[1:], angle - goal, rate).roots(extrapolate=False)[0] for goal in goals]
    return float(np.mean(np.diff(passed)))

"""The tumbling period against its limits, and against the one-angle equation integrated until it repeats itself."""

from math import acosh, inf, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from polhode.models.shape import Ellipsoid
from polhode.models.theory.tumbling_period import tumbling_period, weak_inertia_period_change

SHAPE_LIST = [
    ((1.0, 1.0, 2.0), 0),
    ((0.2, 1.0, 1.0), 1),
    ((1.0, 0.8, 0.5), 0),
    ((1.0, 0.8, 0.5), 1),
    ((1.0, 0.8, 0.5), 2),
]
SHAPES = pytest.mark.parametrize(("semi_axes", "axis"), SHAPE_LIST)


def jeffery_period(ellipsoid, axis):
    a, b = (ellipsoid.scaled_axes[(axis + step) % 3] for step in (1, 2))
    return 2 * pi * (a / b + b / a)


@SHAPES
@pytest.mark.parametrize("stokes", [0.0, 1e-7])
def test_jeffery_limit(semi_axes, axis, stokes):
    ellipsoid = Ellipsoid(semi_axes)
    assert tumbling_period(ellipsoid, stokes, axis) == pytest.approx(
        jeffery_period(ellipsoid, axis), rel=1e-12
    )


LIMIT_CYCLES = [
    *((semi_axes, axis, stokes) for semi_axes, axis in SHAPE_LIST for stokes in (3.0, 20.0, 300.0)),
    ((1.0, 1.0, 0.01), 0, 1e3),
]


@pytest.mark.parametrize(("semi_axes", "axis", "stokes"), LIMIT_CYCLES)
def test_integration_to_the_limit_cycle(semi_axes, axis, stokes):
    """Rate and angle from `ultima` and `jw3`, over many half turns; the last one counts."""
    ellipsoid = Ellipsoid(semi_axes)
    a, b = (ellipsoid.semi_axes[(axis + step) % 3] for step in (1, 2))
    damping = 8 * pi * ellipsoid.resistance[axis] / ellipsoid.inertia[axis] / stokes

    def field(_, state):
        angle, rate = state
        jeffery = -(a * a * np.sin(angle) ** 2 + b * b * np.cos(angle) ** 2) / (a * a + b * b)
        return [rate, -damping * (rate - jeffery)]

    def turned(_, state):
        return np.sin(state[0])

    end = 35 / damping + 1.1 * jeffery_period(ellipsoid, axis)
    solution = solve_ivp(
        field, (0, end), [1.0, -0.5], method="DOP853", rtol=1e-12, atol=1e-13, events=turned
    )
    crossings = solution.t_events[0]
    assert tumbling_period(ellipsoid, stokes, axis) == pytest.approx(
        2 * (crossings[-1] - crossings[-2]), rel=1e-9
    )


@pytest.mark.parametrize("kappa", [1.5, 2.0, 5.0])
def test_small_stokes_number(kappa):
    """`vivtp`: the period of a prolate spheroid decreases, by the printed amount."""
    ellipsoid, stokes = Ellipsoid((1.0, 1.0, kappa)), 0.1
    bracket = (1 - 2 * kappa**2) * acosh(kappa) + kappa * sqrt(kappa**2 - 1)
    printed = -(stokes**2) * pi * bracket**2 / (100 * kappa**2 * (kappa**4 - 1) * (kappa + 1) ** 2)
    change = tumbling_period(ellipsoid, stokes, 0) - tumbling_period(ellipsoid, 0.0, 0)
    assert change < 0
    assert change == pytest.approx(printed, rel=1e-4)
    assert weak_inertia_period_change(ellipsoid, stokes, 0) == pytest.approx(printed, rel=1e-12)


@SHAPES
def test_small_stokes_number_of_any_axis(semi_axes, axis):
    """What the leading term leaves is of order St⁴."""
    ellipsoid = Ellipsoid(semi_axes)
    left = []
    for stokes in (0.5, 1.0):
        change = tumbling_period(ellipsoid, stokes, axis) - tumbling_period(ellipsoid, 0.0, axis)
        left.append(change - weak_inertia_period_change(ellipsoid, stokes, axis))
    assert np.log2(left[1] / left[0]) == pytest.approx(4, abs=0.05)


@SHAPES
def test_large_stokes_number(semi_axes, axis):
    """T → 4π, with a remainder that falls like St⁻²."""
    ellipsoid = Ellipsoid(semi_axes)
    low, high = (tumbling_period(ellipsoid, stokes, axis) - 4 * pi for stokes in (2e4, 4e4))
    assert 0 < high < 1e-3
    assert low / high == pytest.approx(4, rel=1e-3)


@pytest.mark.parametrize("stokes", [0.1, 1e3, 1e4])
def test_thin_plate(stokes):
    """κ = 0.01 in the flow-gradient plane: the rate falls to 1e-4, and T is still between its limits."""
    ellipsoid = Ellipsoid((1.0, 1.0, 0.01))
    period = tumbling_period(ellipsoid, stokes, 0)
    assert 4 * pi < period < jeffery_period(ellipsoid, 0)


@pytest.mark.parametrize("stokes", [inf, -1.0, float("nan")])
def test_refuses(stokes):
    with pytest.raises(ValueError, match="expected a finite number from 0 on"):
        tumbling_period(Ellipsoid((1.0, 1.0, 2.0)), stokes, 0)

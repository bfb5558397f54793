"""Oscillators: harmonic, of van der Pol, and Lorenz' chaotic one; a rigid body without torque."""

from math import cos, sin, sqrt

from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.problems.classical import DETEST, HNW, IVP, Classical


def van_der_pol_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1], (1 - y[0] * y[0]) * y[1] - y[0]

    return rhs


def stiff_van_der_pol_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1], 1e6 * ((1 - y[0] * y[0]) * y[1] - y[0])

    return rhs


def rigid_body_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1] * y[2], -y[2] * y[0], -0.51 * y[0] * y[1]

    return rhs


def lorenz_field(ops: Operations) -> Field:
    def rhs(y, p):
        return 10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3

    return rhs


def oscillators_field(ops: Operations) -> Field:
    """Two oscillators, of frequencies 1 and 50, seen in coordinates that mix them."""

    def rhs(y, p):
        slow, fast = 0.5 * (y[0] + y[1]), 1250.0 * (y[0] - y[1])
        return y[2], y[3], -slow - fast, fast - slow

    return rhs


def _mixed(t: float) -> tuple[float, ...]:
    """Both oscillators start at 1 from rest."""
    a, b, u, v = cos(t), cos(50 * t), -sin(t), -50 * sin(50 * t)
    return (a + b) / sqrt(2), (a - b) / sqrt(2), (u + v) / sqrt(2), (u - v) / sqrt(2)


OSCILLATORS = {
    "van-der-pol": Classical(
        Problem("van der Pol", van_der_pol_field, (2.0, 0.0), 20.0),
        (2.008149762174948, -4.250887527320057e-2),
        False,
        f"{DETEST}: E2",
    ),
    "stiff-van-der-pol": Classical(
        Problem("stiff van der Pol", stiff_van_der_pol_field, (2.0, 0.0), 2.0),
        (0.1706167732170483e1, -0.8928097010247975),
        True,
        f"{IVP}: van der Pol, epsilon = 1e-6",
        ("rk45", "dop853"),
    ),
    "oscillators": Classical(
        Problem("oscillators", oscillators_field, _mixed(0.0), 20.0),
        _mixed(20.0),
        False,
        "closed form: cosines",
        ("radau",),
    ),
    "lorenz": Classical(
        Problem("Lorenz", lorenz_field, (-8.0, 8.0, 27.0), 16.0),
        (-9.1313130267790876835, -12.476178810283509073, 22.843338960369757355),
        False,
        f"{HNW}: section II.10; digits by Taylor in quadruple precision",
    ),
    "rigid-body": Classical(
        Problem("rigid body", rigid_body_field, (0.0, 1.0, 1.0), 20.0),
        (-9.396570798729192e-01, -3.421177754000779e-01, 7.414126596199957e-01),
        False,
        f"{DETEST}: B5, Euler's equations without torque",
    ),
}

"""The width within which the paper's spheroid passes the pinch point L = 0, against first principles."""

from math import cos, log, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from oracle.first_principles import integrate, momentum_and_energy
from oracle.printed import Spheroid
from oracle.verdict import assert_misprint, assert_right

# |L| over I_e at the start, and the angle between L and the symmetry axis, in rad.
MOMENTUM, THETA = 0.4, 0.3
KAPPAS = pytest.mark.parametrize("kappa", [1.2, 2.0, 3.0])


def growth(kappa):
    """e of L_y ∝ L_z^e on the way to L = 0 from L_z > 0."""
    s = Spheroid(kappa)
    return (s.xc + s.yc * s.ia / s.ie - 2 * s.yc) / s.xc


@KAPPAS
def test_right_growth_of_the_gradient_momentum_at_the_pinch_point(kappa):
    """A small L_y beside L_z between 1e-3 and 1e-4 of I_e, by the slow equations, on the upper parabola (h = 1)."""
    s = Spheroid(kappa)
    z = MOMENTUM * s.ie
    start = [0.0, 1e-30, z, z / s.ia]
    goals = [lambda _, y, goal=goal: y[2] - goal * s.ie for goal in (1e-3, 1e-4)]
    goals[-1].terminal = True
    run = solve_ivp(
        lambda _, y: s.slow(y), (0, z / (4 * pi * s.xc)), start, "LSODA", rtol=1e-10, atol=[1, 1e-45, 1e-12, 1e-12],
        events=goals,
    )  # fmt: skip
    (early,), (late,) = run.y_events
    found = log(late[1] / early[1]) / log(late[2] / early[2])
    assert_right(found, growth(kappa), tolerance=0.02 * abs(growth(kappa)))


def least_momentum(kappa, stokes):
    """Smallest |L|/I_e on the way past L = 0, root mean square over two azimuths of the axis."""
    s = Spheroid(kappa)
    z = MOMENTUM * s.ie
    # Rates of the Euler angles at which L is along the z axis of space.
    rates = 0.0, z / s.ie, z * cos(THETA) * (1 / s.ia - 1 / s.ie)
    times = stokes * np.linspace(0.0, 0.02, 2001)
    least = []
    for phi in (0.6, 1.2):
        rotation, omega = integrate(
            s.shape, stokes, (THETA, phi, 0.0), rates, times, tolerance=1e-8
        )
        least.append(
            np.linalg.norm(momentum_and_energy(s.shape, rotation, omega)[0], axis=1).min() / s.ie
        )
    return float(np.sqrt(np.mean(np.square(least))))


def test_misprint_width_of_the_pinch_point():
    """κ = 3: |L| falls far more slowly with St than St^−½."""
    exponent = log(least_momentum(3.0, 3e4) / least_momentum(3.0, 5e3)) / log(6)
    assert_misprint(-0.5, -1 / (1 - growth(3.0)), exponent, tolerance=0.1, gap=0.2)

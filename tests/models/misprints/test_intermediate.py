"""The paper's neighbourhood of the intermediate-axis rotation against first principles (docs/misprints.md).

The state is (y, L_z'). y = μ'δ = 1 - μδ is 0 where L² = 2EI₂, with the paper's μ = (2EI₃ - L²)/(L² - 2EI₁)
and δ = (I₂ - I₁)/(I₃ - I₂); L_z' = L_z + I₂/2 is 0 where the body turns about its middle axis at half the vorticity.
"""

from math import exp, log, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from oracle.first_principles import averaged_rates
from oracle.printed import Ellipsoid
from oracle.verdict import assert_misprint, assert_right

ELLIPSOID = Ellipsoid((1.0, 0.8, 0.5))
INERTIA, RESISTANCE = ELLIPSOID.shape.inertia, ELLIPSOID.shape.resistance
SIDES = pytest.mark.parametrize("side", [1, -1], ids=["L2>2EI2", "L2<2EI2"])
# y and L_z' at the start.
START, MOMENTUM_START = 0.05, 1e-4


def ordered(side):
    """(I₁, I₂, I₃) and (X₁, X₂, X₃), the suffixes 1 and 3 exchanged where L² < 2EI₂."""
    return INERTIA[::side], RESISTANCE[::side]


def forcing(side):
    """Coefficient c of −c/log(16/y) in dL_z'/dt₂ after `lzasymp`, y = μ'δ."""
    (i1, i2, i3), (x1, _, x3) = ordered(side)
    return 8 * pi * (i3 - i2) * (i2 - i1) * (x3 - x1) / (i2 * (i3 - i1))


def growth(side):
    """W of the paper: dy/dt₂ = 2W/log(16/y)."""
    (i1, i2, i3), (x1, _, x3) = INERTIA, RESISTANCE
    return side * 16 * pi * (x1 * (i2 - i1) / (i1 * i2) + x3 * (i3 - i2) / (i3 * i2))


def slow_rates_near(side, y):
    """dL_z/dt₂ and dμ/dt₂ at L = (0, 0, −I₂/2) and μδ = 1 − y from the brute-force average."""
    (i1, i2, i3), _ = ordered(side)
    mu = (1 - y) * (i3 - i2) / (i2 - i1)
    momentum2 = i2**2 / 4
    energy = momentum2 * (1 + mu) / (2 * (i3 + mu * i1))
    (_, _, z_rate), energy_rate = averaged_rates(
        ELLIPSOID.shape, [0, 0, -i2 / 2], energy, nodes=8192
    )
    numerator = energy_rate * momentum2 + energy * i2 * z_rate
    return z_rate, 2 * (i3 - i1) * numerator / (momentum2 - 2 * energy * i1) ** 2


@SIDES
def test_right_asymptotic_rates(side):
    """`lzasymp` and `muasymp` at L_z' = 0, both sides by the printed exchange: the relative error falls with y."""
    (i1, i2, i3), (x1, _, x3) = ordered(side)
    delta = (i2 - i1) / (i3 - i2)
    for y, tolerance in ((1e-3, 2e-2), (1e-5, 3e-4)):
        z_rate, mu_rate = slow_rates_near(side, y)
        slowness = 1 / log(4 / sqrt(y))
        printed_mu = 16 * pi / (i2 * delta) * (x1 * (i2 - i1) / i1 + x3 * (i3 - i2) / i3) * slowness
        assert -forcing(side) * slowness / 2 == pytest.approx(z_rate, rel=tolerance)
        assert printed_mu == pytest.approx(-mu_rate, rel=tolerance)
        assert 2 * growth(side) / log(16 / y) == pytest.approx(printed_mu * delta, rel=1e-12)


def test_right_linear_part_of_the_asymptotic_rate():
    a, _, _, _, _ = ELLIPSOID.coefficients(np.array([0.0, 1.0, 0.0]))
    assert_right(RESISTANCE[1] / INERTIA[1], a, tolerance=1e-14)


def duration(side):
    """Half the time in which y leaves START for 0 (L² < 2EI₂) or for 2·START (L² > 2EI₂)."""
    end = 0 if side < 0 else 2 * START
    return quad(lambda y: log(16 / y), START, end)[0] / (2 * growth(side)) / 2


def trajectory(side, times):
    """Direct solution (y, L_z') of the asymptotic equations from y = START and L_z' = MOMENTUM_START."""
    damping = 8 * pi * RESISTANCE[1] / INERTIA[1]

    def field(_, state):
        y, z = state
        return [2 * growth(side) / log(16 / y), -damping * z - forcing(side) / log(16 / y)]

    return solve_ivp(
        field, (0, times[-1]), [START, MOMENTUM_START], "DOP853", times, rtol=1e-12, atol=1e-15
    ).y


def implicit_y(side, time, linear):
    """Root of y log(16/y) + linear·y = its starting value + 2Wt₂."""

    def function(y):
        return y * log(16 / y) + linear * y

    target = function(START) + 2 * growth(side) * time
    return brentq(lambda y: function(y) - target, 1e-12, 1.0, xtol=1e-15)


@SIDES
def test_misprint_closed_form_of_mu(side):
    """`muassol` is the leading order; the exact integral has y log(16/y) + y."""
    times = np.linspace(0, duration(side), 4)[1:]
    truth = trajectory(side, times)[0]
    printed, corrected = ([implicit_y(side, t, linear) for t in times] for linear in (0, 1))
    assert_misprint(printed / truth, corrected / truth, np.ones(3), tolerance=1e-9)


@SIDES
def test_misprint_sign_of_the_finite_time(side):
    """t₂₀ as printed, ±(y₀/2W) log(y₀/16) with W signed as well, is negative on both sides (and lacks y₀/2W)."""
    truth = quad(lambda y: log(16 / y), 0, START)[0] / (2 * abs(growth(side)))
    printed = side * START / (2 * growth(side)) * log(START / 16)
    corrected = -printed + START / (2 * abs(growth(side)))
    assert_misprint(printed / truth, corrected / truth, 1.0, tolerance=1e-10)
    assert printed < 0


def momentum_solution(side, time, *, sign=1, dummy=True, offset=START):
    """`lzassol` with its three disputed places: the sign of Ŵ, t₂ or t₂' in the denominator, and μ₀'δ there."""
    rate, w = 8 * pi * RESISTANCE[1] / INERTIA[1], growth(side)

    def integrand(inner):
        y = implicit_y(side, inner, 1)
        denominator = START * log(16 / START) + offset + 2 * w * (inner if dummy else time) - y
        return exp(rate * inner) * y / denominator

    integral = quad(integrand, 0, time, epsrel=1e-11)[0]
    return exp(-rate * time) * (MOMENTUM_START - sign * forcing(side) * integral)


@SIDES
@pytest.mark.parametrize(
    "printed",
    [{"dummy": False}, {"offset": 0.0}],
    ids=["variable of integration", "missing initial term"],
)
def test_misprint_closed_form_of_momentum(side, printed):
    time = duration(side)
    truth = trajectory(side, np.array([time]))[1, 0]
    wrong, right = momentum_solution(side, time, **printed), momentum_solution(side, time)
    assert_misprint(wrong / truth, right / truth, 1.0, tolerance=1e-8)


@SIDES
def test_misprint_sign_of_w_hat(side):
    """Ŵ, unchanged by the exchange of 1 and 3, carries no ±: with it the side L² < 2EI₂ comes out wrong."""
    (i1, i2, i3), (x1, _, x3) = INERTIA, RESISTANCE
    magnitude = 8 * pi * (x1 - x3) * (i2 - i3) * (i1 - i2) / (i2 * (i1 - i3))
    assert_right(magnitude, forcing(side), tolerance=1e-13)
    time = duration(side)
    truth = trajectory(side, np.array([time]))[1, 0]
    assert_right(momentum_solution(side, time) / truth, 1.0, tolerance=1e-8)
    if side < 0:
        assert abs(momentum_solution(side, time, sign=side) / truth - 1) > 0.1


@SIDES
def test_right_passage_of_the_intermediate_point(side):
    """Below 2EI₂ the slow motion falls onto the intermediate rotation, above it leaves: W has the sign of the side."""
    _, mu_rate = slow_rates_near(side, 1e-3)
    assert np.sign(-mu_rate) == side == np.sign(growth(side))

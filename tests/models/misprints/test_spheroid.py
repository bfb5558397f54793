"""The paper's slow dynamics of the spheroid against first principles (docs/misprints.md)."""

from math import cos, pi, sin

import numpy as np
import pytest

from oracle.first_principles import (
    averaged_rates,
    body_rates,
    euler_top_ensemble,
    jeffery,
    momentum_and_energy,
    rotation_from_euler,
    slow_rates,
)
from oracle.printed import Spheroid, jacobian
from oracle.verdict import assert_misprint, assert_right

KAPPAS = pytest.mark.parametrize("kappa", [0.4, 2.0])
MOMENTUM = np.array([0.21, -0.34, -0.27])
ANGLES, RATES = (0.7, 0.4, 0.0), (0.6, -0.8, 0.5)


@KAPPAS
def test_right_evolution_before_averaging(kappa):
    """`levosx`–`evose`, and `lxs2`, `lzs2`, `ns2` made from them."""
    s = Spheroid(kappa)
    rotation, omega = rotation_from_euler(*ANGLES), body_rates(ANGLES, RATES)
    slip = omega - jeffery(s.shape.semi_axes, rotation)
    torque = np.array([s.yc, s.yc, s.xc]) * slip
    rate, power = slow_rates(s.shape, rotation, omega)
    assert_right(
        -8 * pi * (rotation[0] * torque[0] + rotation[1] * torque[1] + rotation[2] * torque[2]),
        rate,
    )
    assert_right(-8 * pi * torque @ omega, power)
    (x, y, z), _ = momentum_and_energy(s.shape, rotation, omega)
    assert_right(rotation @ [x, y, z] / s.shape.inertia, omega, tolerance=1e-13)
    st, ct, sf, cf = sin(ANGLES[0]), cos(ANGLES[0]), sin(ANGLES[1]), cos(ANGLES[1])
    gyration, eta = s.xc - s.yc * s.ia / s.ie, omega[2]
    printed_x = s.yc / s.ie * x + gyration * eta * st * sf + gyration * ct * st * sf / 2
    printed_z = (
        s.yc / s.ie * z
        + gyration * eta * ct
        + s.xc / 2 * ct**2
        + s.yc * s.ia / (2 * s.ie) * st**2 * (sf**2 + kappa**2 * cf**2)
    )
    assert_right(-8 * pi * np.array([printed_x, printed_z]), rate[[0, 2]])
    assert_right(-8 * pi * s.xc / s.ia * (eta + ct / 2), -8 * pi * torque[2] / s.ia)


@KAPPAS
def test_misprint_gradient_momentum_rate(kappa):
    """`lys2`; `lyms` and `lymsavg` repeat it."""
    s = Spheroid(kappa)
    rotation, omega = rotation_from_euler(*ANGLES), body_rates(ANGLES, RATES)
    (_, y, _), _ = momentum_and_energy(s.shape, rotation, omega)
    truth = slow_rates(s.shape, rotation, omega)[0][1]
    st, ct, cf = sin(ANGLES[0]), cos(ANGLES[0]), cos(ANGLES[1])

    def rate(factor):
        disputed = s.xc - factor * s.yc * (1 - s.ia / (2 * s.ie))
        gyration = (s.xc - s.yc * s.ia / s.ie) * omega[2]
        return -8 * pi * (s.yc / s.ie * y - gyration * st * cf - disputed * ct * st * cf / 2)

    assert_misprint(rate(1), rate(2), truth)


def ensemble(s, eta):
    return euler_top_ensemble(s.shape.inertia, MOMENTUM, s.energy(MOMENTUM, eta))


@KAPPAS
def test_right_table_of_spheroid_averages(kappa):
    s = Spheroid(kappa)
    size = np.linalg.norm(MOMENTUM)
    h = 0.6
    rotation, _, _, weights = ensemble(s, h * size / s.ia)
    axis = rotation[:, 2]
    x, y, z = MOMENTUM / size
    across2, g2 = x * x + y * y, 1 - h * h
    printed_first = [x * h, y * h, z * h]
    printed_square = [
        x * x * h * h + y * y * g2 / (2 * across2) + x * x * z * z * g2 / (2 * across2),
        y * y * h * h + x * x * g2 / (2 * across2) + y * y * z * z * g2 / (2 * across2),
        z * z * h * h + across2 * g2 / 2,
    ]
    printed_product = [z * x * h * h - z * x * g2 / 2, z * y * h * h - z * y * g2 / 2]
    assert_right(printed_first, weights @ axis, tolerance=1e-13)
    assert_right(printed_square, weights @ axis**2, tolerance=1e-13)
    assert_right(printed_product, weights @ (axis[:, :2] * axis[:, 2:]), tolerance=1e-13)


@KAPPAS
@pytest.mark.parametrize("h", [0.02, 0.4, 0.95])
def test_right_slow_equations(kappa, h):
    s = Spheroid(kappa)
    eta = h * np.linalg.norm(MOMENTUM) / s.ia
    momentum_rate, energy_rate = averaged_rates(s.shape, MOMENTUM, s.energy(MOMENTUM, eta))
    printed = s.slow([*MOMENTUM, eta])
    assert_right(printed[:3], momentum_rate, tolerance=1e-12)
    chain = MOMENTUM @ printed[:3] / s.ie - s.ia * (s.ia - s.ie) * eta * printed[3] / s.ie
    assert_right(chain, energy_rate, tolerance=1e-12)


FIXED_POINTS = pytest.mark.parametrize(
    ("mode", "eta"), [("spinning", 0.5), ("spinning", -0.5), ("tumbling", 0.0)]
)


@KAPPAS
@FIXED_POINTS
def test_misprint_fixed_points_have_five_entries(kappa, mode, eta):
    s = Spheroid(kappa)
    moment = s.ia if mode == "spinning" else s.ie
    printed = np.array([0, 0, 0, -moment / 2, eta])
    with np.errstate(all="ignore"):
        assert_misprint(s.slow(printed[:4]), s.slow(printed[1:]), np.zeros(4), tolerance=1e-13)
    assert s.energy(printed[1:4], eta) == pytest.approx(moment / 8, rel=1e-14)


@KAPPAS
@FIXED_POINTS
def test_right_spheroid_eigenvalues(kappa, mode, eta):
    s = Spheroid(kappa)
    xc, yc, ia, ie, k2 = s.xc, s.yc, s.ia, s.ie, kappa**2
    if mode == "tumbling":
        x_rate, y_rate = (-8 * pi / ie * (yc * f / (k2 + 1) + xc / 2) for f in (k2, 1))
        rest = [-8 * pi * yc / ie, -8 * pi * xc / ia * (1 - ia / ie)]
    else:
        x_rate, y_rate = (-16 * pi * yc * f / (ia * (k2 + 1)) for f in (1, k2))
        rest = [-8 * pi * xc / ia, -16 * pi * yc / ia * (ia / ie - 1)]
    matrix = jacobian(s.slow, [0, 0, -(ie if mode == "tumbling" else ia) / 2, eta])
    assert_right([x_rate, y_rate], np.diag(matrix)[:2], tolerance=1e-10)
    assert_right(matrix[:2] - np.diag(np.diag(matrix))[:2], np.zeros((2, 4)), tolerance=1e-10)
    assert_right(np.sort(rest), np.sort(np.linalg.eigvals(matrix[2:, 2:])), tolerance=1e-10)
    assert (rest[1] > 0) == ((kappa < 1) == (mode == "tumbling"))


@KAPPAS
def test_right_large_momentum_limit(kappa):
    s = Spheroid(kappa)
    momentum, h = 1e9 * MOMENTUM, 0.6
    eta = h * np.linalg.norm(momentum) / s.ia
    decay = s.xc * h**2 / s.ia + s.yc * (1 - h**2) / s.ie
    printed = -8 * pi * np.array([*(momentum * decay), s.xc * eta / s.ia])
    slow = s.slow([*momentum, eta])
    assert_right(printed, slow, tolerance=1e-8)
    axial, transverse = s.ia * eta, np.sqrt(momentum @ momentum - (s.ia * eta) ** 2)
    transverse_rate = (momentum @ slow[:3] - s.ia**2 * eta * slow[3]) / transverse
    assert_right(s.ia * slow[3] / axial * 2, -16 * pi * s.xc / s.ia, tolerance=1e-8)
    assert_right(transverse_rate / transverse * 2, -16 * pi * s.yc / s.ie, tolerance=1e-8)


@KAPPAS
def test_misprint_small_vorticity_momentum_keeps_the_cone(kappa):
    """At L_z = 0 the rates of L_x, L_y and η simplify as printed, but L_z is driven away at a finite rate."""
    s = Spheroid(kappa)
    momentum, h = np.array([0.21, -0.34, 0.0]), 0.6
    eta = h * np.linalg.norm(momentum) / s.ia
    slow = s.slow([*momentum, eta])
    decay = s.xc * h**2 / s.ia + s.yc * (1 - h**2) / s.ie
    assert_right(slow[[0, 1, 3]], -8 * pi * np.array([*(momentum[:2] * decay), s.xc * eta / s.ia]))
    assert_right(slow[2], averaged_rates(s.shape, momentum, s.energy(momentum, eta))[0][2])
    assert slow[2] < -1

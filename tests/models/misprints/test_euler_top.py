"""The paper's Euler top (St = ∞) against first principles (docs/misprints.md)."""

from math import pi

import numpy as np
import pytest
from mpmath import mp
from scipy.special import ellipj, ellipk

from oracle.first_principles import (
    aligned_frame,
    body,
    integrate,
    momentum_and_energy,
    polhode,
    rotation_from_euler,
)
from oracle.verdict import assert_misprint, assert_right, deviation

SHAPE = body((1.0, 0.8, 0.5))
MOMENTUM = 1.3
SIDES = pytest.mark.parametrize("exchange", [False, True], ids=["L2>2EI2", "L2<2EI2"])


class EulerTop:
    """The printed Euler-top solution, with the suffixes 1 and 3 exchanged where L² < 2EI₂."""

    def __init__(self, exchange):
        self.order = [2, 1, 0] if exchange else [0, 1, 2]
        self.moments = i1, i2, i3 = SHAPE.inertia[self.order]
        self.energy = MOMENTUM**2 / 2 * (0.7 / i3 + 0.3 / i2)
        # With the suffixes exchanged both are negative, as are the differences of moments under the roots.
        excess, deficit = 2 * self.energy * i3 - MOMENTUM**2, MOMENTUM**2 - 2 * self.energy * i1
        self.amplitudes = np.sqrt(
            [excess / (i1 * (i3 - i1)), excess / (i2 * (i3 - i2)), deficit / (i3 * (i3 - i1))]
        )
        self.rate = np.sqrt((i3 - i2) * deficit / (i1 * i2 * i3))
        self.parameter = (i2 - i1) * excess / ((i3 - i2) * deficit)
        self.quarter = float(ellipk(self.parameter))
        self.zeta_target = np.sqrt(i3 * deficit / (i1 * excess))

    def omega(self, time):
        """Printed angular velocity (n, 3) in body axes."""
        sn, cn, dn, _ = ellipj(self.rate * np.asarray(time), self.parameter)
        result = np.empty((*np.shape(time), 3))
        result[..., self.order] = np.stack([cn, sn, dn], axis=-1) * self.amplitudes
        return result

    def motion(self, times):
        """Direct solution of the free top with L along z, from the printed ω at the first time."""
        momentum = SHAPE.inertia * self.omega(times[0])
        start = aligned_frame(momentum)
        return _free_motion(start, times)


def _free_motion(start, times):
    theta, phi, psi = (
        np.arccos(start[2, 2]),
        np.arctan2(start[2, 0], -start[2, 1]),
        np.arctan2(start[0, 2], start[1, 2]),
    )
    omega = start[:, 2] * MOMENTUM / SHAPE.inertia
    precession = (omega[0] * np.sin(psi) + omega[1] * np.cos(psi)) / np.sin(theta)
    nutation = omega[0] * np.cos(psi) - omega[1] * np.sin(psi)
    rates = (nutation, precession, omega[2] - precession * np.cos(theta))
    return integrate(SHAPE, np.inf, (theta, phi, psi), rates, times, tolerance=1e-12)


@SIDES
def test_right_euler_top_angular_velocity(exchange):
    top = EulerTop(exchange)
    times = np.linspace(0.0, 9.0, 10)
    _, omega = top.motion(times)
    assert_right(top.omega(times), omega, tolerance=1e-9)
    moments = SHAPE.inertia
    assert_right(np.sum((moments * omega) ** 2, axis=1), MOMENTUM**2, tolerance=1e-9)
    assert_right(np.sum(moments * omega**2, axis=1) / 2, top.energy, tolerance=1e-9)
    assert 0 < top.parameter < 1


@SIDES
def test_right_euler_equations(exchange):
    top = EulerTop(exchange)
    step = 1e-3
    time = 0.8
    derivative = (
        8 * (top.omega(time + step) - top.omega(time - step))
        - (top.omega(time + 2 * step) - top.omega(time - 2 * step))
    ) / (12 * step)
    omega, moments = top.omega(time), SHAPE.inertia
    printed = [
        moments[i] * derivative[i] + (moments[k] - moments[j]) * omega[j] * omega[k]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    ]
    assert_right(printed, np.zeros(3), tolerance=1e-10)


@SIDES
def test_misprint_period_in_time(exchange):
    top = EulerTop(exchange)
    period = polhode(SHAPE.inertia, MOMENTUM, top.energy).period
    assert_misprint(4 * top.quarter, 4 * top.quarter / top.rate, period, tolerance=1e-12)


@SIDES
def test_misprint_spin_angle_period(exchange):
    top = EulerTop(exchange)
    half = 2 * top.quarter / top.rate
    first, _, third = top.order

    def spin_angle(time):
        moment = SHAPE.inertia * top.omega(time)
        return np.arctan2(moment[..., first], moment[..., 1])

    times = np.linspace(0.1, 1.7, 7)
    change = spin_angle(times + half) - spin_angle(times)
    assert_misprint(np.cos(change), -np.cos(change), np.ones(7), tolerance=1e-10)
    assert_right(top.omega(times + half)[:, third], top.omega(times)[:, third], tolerance=1e-11)


@SIDES
def test_right_nutation_and_spin_angle(exchange):
    top = EulerTop(exchange)
    i1, i2, i3 = top.moments
    times = np.linspace(0.3, 9.0, 10)
    sn, cn, dn, _ = ellipj(top.rate * times, top.parameter)
    rotation = top.motion(np.concatenate([[0.0], times]))[0][1:, top.order, 2]
    deficit = MOMENTUM**2 - 2 * top.energy * i1
    assert_right(
        np.sqrt(i3 * deficit / (MOMENTUM**2 * (i3 - i1))) * dn, rotation[:, 2], tolerance=1e-9
    )
    tangent = np.sqrt(i1 * (i3 - i2) / (i2 * (i3 - i1))) * cn / sn
    assert_right(tangent, rotation[:, 0] / rotation[:, 1], tolerance=1e-8)


def azimuth(top, times):
    """Precession angle of the enclosed axis about L (along z) since the first of `times`, from the direct solution."""
    rotation, _ = top.motion(times)
    axis = rotation[:, top.order[2]]
    angle = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    return angle - angle[0]


def printed_precession(top, times, *, sign):
    """φ_LO of `eq:prec1` and `eq:prec2` (T the period in t, ϑ₄ of period one) with ζ → sign·ζ, and its linear part."""
    parameter, quarter = mp.mpf(top.parameter), mp.mpf(top.quarter)
    nome = mp.exp(-mp.pi * mp.ellipk(1 - parameter) / quarter)
    zeta = sign * mp.ellipf(mp.atan(top.zeta_target), 1 - parameter) / (2 * quarter)
    assert (
        abs(mp.ellipfun("sn", 2j * zeta * quarter, m=parameter) - sign * 1j * top.zeta_target)
        < 1e-12
    )
    period = 4 * quarter / top.rate

    def theta4(value, order=0):
        return mp.jtheta(4, mp.pi * value, nome, order) * mp.pi**order

    rate = MOMENTUM / top.moments[0] - (2j / period * theta4(1j * zeta, 1) / theta4(1j * zeta)).real
    ratios = [
        theta4(2 * t / period - 1j * zeta) / theta4(2 * t / period + 1j * zeta) for t in times
    ]
    periodic = np.unwrap([float(mp.arg(ratio)) for ratio in ratios]) / 2
    return periodic + float(rate) * times, float(rate), periodic


@SIDES
def test_misprint_precession_angle(exchange):
    top = EulerTop(exchange)
    times = np.linspace(0.0, 8.0, 33)
    truth = azimuth(top, times)
    printed, printed_rate, _ = printed_precession(top, times, sign=1)
    other, other_rate, _ = printed_precession(top, times, sign=-1)
    bound = MOMENTUM / top.moments[0]
    wrong, right = (other, printed) if exchange else (printed, other)
    assert_misprint(wrong, right, truth, tolerance=1e-9)
    assert printed_rate > bound > other_rate


@SIDES
def test_misprint_assembled_rotation(exchange):
    """The matrix of all three angles: 1 ↔ 3 makes the axes left-handed, so that ψ_LO and x' change sign with it."""
    top = EulerTop(exchange)
    times = np.linspace(0.0, 8.0, 33)
    truth = top.motion(times)[0][:, top.order]
    precession, _, _ = printed_precession(top, times, sign=1 if exchange else -1)
    phi = np.arctan2(truth[0, 2, 0], -truth[0, 2, 1]) + precession
    along = SHAPE.inertia[top.order] * top.omega(times)[:, top.order] / MOMENTUM
    theta, psi = np.arccos(along[:, 2]), np.arctan2(along[:, 0], along[:, 1])

    def assembled(sign):
        angles = zip(theta, phi, sign * psi, strict=True)
        return np.array([np.diag([sign, 1, 1]) @ rotation_from_euler(*each) for each in angles])

    if exchange:
        assert_misprint(assembled(1), assembled(-1), truth, tolerance=1e-8, gap=0.5)
    else:
        assert_right(assembled(1), truth, tolerance=1e-8)


@SIDES
def test_misprint_period_of_the_periodic_precession(exchange):
    top = EulerTop(exchange)
    half = 2 * top.quarter / top.rate
    times = np.array([0.0, 0.4, 1.1])
    periodic = printed_precession(
        top, np.concatenate([times, times + half]), sign=1 if exchange else -1
    )[2]
    assert_right(np.exp(2j * periodic[3:]), np.exp(2j * periodic[:3]), tolerance=1e-12)
    truth = azimuth(top, np.concatenate([times, times + half, [2 * half]]))
    assert_right(truth[3:6] - truth[:3], np.full(3, truth[3]), tolerance=1e-9)


@SIDES
def test_misprint_precession_angle_alone_has_no_period(exchange):
    top = EulerTop(exchange)
    rate = printed_precession(top, np.array([0.0]), sign=1 if exchange else -1)[1]
    full_turn = 2 * pi / rate
    assert full_turn > 1
    times = np.array([0.0, 0.5, 1.0])
    truth = azimuth(top, np.sort(np.concatenate([times, times + full_turn])))
    gain = truth[3:] - truth[:3]
    assert deviation(gain, np.full(3, 2 * pi)) > 1e-3


def printed_aligned_axes(vector):
    """The matrix of `fodij` for L = vector."""
    x, y, z = vector
    size, across = np.linalg.norm(vector), np.hypot(x, y)
    return np.array(
        [
            [y / across, x * z / (size * across), x / size],
            [-x / across, y * z / (size * across), y / size],
            [0, -across / size, z / size],
        ]
    )


def test_right_angular_momentum_aligned_axes():
    vector = np.array([0.3, -0.5, 0.9])
    printed = printed_aligned_axes(vector)
    assert_right(printed @ printed.T, np.eye(3), tolerance=1e-14)
    assert np.linalg.det(printed) == pytest.approx(1, rel=1e-14)
    assert_right(printed[:, 2], vector / np.linalg.norm(vector), tolerance=1e-14)


@pytest.mark.parametrize("kappa", [0.5, 2.3])
def test_right_axis_of_the_symmetric_top_in_space(kappa):
    """`alphatranss` with `fodij`: α·(h̄ sin χ, −h̄ cos χ, h), χ = Lt/I_e + φ₀, for L in a general direction."""
    shape = body((1, 1, kappa))
    times = np.linspace(0.0, 6.0, 7)
    rotation, omega = integrate(shape, np.inf, (0.8, 0.2, 0.0), (0.6, -0.8, 0.5), times)
    momentum, _ = momentum_and_energy(shape, rotation[0], omega[0])
    size, alpha = np.linalg.norm(momentum), printed_aligned_axes(momentum)
    start = rotation[0, 2] @ alpha
    h, chi = (
        shape.inertia[2] * omega[0, 2] / size,
        size * times / shape.inertia[0] + np.arctan2(start[0], -start[1]),
    )
    across = np.sqrt(1 - h * h)
    printed = alpha @ [across * np.sin(chi), -across * np.cos(chi), np.full_like(chi, h)]
    assert_right(printed.T, rotation[:, 2], tolerance=1e-9)


@pytest.mark.parametrize("kappa", [0.5, 2.3])
def test_right_symmetric_top(kappa):
    shape = body((1, 1, kappa))
    equatorial, axial = shape.inertia[1:]
    momentum, theta = 0.9, 0.8
    eta = momentum * np.cos(theta) / axial
    rates = (0.0, momentum / equatorial, -(axial - equatorial) * eta / equatorial)
    times = np.linspace(0.0, 6.0, 7)
    rotation, omega = integrate(shape, np.inf, (theta, 0.2, 0.0), rates, times)
    expected = np.array(
        [rotation_from_euler(theta, 0.2 + rates[1] * t, rates[2] * t) for t in times]
    )
    assert_right(expected, rotation, tolerance=1e-9)
    energy = (momentum**2 - axial * (axial - equatorial) * eta**2) / (2 * equatorial)
    assert_right(energy, np.sum(shape.inertia * omega[-1] ** 2) / 2, tolerance=1e-9)
    amplitude = np.sqrt((2 * energy * axial - momentum**2) / (equatorial * (axial - equatorial)))
    tau = (axial - equatorial) * eta / equatorial * times + pi / 2
    printed = np.column_stack([amplitude * np.cos(tau), amplitude * np.sin(tau), np.full(7, eta)])
    assert_right(printed, omega, tolerance=1e-9)


def test_misprint_prolate_axis_labels():
    """With I₂ = I₃ = I_e and I₁ = I_a the constant component is ω₁, not ω₃."""
    axial, equatorial, eta, time = 0.4, 1.0, 0.7, 0.9
    momentum = 0.9
    amplitude = np.sqrt(momentum**2 - (axial * eta) ** 2) / equatorial
    tau = (axial - equatorial) * eta * time / equatorial
    moments = np.array([axial, equatorial, equatorial])
    energy = (momentum**2 - axial * (axial - equatorial) * eta**2) / (2 * equatorial)
    printed = np.array([amplitude * np.cos(tau), amplitude * np.sin(tau), eta])
    exchanged = printed[::-1]
    assert_misprint(moments @ printed**2 / 2, moments @ exchanged**2 / 2, energy, tolerance=1e-13)


@pytest.mark.parametrize(
    ("kappa", "between"), [(2.3, True), (0.5, False)], ids=["prolate", "oblate"]
)
def test_right_order_of_momentum_velocity_and_axis(kappa, between):
    """Ω lies between L and the axis for a prolate, L between Ω and the axis for an oblate spheroid."""
    omega = np.array([0.0, 0.6, 0.8])
    momentum = body((1, 1, kappa)).inertia * omega
    tilt = np.arctan2(omega[1], omega[2]), np.arctan2(momentum[1], momentum[2])
    assert (tilt[0] < tilt[1]) == between

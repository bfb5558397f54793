"""The paper's Jeffery top (St = 0) against first principles (docs/misprints.md)."""

from math import atan2, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from oracle.first_principles import (
    SHEAR,
    jeffery,
    rotation_from_euler,
    torque_free_angular_velocity,
)
from oracle.verdict import assert_misprint, assert_right

TRIAXIAL = (1.0, 0.8, 0.5)
ORIENTATIONS = [(0.7, 0.4, 1.1), (2.2, -1.3, 0.2), (1.5, 3.0, -2.0)]


@pytest.mark.parametrize("axes", [TRIAXIAL, (0.6, 1.0, 0.3), (1, 1, 3)])
@pytest.mark.parametrize("angles", ORIENTATIONS)
def test_right_jeffery_angular_velocity(axes, angles):
    t = rotation_from_euler(*angles)
    a2, b2, c2 = np.square(axes)
    printed = [
        (b2 * t[1, 1] * t[2, 0] - c2 * t[2, 1] * t[1, 0]) / (b2 + c2),
        (c2 * t[2, 1] * t[0, 0] - a2 * t[0, 1] * t[2, 0]) / (c2 + a2),
        (a2 * t[0, 1] * t[1, 0] - b2 * t[1, 1] * t[0, 0]) / (a2 + b2),
    ]
    truth = torque_free_angular_velocity(np.asarray(axes), t @ SHEAR @ t.T)
    assert_right(printed, truth, tolerance=1e-12)
    assert_right(jeffery(axes, t), truth, tolerance=1e-12)


def spheroid_rates(kappa, theta, phi):
    """Euler-angle rates (θ̇, φ̇, ψ̇) of the inertialess spheroid from its angular velocity."""
    omega = jeffery((1, 1, kappa), rotation_from_euler(theta, phi, 0.0))
    precession = omega[1] / np.sin(theta)
    return omega[0], precession, omega[2] - precession * np.cos(theta)


@pytest.mark.parametrize("kappa", [0.4, 3.0])
def test_right_spheroid_jeffery_components(kappa):
    theta, phi = 0.7, 0.4
    printed = [
        -(kappa**2 - 1) * np.sin(2 * theta) * np.sin(2 * phi) / (4 * (kappa**2 + 1)),
        -(np.sin(phi) ** 2 + kappa**2 * np.cos(phi) ** 2) / (kappa**2 + 1) * np.sin(theta),
        -np.cos(theta) / 2,
    ]
    assert_right(
        printed, jeffery((1, 1, kappa), rotation_from_euler(theta, phi, 0.0)), tolerance=1e-14
    )


@pytest.mark.parametrize("kappa", [0.4, 3.0])
@pytest.mark.parametrize(("theta", "phi"), [(0.7, 0.4), (2.0, -1.0)])
def test_misprint_jeffery_rates_sign(kappa, theta, phi):
    printed_precession = (np.sin(phi) ** 2 + kappa**2 * np.cos(phi) ** 2) / (kappa**2 + 1)
    printed_nutation = (kappa**2 - 1) * np.sin(2 * phi) * np.sin(2 * theta) / (4 * (kappa**2 + 1))
    nutation, precession, _ = spheroid_rates(kappa, theta, phi)
    assert_misprint(printed_precession, -printed_precession, precession)
    assert_misprint(printed_nutation, -printed_nutation, nutation)


def jeffery_orbit(kappa, constant, times, exponent):
    """(φ, θ) of `phitraj` and `thetraj` with the exponent in question; φ = 0 at t = 0."""
    phase = times / (kappa + 1 / kappa)
    phi = np.array([-atan2(kappa * np.sin(x), np.cos(x)) for x in phase])
    theta = np.arctan(
        constant * kappa / (np.sin(phi) ** 2 + kappa**2 * np.cos(phi) ** 2) ** exponent
    )
    return np.array([theta, phi])


@pytest.mark.parametrize("kappa", [0.4, 3.0])
@pytest.mark.parametrize("constant", [0.3, 2.0])
def test_misprint_jeffery_orbit_exponent(kappa, constant):
    times = np.linspace(0, 1.5 * (kappa + 1 / kappa), 12)
    start = jeffery_orbit(kappa, constant, times[:1], 0.5)[:, 0]
    truth = solve_ivp(
        lambda _, y: spheroid_rates(kappa, *y)[:2],
        (0, times[-1]),
        start,
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-13,
    ).y
    printed, corrected = (jeffery_orbit(kappa, constant, times, exponent) for exponent in (2, 0.5))
    assert_right(printed[1], truth[1], tolerance=1e-10)
    assert_misprint(printed[0], corrected[0], truth[0], tolerance=1e-10)


@pytest.mark.parametrize("axes", [TRIAXIAL, (0.5, 0.8, 1.0), (1, 1, 3)])
def test_misprint_precession_increases(axes):
    times = np.linspace(0, 60, 601)
    rotation = inertialess_motion(axes, rotation_from_euler(1.0, 0.5, 0.3), times)
    phi = np.unwrap(np.arctan2(rotation[:, 2, 0], -rotation[:, 2, 1]))
    assert phi[-1] - phi[0] < -2 * pi


def inertialess_motion(axes, start, times):
    def field(_, state):
        rotation = state.reshape(3, 3)
        return -np.cross(jeffery(axes, rotation), rotation.T).T.ravel()

    solution = solve_ivp(
        field, (times[0], times[-1]), start.ravel(), "DOP853", times, rtol=1e-11, atol=1e-13
    )
    return solution.y.T.reshape(-1, 3, 3)


@pytest.mark.parametrize(
    ("theta", "psi", "aligned"),
    [(0.0, 0.0, 2), (pi / 2, 0.0, 1), (pi / 2, pi / 2, 0)],
    ids=["z'", "y'", "x'"],
)
def test_misprint_length_order_of_poincare_sections(theta, psi, aligned):
    assert abs(rotation_from_euler(theta, 0.3, psi)[aligned, 2]) == pytest.approx(1, abs=1e-15)
    printed = {0.0: {0.0: "longest"}, pi / 2: {0.0: "intermediate", pi / 2: "shortest"}}[theta][psi]
    increasing, decreasing = (
        ("shortest", "intermediate", "longest"),
        ("longest", "intermediate", "shortest"),
    )
    assert printed == increasing[aligned]
    assert (printed == decreasing[aligned]) == (aligned == 1)


def tilt_multipliers(axes, aligned):
    """Multipliers of a small tilt of the vorticity-aligned axis over half a turn (hyperbolic if real and not ±1)."""
    order = [(aligned + 1) % 3, (aligned + 2) % 3, aligned]
    axes = np.asarray(axes)[order]
    half_period = pi * (axes[0] / axes[1] + axes[1] / axes[0])
    step = 1e-5
    before, after = np.empty((2, 2)), np.empty((2, 2))
    for column, psi in enumerate((0.0, pi / 2)):
        start = rotation_from_euler(step, -psi, psi)
        before[:, column] = start[2, :2]
        after[:, column] = inertialess_motion(axes, start, np.array([0.0, half_period]))[-1, 2, :2]
    return np.linalg.eigvals(after @ np.linalg.inv(before))


@pytest.mark.parametrize(
    ("axes", "saddle"),
    [
        ((1, 1 / 10, 1 / 20), 2),
        ((1, 0.4, 1 / 3), 2),
        ((1, 1 / 2, 1 / 20), 0),
        ((1, 2 / 2.1, 1 / 2.1), 0),
    ],
    ids=["slender-prolate", "fat-prolate", "flat-oblate", "fat-oblate"],
)
def test_misprint_saddle_of_poincare_sections(axes, saddle):
    for aligned in range(3):
        size = np.abs(tilt_multipliers(axes, aligned))
        assert np.prod(size) == pytest.approx(1, rel=1e-4)
        assert (size.max() > 1.05) == (aligned == saddle)


@pytest.mark.parametrize("aligned", [0, 1, 2])
def test_right_aligned_rotation_like_a_spheroid(aligned):
    rotation = rotation_from_euler(0.0, 0.8, 0.0)
    rotation = np.roll(rotation, aligned + 1, axis=0)
    axes = np.array(TRIAXIAL)
    j, k = (aligned + 1) % 3, (aligned + 2) % 3
    ratio = axes[j] / axes[k]
    rate = -(np.cos(0.8) ** 2 + ratio**2 * np.sin(0.8) ** 2) / (1 + ratio**2)
    stretched = np.where(np.arange(3) == aligned, 7.0, axes)
    assert_right(jeffery(axes, rotation)[aligned], rate, tolerance=1e-14)
    assert_right(jeffery(stretched, rotation), jeffery(axes, rotation), tolerance=1e-14)


@pytest.mark.parametrize(
    ("kappa", "slowest"), [(3.0, pi / 2), (0.4, 0.0)], ids=["prolate: flow", "oblate: gradient"]
)
def test_right_slowest_tumbling_orientation(kappa, slowest):
    angles = np.arange(0, pi, pi / 180)
    rates = [abs(spheroid_rates(kappa, pi / 2, phi)[1]) for phi in angles]
    assert angles[np.argmin(rates)] == pytest.approx(slowest)

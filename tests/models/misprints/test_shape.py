"""The paper's introduction and governing equations against first principles (docs/misprints.md)."""

from math import acos, acosh, log, pi, sqrt

import numpy as np
import pytest
from scipy.special import elliprd

from oracle.first_principles import (
    CYCLIC,
    body,
    body_rates,
    integrate,
    jeffery,
    rotation_from_euler,
    torque_free_angular_velocity,
)
from oracle.verdict import assert_misprint, assert_right, deviation

ANGLES = np.array([0.7, 0.4, 1.1])
RATES = np.array([0.6, -0.8, 0.5])
ACCELERATIONS = np.array([0.3, 0.9, -0.7])
STOKES = 30.0


def printed_inertia(axes, length):
    return (
        np.array(
            [4 * pi / 15 * np.prod(axes) * (axes[j] ** 2 + axes[k] ** 2) for _, j, k in CYCLIC]
        )
        / length**5
    )


def printed_resistance(axes, length):
    square = np.square(axes)
    beta = [2 / 3 * np.prod(axes) * elliprd(square[j], square[k], square[i]) for i, j, k in CYCLIC]
    weight = [
        (square[j] + square[k]) / (square[j] * beta[j] + square[k] * beta[k]) for _, j, k in CYCLIC
    ]
    return 2 / 3 * np.prod(axes) * np.array(weight) / length**3


def oblate_resistances(kappa):
    """(X_c, Y_c) as printed, but without the factor 1/κ³."""
    root = sqrt(1 - kappa**2)
    axial = 2 / 3 * root**3 / (acos(kappa) - kappa * root)
    equatorial = (
        2 / 3 * root**3 * (1 + kappa**2) / (kappa * root - (2 * kappa**2 - 1) * acos(kappa))
    )
    return np.array([axial, equatorial])


def prolate_resistances(kappa):
    """(X_c, Y_c) as printed."""
    root = kappa * sqrt(kappa**2 - 1)
    scale = 2 / 3 * (1 - kappa**-2) ** 1.5
    return np.array(
        [
            scale / (root - acosh(kappa)),
            scale * (kappa**2 + 1) / (-root + (2 * kappa**2 - 1) * acosh(kappa)),
        ]
    )


def residual(shape, angles, rates, accelerations):
    """Left minus right side of `ultima` in body axes along the path with the given angles, rates and accelerations."""

    def omega_at(time):
        return body_rates(
            angles + rates * time + accelerations * time**2 / 2, rates + accelerations * time
        )

    step, coefficients = 0.01, (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    derivative = sum(
        weight * (omega_at(n * step) - omega_at(-n * step)) / step
        for n, weight in enumerate(coefficients, start=1)
    )
    omega = omega_at(0.0)
    torque = (
        -8
        * pi
        * shape.resistance
        * (omega - jeffery(shape.semi_axes, rotation_from_euler(*angles)))
    )
    return STOKES * (shape.inertia * derivative + np.cross(omega, shape.inertia * omega)) - torque


@pytest.mark.parametrize("axes", [(1, 0.8, 0.5), (0.3, 1.0, 0.6), (1, 1, 0.4), (1, 1, 2.5)])
def test_right_inertia_and_resistance_definitions(axes):
    shape = body(axes)
    assert_right(printed_inertia(axes, max(axes)), shape.inertia, tolerance=1e-13)
    assert_right(printed_resistance(axes, max(axes)), shape.resistance, tolerance=1e-12)


def test_misprint_length_unit():
    axes = (1.0, 0.8, 0.5)
    shape = body(axes)
    for formula, truth in (
        (printed_inertia, shape.inertia),
        (printed_resistance, shape.resistance),
    ):
        assert_misprint(formula(axes, axes[2]), formula(axes, axes[0]), truth, gap=1)


@pytest.mark.parametrize("kappa", [0.4, 2.5])
def test_misprint_aspect_ratio(kappa):
    rotation = rotation_from_euler(0.7, 0.4, 0.0)
    truth = torque_free_angular_velocity(
        np.array([1, 1, kappa]), rotation @ np.eye(3)[[0]].T @ np.eye(3)[[1]] @ rotation.T
    )

    def second_component(ratio):
        return -(np.sin(0.4) ** 2 + ratio**2 * np.cos(0.4) ** 2) / (ratio**2 + 1) * np.sin(0.7)

    assert_misprint(second_component(1 / kappa), second_component(kappa), truth[1])


@pytest.mark.parametrize("kappa", [0.2, 0.3, 0.5, 0.8])
def test_misprint_oblate_resistances(kappa):
    shape = body((1, 1, kappa))
    corrected = oblate_resistances(kappa)
    assert_misprint(corrected / kappa**3, corrected, shape.resistance[[2, 0]], gap=0.5)
    short = body((1, 1, kappa), length=kappa)
    assert_right(corrected / kappa**3, short.resistance[[2, 0]], tolerance=1e-11)


@pytest.mark.parametrize("kappa", [1.2, 2.0, 3.33, 8.0])
def test_right_prolate_resistances(kappa):
    assert_right(
        prolate_resistances(kappa), body((1, 1, kappa)).resistance[[2, 0]], tolerance=1e-11
    )


def test_right_rotation_matrix():
    theta, phi, psi = ANGLES
    (st, ct), (sf, cf), (sp, cp) = ((np.sin(x), np.cos(x)) for x in (theta, phi, psi))
    printed = [
        [cp * cf - sf * sp * ct, sf * cp + sp * cf * ct, st * sp],
        [-sp * cf - sf * cp * ct, -sf * sp + cp * cf * ct, st * cp],
        [st * sf, -st * cf, ct],
    ]
    assert_right(printed, rotation_from_euler(*ANGLES), tolerance=1e-14)


def test_right_angular_velocity_from_euler_rates():
    (theta, _, psi), (nutation, precession, spin) = ANGLES, RATES
    printed = [
        precession * np.sin(theta) * np.sin(psi) + nutation * np.cos(psi),
        precession * np.sin(theta) * np.cos(psi) - nutation * np.sin(psi),
        precession * np.cos(theta) + spin,
    ]
    assert_right(printed, body_rates(ANGLES, RATES), tolerance=1e-14)


def test_right_triaxial_euler_angle_equations():
    shape = body((1, 0.8, 0.5))
    (theta, _, psi), (dt, df, dp), (ddt, ddf, ddp) = ANGLES, RATES, ACCELERATIONS
    (st, ct), (sp, cp) = ((np.sin(x), np.cos(x)) for x in (theta, psi))
    inertia, omega = shape.inertia, body_rates(ANGLES, RATES)
    drag = (
        8 * pi * shape.resistance * (omega - jeffery(shape.semi_axes, rotation_from_euler(*ANGLES)))
    )
    direct = [
        ddf * st * sp + df * dt * ct * sp + df * dp * st * cp + ddt * cp - dp * dt * sp,
        ddf * st * cp + df * dt * ct * cp - df * dp * st * sp - ddt * sp - dp * dt * cp,
        ddp + ddf * ct - df * dt * st,
    ]
    gyroscopic = [
        -df * dt * ct * sp + df * dp * st * cp - dp * dt * sp + df**2 * ct * st * cp,
        df * dt * ct * cp + df * dp * st * sp + dp * dt * cp + df**2 * ct * st * sp,
        (df**2 * st**2 - dt**2) * cp * sp + df * dt * st * np.cos(2 * psi),
    ]
    difference = np.array(
        [inertia[2] - inertia[1], inertia[0] - inertia[2], inertia[1] - inertia[0]]
    )
    printed = STOKES * (inertia * direct + difference * gyroscopic) + drag
    assert_right(printed, residual(shape, ANGLES, RATES, ACCELERATIONS), tolerance=1e-12)


def spheroid_equations(kappa, resistances, stokes, *, centrifugal, gyroscopic, axial):
    """Left minus right sides of `fsptho`, `fsppho` and `fpsso` at ψ = 0 with the three disputed coefficients open."""
    (theta, phi, _), (dt, df, dp), (ddt, ddf, ddp) = ANGLES, RATES, ACCELERATIONS
    st, ct = np.sin(theta), np.cos(theta)
    jeffery_rates = jeffery((1, 1, kappa), rotation_from_euler(theta, phi, 0.0))
    axial_drag, equatorial_drag = resistances
    inverse = 1 / kappa**2
    left = [
        4
        * pi
        * stokes
        / 15
        * (centrifugal * df**2 * st * ct + (inverse + 1) * ddt + gyroscopic * dp * df * st),
        4 * pi * stokes / 15 * (2 * df * dt * ct + (inverse + 1) * ddf * st - gyroscopic * dp * dt),
        axial * stokes / 15 * 2 * inverse * (ddf * ct + ddp - dt * df * st),
    ]
    drag = np.array([equatorial_drag, equatorial_drag, axial_drag])
    return np.array(left) + 8 * pi * drag * (np.array([dt, df * st, dp + df * ct]) - jeffery_rates)


def spheroid_case(kappa):
    """Resistances, Stokes number and truth for the printed equations: oblate (divided by κ³) or prolate (St/κ²)."""
    truth = residual(body((1, 1, kappa)), ANGLES * [1, 1, 0], RATES, ACCELERATIONS)
    if kappa < 1:
        return oblate_resistances(kappa) / kappa**3, STOKES, truth / kappa**3
    return prolate_resistances(kappa), STOKES / kappa**2, truth


@pytest.mark.parametrize("kappa", [0.4, 2.0])
@pytest.mark.parametrize(
    ("rows", "misprint"),
    [([0], "centrifugal"), ([0, 1], "gyroscopic"), ([2], "axial")],
    ids=["fsptho-centrifugal", "fsptho-fsppho-gyroscopic", "fpsso-prefactor"],
)
def test_misprint_spheroid_euler_angle_equations(kappa, rows, misprint):
    resistances, stokes, truth = spheroid_case(kappa)
    printed = {"centrifugal": kappa**-2 - kappa**2, "gyroscopic": 2.0, "axial": 8 * pi}
    right = {"centrifugal": kappa**-2 - 1, "gyroscopic": 2 / kappa**2, "axial": 4 * pi}
    corrected = spheroid_equations(kappa, resistances, stokes, **right)
    wrong = spheroid_equations(
        kappa, resistances, stokes, **(right | {misprint: printed[misprint]})
    )
    for row in rows:
        assert_misprint(wrong[row], corrected[row], truth[row], tolerance=1e-10)


def test_misprint_spheroid_length_units_mixed():
    kappa = 0.4
    right = {"centrifugal": kappa**-2 - 1, "gyroscopic": 2 / kappa**2, "axial": 4 * pi}
    truth = residual(body((1, 1, kappa)), ANGLES * [1, 1, 0], RATES, ACCELERATIONS)
    mixed = spheroid_equations(kappa, oblate_resistances(kappa), STOKES, **right)
    assert deviation(mixed, truth) > 0.1
    assert deviation(mixed, truth / kappa**3) > 0.1


def tumbling_period(kappa, lag):
    """Period of the tumbling spheroid whose rotation rate w(φ) solves lag·w w' = f − w, f being Jeffery's rate."""
    phi = 2 * pi * np.arange(256) / 256
    rate = (np.sin(phi) ** 2 + kappa**2 * np.cos(phi) ** 2) / (kappa**2 + 1)
    harmonic = 1j * np.fft.fftfreq(256, 1 / 256)
    w = rate
    for _ in range(40):
        w = rate - lag * w * np.fft.ifft(harmonic * np.fft.fft(w)).real
    return 2 * pi * np.mean(1 / w)


@pytest.mark.parametrize("kappa", [2.0, 3.0])
def test_misprint_period_increases(kappa):
    shape = body((1, 1, kappa))
    lag = 2e-3
    stokes = lag * 8 * pi * shape.resistance[0] / shape.inertia[0]
    change = (tumbling_period(kappa, lag) - 2 * pi * (kappa + 1 / kappa)) / stokes**2
    bracket = (1 - 2 * kappa**2) * acosh(kappa) + kappa * sqrt(kappa**2 - 1)
    printed = -pi * bracket**2 / (100 * kappa**2 * (kappa**4 - 1) * (kappa + 1) ** 2)
    assert change < -1e-4
    assert printed == pytest.approx(change, rel=1e-4)


@pytest.mark.parametrize("kappa", [0.5, 2.0])
def test_right_period_limits(kappa):
    assert_right(2 * pi * (kappa + 1 / kappa), tumbling_period(kappa, 0.0), tolerance=1e-13)


@pytest.mark.parametrize("kappa", [2.0, 4.0])
def test_right_period_at_large_stokes(kappa):
    """The tumbling period tends to 4π: two half turns from the rate −1/2."""
    times = np.array([0.0, 4 * pi])
    rotation, _ = integrate(body((1, 1, kappa)), 1e5, (pi / 2, 0.3, 0.0), (0.0, -0.5, 0.0), times)
    assert_right(rotation[1], rotation[0], tolerance=2e-2)


@pytest.mark.parametrize("kappa", [1e2, 1e4, 1e6])
def test_misprint_effective_stokes_number_slender(kappa):
    axial_drag, equatorial_drag = prolate_resistances(kappa)
    axial = 8 * pi / 15 * kappa**-4 / (8 * pi * axial_drag)
    equatorial = 4 * pi / 15 * kappa**-2 * (1 + kappa**-2) / (8 * pi * equatorial_drag)
    assert axial * 10 * kappa**2 == pytest.approx(1, rel=2e-3)
    assert axial / (log(kappa) / kappa**2) < 0.1 / log(kappa) * 1.01
    assert equatorial * 10 * kappa**2 == pytest.approx(log(2 * kappa) - 0.5, rel=2e-3)


@pytest.mark.parametrize("kappa", [1e-3, 1e-5])
def test_right_effective_stokes_number_flat(kappa):
    axial = 8 * pi / 15 * kappa / (8 * pi * oblate_resistances(kappa)[0])
    assert axial / kappa == pytest.approx(pi / 20, rel=5 * kappa)


@pytest.mark.parametrize(
    ("kappa", "stokes"), [(0.3, 61.2), (0.5, 43.8), (2.0, 100.24), (3.33, 254.0)]
)
def test_right_caption_of_the_collapse(kappa, stokes):
    shape = body((1.0, 1.0, kappa))
    assert shape.inertia[2] * stokes / (8 * pi * shape.resistance[2]) == pytest.approx(
        2.071, rel=2e-3
    )


@pytest.mark.parametrize("kappa", [0.5, 2.0])
def test_right_planar_flow_threshold(kappa):
    threshold = min(kappa, 1 / kappa) ** 2

    def extreme_rates(alpha):
        gradient = np.array([[0, 1, 0], [alpha, 0, 0], [0, 0, 0]])
        axes = np.array([1.0, kappa, 1.0])
        turned = [rotation_from_euler(0.0, angle, 0.0) for angle in (0.0, pi / 2)]
        return [torque_free_angular_velocity(axes, r @ gradient @ r.T)[2] for r in turned]

    assert np.prod(extreme_rates(threshold - 0.01)) > 0 > np.prod(extreme_rates(threshold + 0.01))

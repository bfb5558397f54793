"""The paper's spheroid captions, phase plane, first-order correction and start from rest (docs/misprints.md)."""

from math import cos, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from oracle.first_principles import (
    body,
    integrate,
    jeffery,
    momentum_and_energy,
    rotation_from_euler,
)
from oracle.printed import Spheroid
from oracle.verdict import assert_misprint, assert_right

KAPPAS = pytest.mark.parametrize("kappa", [0.4, 2.0])


def aligned_rates(s, theta, momentum, sign):
    """Body-axis L of the captions' start (φ̇₀ = L_z0/I_e, ψ̇₀ = sign·L_z0 cosθ₀ (1/I_a − 1/I_e)), in space axes."""
    precession = momentum / s.ie
    spin = sign * momentum * cos(theta) * (1 / s.ia - 1 / s.ie)
    omega = np.array([0.0, precession * np.sin(theta), precession * cos(theta) + spin])
    return momentum_and_energy(s.shape, rotation_from_euler(theta, 0.0, 0.0), omega)[0]


@KAPPAS
def test_misprint_spheroid_start_with_aligned_momentum(kappa):
    s = Spheroid(kappa)
    printed, corrected = (aligned_rates(s, 0.8, 0.6, sign) for sign in (-1, 1))
    assert_misprint(printed, corrected, [0, 0, 0.6], tolerance=1e-14)


@KAPPAS
def test_right_appendix_start_with_aligned_momentum(kappa):
    s = Spheroid(kappa)
    theta, precession = 0.8, -0.5
    spin = (s.ie - s.ia) / s.ia * precession * cos(theta)
    omega = np.array([0.0, precession * np.sin(theta), precession * cos(theta) + spin])
    momentum, _ = momentum_and_energy(s.shape, rotation_from_euler(theta, 0.0, 0.0), omega)
    assert_right(momentum, [0, 0, s.ie * precession], tolerance=1e-14)


def test_misprint_caption_saddle():
    """Prolate, κ = 2: the saddle printed at (−1/2, 1/8) is the node."""
    s = Spheroid(2.0)

    def rate(z, energy):
        eta2 = (z * z - 2 * s.ie * energy) / (s.ia * (s.ia - s.ie))
        return s.slow([0.0, 0.0, z, sqrt(max(eta2, 0.0))]), eta2

    node, node_eta2 = rate(-s.ie / 2, s.ie / 8)
    saddle, saddle_eta2 = rate(-s.ia / 2, s.ia / 8)
    assert_right(node, np.zeros(4), tolerance=1e-13)
    assert_right(saddle, np.zeros(4), tolerance=1e-13)
    assert_misprint(node_eta2, saddle_eta2, 0.25, tolerance=1e-13)


@pytest.mark.parametrize(("energy", "spin_fraction"), [(2 / 9, 0.0), (0.305, 0.5), (0.472, 0.866)])
def test_right_starts_at_given_momentum(energy, spin_fraction):
    """Captions of the projections at L₀ = 2I_e/3, κ = 2: the energies are those of I_aη₀/L₀ = 0, 0.5, 0.87."""
    s = Spheroid(2.0)
    momentum = np.array([2 / 3 * s.ie, 0, 0])
    assert s.energy(momentum, spin_fraction * momentum[0] / s.ia) / s.ie == pytest.approx(
        energy, abs=2e-3
    )


@KAPPAS
def test_right_parabolas_and_line(kappa):
    s = Spheroid(kappa)
    momentum = np.array([0, 0, -0.3])
    ends = sorted(s.energy(momentum, h * 0.3 / s.ia) for h in (0.0, 1.0))
    assert_right(ends, sorted([0.09 / (2 * s.ie), 0.09 / (2 * s.ia)]), tolerance=1e-14)
    for moment in (s.ia, s.ie):
        assert -moment / 2 + 4 * moment / 8 == pytest.approx(0, abs=1e-15)


@KAPPAS
def test_right_upper_parabola_is_invariant(kappa):
    s = Spheroid(kappa)
    eta = -0.7
    slow = s.slow([0, 0, s.ia * eta, eta])
    assert_right(slow[2], s.ia * slow[3], tolerance=1e-13)


@KAPPAS
def test_misprint_slow_motion_halts_at_the_pinch_point(kappa):
    """From L_z > 0 the slow solution runs into (0, 0) at a finite speed, hence in a finite slow time."""
    s = Spheroid(kappa)
    start = [0, 0, 0.6, 0.4 * 0.6 / s.ia]
    speed = 4 * pi * min(s.xc, s.yc)

    def near_pinch(_, state):
        return state[2] - 1e-4

    near_pinch.terminal = True
    run = solve_ivp(
        lambda _, y: s.slow(y),
        (0, 0.6 / speed),
        start,
        "DOP853",
        rtol=1e-10,
        atol=1e-12,
        events=near_pinch,
    )
    assert run.status == 1
    assert s.slow(run.y[:, -1])[2] < -speed


def first_order_errors(stokes, momentum, slow_time, kappa=2.0):
    """Largest |L_z − prediction| along the run: leading order, as printed, and corrected (dict)."""
    s = Spheroid(kappa)
    theta, phi = 0.9, 0.6
    eta = momentum * cos(theta) / s.ia
    precession, spin = momentum / s.ie, momentum * cos(theta) * (1 / s.ia - 1 / s.ie)
    slow_times = np.linspace(0, slow_time, 61)[1:]
    rotation, omega = integrate(
        s.shape, stokes, (theta, phi, 0.0), (0.0, precession, spin), stokes * slow_times
    )
    truth = momentum_and_energy(s.shape, rotation, omega)[0][:, 2]
    size = -2 * pi * s.yc * (kappa**2 - 1) / (1 + kappa**2)

    def slow_solution(start):
        """L_z, h̄² and the phase integral ∫ L_z/I_e dt₂ along the slow solution."""

        def field(_, y):
            rate = s.slow([0, 0, y[0], y[1]])
            return [rate[2], rate[3], y[0] / s.ie]

        run = solve_ivp(
            field, (0, slow_time), [start, eta, 0.0], "DOP853", slow_times, rtol=1e-12, atol=1e-14
        )
        z, spin, phase = run.y
        return z, 1 - (s.ia * spin / z) ** 2, phase

    z, g2, phase = slow_solution(momentum)
    wave = np.sin(2 * (stokes * phase + phi))
    printed = z + size * g2 * slow_times / phase * wave / stokes
    shift = size * np.sin(theta) ** 2 * s.ie / momentum * np.sin(2 * phi) / stokes
    start = momentum - shift
    shifted, g2_shifted, phase_shifted = slow_solution(start)
    local = size * g2_shifted * s.ie / shifted * np.sin(2 * (stokes * phase_shifted + phi)) / stokes
    candidates = {"leading": z, "printed": printed, "corrected": shifted + local}
    return {name: np.max(np.abs(value - truth)) for name, value in candidates.items()}


@pytest.mark.parametrize(("momentum", "slow_time"), [(1.0, 0.02), (-0.6, 0.04), (-0.3, 0.04)])
def test_misprint_first_order_correction(momentum, slow_time):
    coarse, fine = (first_order_errors(stokes, momentum, slow_time) for stokes in (400.0, 1600.0))
    order = {name: np.log(coarse[name] / fine[name]) / np.log(4) for name in fine}
    assert order["corrected"] == pytest.approx(2, abs=0.2)
    assert order["printed"] == pytest.approx(1, abs=0.2)
    assert order["leading"] == pytest.approx(1, abs=0.2)
    assert fine["corrected"] < 0.2 * fine["printed"]


@pytest.mark.parametrize("momentum", [0.3, -0.3])
def test_misprint_aligned_trajectory_sign(momentum):
    """`fodtraj` with L = |L|, h = I_aη/L fails for L_z < 0; with L signed it holds on both sides."""
    s = Spheroid(2.0)
    theta, phi = 0.9, 0.6
    precession, spin = momentum / s.ie, momentum * cos(theta) * (1 / s.ia - 1 / s.ie)
    times = np.linspace(0, 8, 9)
    rotation, _ = integrate(s.shape, np.inf, (theta, phi, 0.0), (0.0, precession, spin), times)

    def axis(size):
        h = s.ia * (spin + precession * cos(theta)) / size
        phase = size / s.ie * times + phi
        across = np.sqrt(1 - h * h)
        return np.column_stack(
            [across * np.sin(phase), -across * np.cos(phase), np.full_like(times, h)]
        )

    if momentum > 0:
        assert_right(axis(abs(momentum)), rotation[:, 2], tolerance=1e-9)
    else:
        assert_misprint(axis(abs(momentum)), axis(momentum), rotation[:, 2], tolerance=1e-9)


@KAPPAS
def test_right_first_order_rates(kappa):
    """`lzsfod` and `nsfod`: `lzms`, `nms` minus `lzsmain`, `nsmain` on the vorticity-aligned cone."""
    s = Spheroid(kappa)
    momentum, h = -0.3, 0.4
    eta, g2 = h * momentum / s.ia, 1 - h * h
    phi = np.linspace(0, 3, 7)
    full = (
        s.yc / s.ie * momentum
        + (s.xc - s.yc * s.ia / s.ie) * eta * h
        + s.xc / 2 * h * h
        + s.yc * s.ia / (2 * s.ie) * g2 * (np.sin(phi) ** 2 + kappa**2 * np.cos(phi) ** 2)
    )
    slow = s.slow([0, 0, momentum, eta])
    printed = -4 * pi * s.yc * (kappa**2 - 1) / (1 + kappa**2) * g2 * np.cos(2 * phi)
    assert_right(printed, -8 * pi * full - slow[2])
    assert_right(-8 * pi * s.xc / s.ia * (eta + h / 2), slow[3])


@pytest.mark.parametrize("axes", [(1, 1, 2), (3, 2, 1)])
def test_misprint_spin_up_time(axes):
    """From rest, at t = √St the angular velocity is O(St^-1/2), not O(1); the slip is then −ω_J, not ω_J."""
    shape = body(axes)
    angles = (0.314, 0.52, 1.05 if axes[0] != axes[1] else 0.0)
    scaled = []
    for stokes in (1e6, 1e8):
        rotation, omega = integrate(
            shape, stokes, angles, (0.0, 0.0, 0.0), np.array([sqrt(stokes)])
        )
        scaled.append(np.linalg.norm(omega) * sqrt(stokes))
    assert scaled[0] == pytest.approx(scaled[1], rel=0.1)
    ambient = jeffery(shape.semi_axes, rotation[0])
    assert_misprint(ambient, -ambient, omega[0] - ambient, tolerance=0.01)


def test_misprint_error_of_the_averaged_equations_grows_with_stokes():
    """The deviation from the averaged solution falls with St: the exponent printed as 1 + υ is negative."""
    coarse, fine = (first_order_errors(stokes, -0.3, 0.04)["leading"] for stokes in (400.0, 1600.0))
    assert fine < 0.5 * coarse

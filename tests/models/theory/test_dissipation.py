"""Dissipation, effective Stokes numbers, and the fast motion at given slow variables."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from oracle import first_principles
from polhode.models.catalogue import form
from polhode.models.flow import dissipation
from polhode.models.free_top.polhode import mean_speed
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.observables import observe_body
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve


@pytest.mark.parametrize("semi_axes", [(1.0, 0.8, 0.5), (0.3, 1.0, 1.0), (2.0, 2.0, 2.0)])
@pytest.mark.parametrize("stokes", [1.0, 300.0])
def test_energy_is_the_integral_of_the_power(semi_axes, stokes):
    """E(t) - E(0) = (1/St) ∫ dissipation dt along a run, by Gauss quadrature between 41 times."""
    scene = Scene(Ellipsoid(semi_axes), stokes, EulerStart((1.0, 0.5, 0.2), (1.0, 1.0, -1.0)), 20.0)
    node, weight = np.polynomial.legendre.leggauss(24)
    edges = scene.time * np.linspace(0, 1, 41) ** 3
    half = np.diff(edges)[:, None] / 2
    inner = edges[:-1, None] + half * (node + 1)
    times = np.unique(np.concatenate([edges, inner.ravel()]))
    quaternion = form("quaternion")
    run = solve(quaternion.problem(scene), "cyrk-vern8", 1e-15, times)
    assert run.success
    power = dissipation(scene.ellipsoid, matrix_from_quaternion(run.states[:, :4]), run.states[:, 4:])
    gained = np.cumsum(np.sum(half * weight * power[np.searchsorted(times, inner)], axis=1)) / stokes
    energy = quaternion.observe(scene, run.states).energy[np.searchsorted(times, edges)]
    assert np.max(np.abs(energy - energy[0])) > 1e-3
    np.testing.assert_allclose(energy[1:] - energy[0], gained, rtol=0, atol=1e-12)


def test_power_is_torque_times_angular_velocity():
    """Against the torque and Jeffery's angular velocity from the flow itself."""
    random = np.random.default_rng(1)
    semi_axes = (0.6, 1.0, 0.3)
    q, omega = random.normal(size=(20, 4)), random.normal(size=(20, 3))
    rotation = matrix_from_quaternion(q)
    _, power = first_principles.slow_rates(first_principles.body(semi_axes), rotation, omega)
    np.testing.assert_allclose(dissipation(Ellipsoid(semi_axes), rotation, omega), power, rtol=1e-10, atol=1e-10)


# Leading orders of I/(8πX) of a spheroid as κ → ∞ and κ → 0, about the symmetry axis (St*/St) and about the equator.
LIMITS = {
    2: lambda kappa: 1 / (10 * kappa**2) if kappa > 1 else np.pi * kappa / 20,
    0: lambda kappa: (2 * np.log(2 * kappa) - 1) / (20 * kappa**2) if kappa > 1 else np.pi * kappa / 40,
}


@pytest.mark.parametrize("axis", LIMITS)
@pytest.mark.parametrize("extreme", [1e3, 1e-3])
def test_effective_stokes_number_of_fibres_and_disks(axis, extreme):
    """The printed St ln κ/κ² for κ → ∞ is the law of the equatorial axes, not of St*, which has no logarithm."""
    for kappa, left in ((extreme, 2e-3), (extreme**2, 2e-6)):
        ellipsoid = Ellipsoid((1.0, 1.0, kappa))
        assert 1 / ellipsoid.damping[axis] == pytest.approx(LIMITS[axis](kappa), rel=left)
        assert ellipsoid.stokes_star_per_stokes == 1 / ellipsoid.damping[2]


UNTURNED = (1.0, 0.0, 0.0, 0.0)


def wobbling_start(semi_axes, omega):
    ellipsoid = Ellipsoid(semi_axes)
    return ellipsoid, observe_body(ellipsoid, np.eye(3)[None], np.array([omega])).slow


TOPS = [
    ((1.0, 0.8, 0.5), (0.1, 0.2, 1.0)),
    ((1.0, 0.8, 0.5), (1.0, 0.2, -0.1)),
    ((0.5, 1.0, 0.8), (0.3, 0.5, 1.0)),
    ((1.0, 0.1, 0.15), (2.0, 0.05, 0.3)),
]


@pytest.mark.parametrize(("semi_axes", "omega"), TOPS)
def test_fast_motion_against_quadrature_along_the_polhode(semi_axes, omega):
    ellipsoid, slow = wobbling_start(semi_axes, omega)
    curve = first_principles.polhode(
        np.array(ellipsoid.inertia), np.linalg.norm(slow[0, :3]), float(slow[0, 3]), nodes=4096
    )
    speed = curve.weight @ np.linalg.norm(curve.momentum / ellipsoid.inertia, axis=1)
    assert mean_speed(ellipsoid, slow)[0] == pytest.approx(speed, rel=1e-6)
    assert TorqueFree(ellipsoid.inertia, UNTURNED, omega).period == pytest.approx(curve.period, rel=1e-9)


@pytest.mark.parametrize(("semi_axes", "omega"), [TOPS[0], TOPS[1]])
def test_precession_period_against_the_turns_of_the_encircled_axis(semi_axes, omega):
    """The body axis that the polhode encircles goes about L: its mean rate over whole periods T is 2π/T'."""
    ellipsoid, slow = wobbling_start(semi_axes, omega)
    top = TorqueFree(ellipsoid.inertia, UNTURNED, omega)
    inertia, momentum = np.array(ellipsoid.inertia), slow[0, :3]
    axis = first_principles.enclosed_axis(inertia, np.linalg.norm(momentum), float(slow[0, 3]))
    frame = first_principles.aligned_frame(momentum)

    def field(_, rows):
        rotation = rows.reshape(3, 3)
        return -np.cross(rotation @ momentum / inertia, rotation.T).T.ravel()

    periods = 6
    times = np.linspace(0, periods * top.period, 4001)
    run = solve_ivp(field, (0, times[-1]), np.eye(3).ravel(), t_eval=times, method="DOP853", rtol=1e-12, atol=1e-12)
    across = run.y.T.reshape(-1, 3, 3)[:, axis] @ frame
    angle = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))
    assert (angle[-1] - angle[0]) / times[-1] == pytest.approx(2 * np.pi / top.precession_period, rel=1e-8)


@pytest.mark.parametrize("semi_axes", [(1.0, 1.0, 2.0), (0.4, 1.0, 1.0), (2.0, 2.0, 2.0)])
def test_speed_of_symmetric_tops_is_constant(semi_axes):
    ellipsoid, slow = wobbling_start(semi_axes, (0.3, -0.7, 0.2))
    assert mean_speed(ellipsoid, slow)[0] == pytest.approx(np.linalg.norm((0.3, -0.7, 0.2)), rel=1e-12)


@pytest.mark.parametrize("omega", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0)])
def test_speed_of_permanent_rotations(omega):
    ellipsoid, slow = wobbling_start((1.0, 0.8, 0.5), omega)
    tolerance = 0.05 if omega[1] else 1e-7
    assert mean_speed(ellipsoid, slow)[0] == pytest.approx(np.linalg.norm(omega), rel=tolerance, abs=0)

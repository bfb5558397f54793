"""Power of the flow's torque: along runs, and against the torque from the flow itself."""

import numpy as np
import pytest

from oracle import first_principles
from polhode.models.catalogue import form
from polhode.models.flow import dissipation
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
    power = dissipation(
        scene.ellipsoid, matrix_from_quaternion(run.states[:, :4]), run.states[:, 4:]
    )
    gained = (
        np.cumsum(np.sum(half * weight * power[np.searchsorted(times, inner)], axis=1)) / stokes
    )
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
    np.testing.assert_allclose(
        dissipation(Ellipsoid(semi_axes), rotation, omega), power, rtol=1e-10, atol=1e-10
    )

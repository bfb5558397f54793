"""Poincaré sections of the Jeffery top (St = 0), and how neighbouring orbits part."""

from functools import cache
from math import log, pi
from typing import Any

import numpy as np

from polhode.harness.paper.runs import TOLERANCE, full_run
from polhode.models.flow import jeffery_angular_velocity, shares
from polhode.models.forms.jeffery import field as jeffery_field
from polhode.models.operations import numpy_operations
from polhode.models.rotation import matrix_from_quaternion, quaternion_from_euler
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.compile import load_heyoka, tangent_system

# Sampling step, in inverse shear rates, of the orbits.
STEP = 0.2
# The tangent is brought back to unit length after so many steps.
PIECE = 100
TANGENT = (0.5, -0.5, 0.5, -0.5)


def section_points(ellipsoid: Ellipsoid, times: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ and ψ in rad where φ = nπ, from quaternions, shape (n, 4), at times of shape (n,), by cubic interpolation.

    φ = nπ is where the flow component t₃₁ of z' vanishes; ψ is given from -π/2 to π/2, its symmetry taken out.
    """
    q0, q1, q2, q3 = orientation.T
    height = q1 * q3 + q0 * q2
    before = np.flatnonzero(height[:-1] * height[1:] < 0)
    step = (times[before + 1] - times[before])[:, None]
    values, slopes = zip(*(_with_rates(ellipsoid, orientation[index]) for index in (before, before + 1)), strict=True)

    def at(place: np.ndarray, row: int | slice, column: int) -> np.ndarray:
        u = place[:, None]
        ends = [array[:, row, column].reshape(len(u), -1) for array in (*values, *slopes)]
        value = (1 + 2 * u) * (1 - u) ** 2 * ends[0] + u * (1 - u) ** 2 * step * ends[2]
        return value + u * u * (3 - 2 * u) * ends[1] + u * u * (u - 1) * step * ends[3]

    place = height[before] / (height[before] - height[before + 1])
    for _ in range(4):
        shift, nudge = at(place, 2, 0)[:, 0], at(place + 1e-6, 2, 0)[:, 0]
        place = np.clip(place - 1e-6 * shift / (nudge - shift), 0.0, 1.0)
    vorticity = at(place, slice(None), 2)
    theta = np.arccos(np.clip(vorticity[:, 2] / np.linalg.norm(vorticity, axis=1), -1, 1))
    psi = np.arctan2(vorticity[:, 0], vorticity[:, 1])
    return theta, (psi + pi / 2) % pi - pi / 2


def _with_rates(ellipsoid: Ellipsoid, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """t_ij and its rates, shape (n, 3, 3): each column c of t_ij, a space axis in body axes, obeys c' = c × ω."""
    rotation = matrix_from_quaternion(orientation)
    jeffery = jeffery_angular_velocity(numpy_operations())
    omega = np.stack(jeffery(rotation[:, :, 0].T, rotation[:, :, 1].T, shares(ellipsoid)), axis=1)
    return rotation, np.cross(rotation, omega[:, :, None], axis=1)


def chaos_border(turns: float) -> float:
    """Stretching, as a logarithm, above which an orbit of so many half turns counts as chaotic.

    Neighbours of a regular orbit part linearly in time, so that their stretching grows like the logarithm of the turns.
    """
    return 3 * float(np.log(turns))


def half_turn(ellipsoid: Ellipsoid) -> float:
    """Half a Jeffery period of the longest and the shortest axis, the slowest turn, in inverse shear rates."""
    kappa = max(ellipsoid.semi_axes) / min(ellipsoid.semi_axes)
    return pi * (kappa + 1 / kappa)


def stretched_orbit(
    ellipsoid: Ellipsoid, theta: float, psi: float, duration: float
) -> tuple[tuple[np.ndarray, np.ndarray], float]:
    """Section points, θ and ψ, of the orbit from φ = 0, and the logarithm of the stretching of a tangent vector."""
    integrator = _tangent_integrator()
    times = np.linspace(0.0, duration, int(duration / STEP) + 2)
    integrator.time = 0.0
    integrator.state[:] = [*quaternion_from_euler((theta, 0.0, psi)), *TANGENT]
    integrator.pars[:] = shares(ellipsoid)
    orientation, stretch = [integrator.state[None, :4].copy()], 0.0
    for first in range(0, len(times) - 1, PIECE):
        outcome, *_, states = integrator.propagate_grid(times[first : first + PIECE + 1])
        if outcome != load_heyoka().taylor_outcome.time_limit:
            raise RuntimeError(f"the run of an orbit and its tangent ended with {outcome}")
        orientation.append(states[1:, :4])
        length = float(np.linalg.norm(integrator.state[4:]))
        integrator.state[4:] /= length
        stretch += log(length)
    return section_points(ellipsoid, times, np.concatenate(orientation)), stretch


@cache
def _tangent_integrator() -> Any:
    system = tangent_system(jeffery_field, 4, 6)
    return load_heyoka().taylor_adaptive(system, [0.0] * 8, tol=TOLERANCE, compact_mode=True)


def orbit(ellipsoid: Ellipsoid, theta: float, psi: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """The same section points alone, as precisely as double precision allows."""
    times = np.linspace(0.0, duration, int(duration / (2 * STEP)) + 2)
    scene = Scene(ellipsoid, 0.0, EulerStart((theta, 0.0, psi)), duration)
    return section_points(ellipsoid, times, full_run(scene, times, 1e-15).states)

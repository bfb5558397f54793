"""Poincaré sections of the Jeffery top (St = 0), how neighbouring orbits part, and the layer of chaos at the saddle."""

from collections.abc import Callable
from functools import cache
from math import acosh, log, pi
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

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
# Beside ψ = 0, which some orbits never leave.
PSI = 1e-9
# Halvings down to the last digit.
HALVINGS = 52
# Distance, in rad, from the saddle at which its growth is measured.
BESIDE = 1e-4


def section_points(ellipsoid: Ellipsoid, times: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ and ψ in rad where φ = nπ, from quaternions, shape (n, 4), at times of shape (n,), by cubic interpolation.

    φ = nπ is where the flow component t₃₁ of z' vanishes; ψ is given from -π/2 to π/2, its symmetry taken out.
    """
    rotation = matrix_from_quaternion(orientation)
    jeffery = jeffery_angular_velocity(numpy_operations())
    omega = np.stack(jeffery(rotation[:, :, 0].T, rotation[:, :, 1].T, shares(ellipsoid)), axis=1)
    # Each column c of t_ij, a space axis in body axes, obeys c' = c × ω.
    rates = np.cross(rotation, omega[:, :, None], axis=1)
    crossings = CubicHermiteSpline(times, rotation[:, 2, 0], rates[:, 2, 0]).roots(extrapolate=False)
    # The start, where φ = 0, is not one of them.
    crossings = crossings[crossings > times[1] / 2]
    vorticity = CubicHermiteSpline(times, rotation[:, :, 2], rates[:, :, 2])(crossings)
    theta = np.arccos(np.clip(vorticity[:, 2] / np.linalg.norm(vorticity, axis=1), -1, 1))
    psi = np.arctan2(vorticity[:, 0], vorticity[:, 1])
    return theta, (psi + pi / 2) % pi - pi / 2


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


def measure_layer(ellipsoid: Ellipsoid, turns: int) -> tuple[float, float]:
    """Bisect, along θ at ψ = 0, for the ends of pure libration and of pure circulation: two values of θ - π/2, in rad.

    Up to the first every orbit stays between the saddles, from the other on every orbit stays on one side of θ = π/2;
    the first is the larger one while orbits next to a sharp separatrix have not yet left the saddle.

    The section's own symmetry makes ψ = 0 a line that all of these orbits cross. A sharp separatrix gives two equal
    ends; orbits between them do both. Where the edge of a layer is frayed the bisection finds a place in the fringe, so
    that the width is a lower bound.
    """
    duration = turns * half_turn(ellipsoid)

    def circulates(offset: float) -> bool:
        _, psi = orbit(ellipsoid, pi / 2 + offset, PSI, duration)
        return bool(np.any(np.abs(np.diff(psi)) > 2))

    def librates(offset: float) -> bool:
        theta, _ = orbit(ellipsoid, pi / 2 + offset, PSI, duration)
        return bool(np.any((theta[1:] - pi / 2) * (theta[:-1] - pi / 2) < 0))

    return _last(lambda offset: not circulates(offset)), _last(librates)


def _last(holds: Callable[[float], bool]) -> float:
    """Where a property that holds close to θ = π/2 is lost."""
    low, high = 0.0, 1.2
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return (low + high) / 2


def saddle_growth(ellipsoid: Ellipsoid) -> float:
    """Exponent of the saddle (π/2, π/2) of the section, per half turn.

    The map next to it has determinant one and, by the reversal φ → -φ, equal diagonal elements cosh λ.
    """
    _, psi = orbit(ellipsoid, pi / 2, pi / 2 - BESIDE, 1.5 * half_turn(ellipsoid))
    return acosh((pi / 2 - abs(psi[0])) / BESIDE)

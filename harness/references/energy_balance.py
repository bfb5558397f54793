"""The energy balance of a run: E(t) - E(0) against the work that the viscous torque did (`vispow`)."""

import numpy as np

from polhode.models.observables import Observables, completed
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid
from polhode.models.theory.dissipation import dissipation

# Samples resolve the power if a body turns by less than this, in rad, between two of them, and if half of them give the
# same residual to this fraction, or to rounding.
LARGEST_TURN = 0.5
RESOLVED, ROUNDING = 0.2, 1e-13
# Fewer intervals than this cannot be halved and still carry a spline.
LEAST_INTERVALS = 16


def balance_residual(scene: Scene, found: Observables, true: Observables) -> float | None:
    """Largest residual over I_max of E(t) - E(0) - (1/St)∫P dt along a run, with P the power of the viscous torque.

    The true solution has the residual 0, and its quadrature over the same samples hardly another error than the
    quadrature of the solution found: the difference of the two residuals is what is measured.

    Both are at the same equispaced times over the scene's duration. None where it cannot be known: without orientation,
    at St = 0, where E has no balance of its own, or where the samples do not resolve the power.
    """
    intervals = len(found.energy) - 1
    if scene.stokes == 0 or intervals < LEAST_INTERVALS:
        return None
    ellipsoid, unit = scene.ellipsoid, max(scene.ellipsoid.inertia)
    known = (completed(ellipsoid, each.rotation) for each in (found, true))
    rotations = [rotation for rotation in known if rotation is not None]
    if len(rotations) < 2 or not np.isfinite(rotations).all():
        return None
    omega = [body_angular_velocity(ellipsoid, *pair) for pair in zip((found, true), rotations, strict=True)]
    if float(np.max(np.linalg.norm(omega[1], axis=1))) * scene.time / intervals > LARGEST_TURN:
        return None
    power = dissipation(ellipsoid, rotations[0], omega[0]) - dissipation(ellipsoid, rotations[1], omega[1])
    power, energy = power * scene.torque_factor / unit, (found.energy - true.energy).astype(float) / unit
    times = np.linspace(0.0, scene.time, intervals + 1)
    even = slice(0, intervals // 2 * 2 + 1, 2)
    fine, coarse = _residual(times, energy, power), _residual(times[even], energy[even], power[even])
    largest = float(np.max(np.abs(fine)))
    return largest if np.max(np.abs(fine[even] - coarse)) <= RESOLVED * largest + ROUNDING else None


def body_angular_velocity(ellipsoid: Ellipsoid, observables: Observables, rotation: np.ndarray) -> np.ndarray:
    """Angular velocity in body axes, shape (n, 3), from L and the complete rotation."""
    momentum = np.einsum("nij,nj->ni", rotation, observables.angular_momentum.astype(float))
    return momentum / np.array(ellipsoid.inertia)


def _residual(times: np.ndarray, energy: np.ndarray, rate: np.ndarray) -> np.ndarray:
    from scipy.interpolate import CubicSpline

    work = CubicSpline(times, rate).antiderivative()(times)
    return energy - energy[0] - work

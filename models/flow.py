"""What the shear flow asks of a body: Jeffery's angular velocity (`jw1`–`jw3`), and the power of its torque."""

from collections.abc import Callable
from math import pi

import numpy as np

from polhode.models.operations import ARRAYS, Operations
from polhode.models.shape import Ellipsoid


def shares(ellipsoid: Ellipsoid) -> tuple[float, ...]:
    """Shares b²/(b²+c²), c²/(b²+c²), and cyclic, of Jeffery's angular velocity (`jw1`–`jw3`)."""
    a2, b2, c2 = (length * length for length in ellipsoid.scaled_axes)
    return (
        b2 / (b2 + c2),
        c2 / (b2 + c2),
        c2 / (c2 + a2),
        a2 / (c2 + a2),
        a2 / (a2 + b2),
        b2 / (a2 + b2),
    )


def jeffery_angular_velocity(ops: Operations) -> Callable:
    """Jeffery's angular velocity in body axes from x = (t₁₁, t₂₁, t₃₁) and y = (t₁₂, t₂₂, t₃₂) (`jw1`–`jw3`)."""

    def spin(x, y, s):
        return (
            s[0] * y[1] * x[2] - s[1] * y[2] * x[1],
            s[2] * y[2] * x[0] - s[3] * y[0] * x[2],
            s[4] * y[0] * x[1] - s[5] * y[1] * x[0],
        )

    return spin


def jeffery_spin(ellipsoid: Ellipsoid, rotation: np.ndarray) -> np.ndarray:
    """Jeffery's angular velocity in body axes, shape (n, 3), of matrices t_ij, shape (n, 3, 3)."""
    flow = rotation[:, :, 0].T
    gradient = rotation[:, :, 1].T
    return np.stack(jeffery_angular_velocity(ARRAYS)(flow, gradient, shares(ellipsoid)), axis=1)


def dissipation(
    ellipsoid: Ellipsoid, rotation: np.ndarray, angular_velocity: np.ndarray
) -> np.ndarray:
    """St dE/dt = -8π Σ X_j (ω_j - ω_jJ) ω_j (`vispow`), shape (n,), positive where the flow drives the body.

    Of matrices t_ij, shape (n, 3, 3), and body angular velocities, shape (n, 3); in units of E
    times the shear rate.
    """
    return np.sum(torque(ellipsoid, rotation, angular_velocity) * angular_velocity, axis=1)


def torque(ellipsoid: Ellipsoid, rotation: np.ndarray, angular_velocity: np.ndarray) -> np.ndarray:
    """St times the viscous torque in body axes, -8π X_j (ω_j - ω_jJ), shape (n, 3), of the same arguments."""
    return (
        8
        * pi
        * np.array(ellipsoid.resistance)
        * (jeffery_spin(ellipsoid, rotation) - angular_velocity)
    )

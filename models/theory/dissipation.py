"""Power of the viscous torque: what changes the kinetic energy."""

from math import pi

import numpy as np

from polhode.models.flow import jeffery_angular_velocity, shares
from polhode.models.operations import numpy_operations
from polhode.models.shape import Ellipsoid


def dissipation(ellipsoid: Ellipsoid, rotation: np.ndarray, angular_velocity: np.ndarray) -> np.ndarray:
    """St dE/dt = -8π Σ X_j (ω_j - ω_jJ) ω_j (`vispow`), shape (n,), positive where the flow drives the body.

    Of matrices t_ij, shape (n, 3, 3), and body angular velocities, shape (n, 3); in units of E times the shear rate.
    """
    jeffery = jeffery_angular_velocity(numpy_operations())
    flow, gradient = rotation[:, :, 0].T, rotation[:, :, 1].T
    ambient = np.column_stack(jeffery(flow, gradient, shares(ellipsoid)))
    drag = 8 * pi * np.array(ellipsoid.resistance)
    return -np.sum(drag * (angular_velocity - ambient) * angular_velocity, axis=1)

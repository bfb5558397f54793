"""Power of the viscous torque: what changes the kinetic energy."""

from math import pi

import numpy as np

from polhode.models.flow import jeffery_angular_velocity, shares
from polhode.models.operations import numpy_operations
from polhode.models.shape import Ellipsoid


def dissipation(ellipsoid: Ellipsoid, rotation: np.ndarray, angular_velocity: np.ndarray) -> np.ndarray:
    """St dE/dt = -8π Σ X_j (ω_j - ω_jJ) ω_j (`vispow`), without the factor 1/St.

    Parameters
    ----------
    ellipsoid : Ellipsoid
    rotation : ndarray, shape (n, 3, 3)
        t_ij: row i is body axis i in space components.
    angular_velocity : ndarray, shape (n, 3)
        In body axes, in units of the shear rate.

    Returns
    -------
    ndarray, shape (n,)
        Positive where the flow drives the body, in units of E times the shear rate.
    """
    jeffery = jeffery_angular_velocity(numpy_operations())
    flow, gradient = rotation[:, :, 0].T, rotation[:, :, 1].T
    ambient = np.column_stack(jeffery(flow, gradient, shares(ellipsoid)))
    drag = 8 * pi * np.array(ellipsoid.resistance)
    return -np.sum(drag * (angular_velocity - ambient) * angular_velocity, axis=1)

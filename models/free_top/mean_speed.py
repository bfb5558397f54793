"""The fast, torque-free motion at given slow variables: its mean speed."""

import numpy as np

from polhode.models.shape import Ellipsoid

QUARTER_NODES = 32


def mean_speed(ellipsoid: Ellipsoid, slow: np.ndarray) -> np.ndarray:
    """Mean of |ω| over the torque-free motion, shape (n,), at slow variables (L_x, L_y, L_z, E), shape (n, 4).

    By quadrature over a quarter of the polhode (`eq:omg1`–`eq:omg3`), within about 1e-6 relative, less on the
    separatrix itself.
    """
    from scipy.special import ellipj, ellipk

    momentum2, energy2 = np.sum(slow[:, :3] ** 2, axis=1), 2 * slow[:, 3]
    i1, i2, i3 = sorted(ellipsoid.inertia)
    if i1 == i3:
        return np.sqrt(momentum2) / i1
    greatest = np.full(len(slow), i1 == i2) if i1 == i2 or i2 == i3 else momentum2 > energy2 * i2
    near, far = np.where(greatest, i3, i1), np.where(greatest, i1, i3)
    # Zero up to rounding at the permanent rotations and at rest.
    short = np.maximum((energy2 * near - momentum2) / (near - far), 0)
    long = np.maximum((momentum2 - energy2 * far) / (near - far), 0)
    parameter = (far - i2) / (i2 - near) * short / np.maximum(long, 1e-300)
    parameter = np.clip(parameter, 0, 1 - 1e-15)[:, None]
    quarter = (np.arange(QUARTER_NODES) + 0.5) / QUARTER_NODES
    sn, cn, dn, _ = ellipj(quarter * ellipk(parameter), parameter)
    squares = (
        (short / far)[:, None] * cn**2
        + (short * (near - far) / (i2 * (near - i2)))[:, None] * sn**2
        + (long / near)[:, None] * dn**2
    )
    return np.mean(np.sqrt(squares), axis=1)

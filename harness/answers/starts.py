"""Random starts that several studies draw."""

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.shape import Ellipsoid

# Least and largest log₁₀ of the tilt in rad, and of the spin in shear rates, that a settled body has left.
# Estimates: with larger ones the kind would be like "any shape".
_DISTURBED_EXPONENTS = (-3.0, -1.0)


def settled(draw: np.random.Generator, ellipsoid: Ellipsoid) -> tuple[np.ndarray, np.ndarray]:
    """The shortest axis along the vorticity, and half the shear rate about it, both a little off.

    The fluid turns at -1/2 about z, in shear rates. The orientation is made of three rotations: the
    shortest axis goes to z, then any angle about z, then a small tilt.
    """
    with IMPORTS:
        from scipy.spatial.transform import Rotation

    disturbance = 10 ** draw.uniform(*_DISTURBED_EXPONENTS)
    shortest = np.eye(3)[ellipsoid.order[2]]
    spin = -0.5 * shortest + disturbance * draw.normal(size=3)
    to_z = Rotation.align_vectors([[0.0, 0.0, 1.0]], [shortest])[0]
    about_z = Rotation.from_rotvec([0.0, 0.0, draw.uniform(0, 2 * np.pi)])
    tilt = Rotation.from_rotvec(disturbance * draw.normal(size=3))
    x, y, z, w = (tilt * about_z * to_z).as_quat()
    return np.array([w, x, y, z]), spin

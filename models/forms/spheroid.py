"""Shared by the forms of a spheroid: its symmetry axis, two moments of inertia, two damping rates."""

from dataclasses import dataclass

import numpy as np

from polhode.models.form import Form
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid


@dataclass(frozen=True)
class Spheroid:
    """A spheroid, or a sphere with z' as its symmetry axis, in the paper's names for its coefficients."""

    axis: int  # body axis (0, 1, 2) of symmetry, p̂
    axial_inertia: float  # I_a
    equatorial_inertia: float  # I_e
    axial_damping: float  # 8πX_c/I_a, in units of (shear rate)/St
    equatorial_damping: float  # 8πY_c/I_e
    inertia_ratio: float  # I_a/I_e = 2/(κ² + 1)
    anisotropy: float  # Λ = (κ² - 1)/(κ² + 1), free of cancellation near κ = 1

    @classmethod
    def of(cls, ellipsoid: Ellipsoid) -> "Spheroid":
        """The spheroid that an ellipsoid with two or three equal semi-axes is."""
        axis = 2 if ellipsoid.symmetry_axis is None else ellipsoid.symmetry_axis
        across = (axis + 1) % 3
        axial = ellipsoid.scaled_axes[axis]
        equatorial = ellipsoid.scaled_axes[across]
        sum_of_squares = axial * axial + equatorial * equatorial
        return cls(
            axis=axis,
            axial_inertia=ellipsoid.inertia[axis],
            equatorial_inertia=ellipsoid.inertia[across],
            axial_damping=ellipsoid.damping[axis],
            equatorial_damping=ellipsoid.damping[across],
            inertia_ratio=2 * equatorial * equatorial / sum_of_squares,
            anisotropy=(axial - equatorial) * (axial + equatorial) / sum_of_squares,
        )


def require_spheroid(form: Form, scene: Scene, instead: str) -> None:
    """Raise FormNotValidError for a triaxial ellipsoid."""
    if scene.ellipsoid.kind == "triaxial":
        raise form.refuse(
            f"the semi-axes {[*map(float, scene.ellipsoid.semi_axes)]} are all different", instead
        )


def axis_drift(states: np.ndarray, first: int = 3) -> np.ndarray:
    """|v|² - 1 of the vector v of unit length that stands at `first` in states, shape (n, d).

    By default v is p̂ in the states of `spheroid-axis`, behind L.
    """
    return np.sum(states[:, first : first + 3] ** 2, axis=1) - 1


def axis_rotation(axis: int, direction: np.ndarray) -> np.ndarray:
    """Matrices t_ij, shape (n, 3, 3): row `axis` has the directions, shape (n, 3), the other rows NaN."""
    rotation = np.full((len(direction), 3, 3), np.nan, dtype=direction.dtype)
    rotation[:, axis] = direction
    return rotation

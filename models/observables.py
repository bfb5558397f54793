"""Observables: what every form gives, so that any two can be compared."""

from dataclasses import dataclass

import numpy as np

from polhode.models.shape import Ellipsoid


@dataclass(frozen=True)
class Observables:
    """Slow variables and orientation at n times.

    Parameters
    ----------
    angular_momentum : ndarray, shape (n, 3)
        L in space axes, in units of (density) l⁵ (shear rate), without St; l is the longest
        semi-axis.
    energy : ndarray, shape (n,)
        Rotational kinetic energy E = ½ Σ I_i ω_i², in units of (density) l⁵ (shear rate)², without St.
    rotation : ndarray, shape (n, 3, 3)
        t_ij: row i is body axis i in space components; NaN in rows that the form does not know.
    """

    angular_momentum: np.ndarray
    energy: np.ndarray
    rotation: np.ndarray

    @property
    def slow(self) -> np.ndarray:
        """Slow variables (L_x, L_y, L_z, E), shape (n, 4)."""
        return np.column_stack([self.angular_momentum, self.energy])

    def __getitem__(self, rows: slice | np.ndarray) -> "Observables":
        """Those at some of the times."""
        return Observables(self.angular_momentum[rows], self.energy[rows], self.rotation[rows])


def observe_body(
    ellipsoid: Ellipsoid, rotation: np.ndarray, angular_velocity: np.ndarray
) -> Observables:
    """Observables of matrices t_ij, shape (n, 3, 3), and body angular velocities, shape (n, 3), in shear rates."""
    body_momentum = angular_velocity * np.array(ellipsoid.inertia)
    energy = 0.5 * np.sum(body_momentum * angular_velocity, axis=1)
    return Observables(np.einsum("nij,ni->nj", rotation, body_momentum), energy, rotation)


def observe_slow(slow: np.ndarray) -> Observables:
    """Observables of slow variables (L_x, L_y, L_z, E), shape (n, 4), without orientation."""
    return Observables(slow[:, :3], slow[:, 3], np.full((len(slow), 3, 3), np.nan))


def completed(ellipsoid: Ellipsoid, rotation: np.ndarray) -> np.ndarray | None:
    """Matrices t_ij, shape (n, 3, 3), with rows that a form does not know filled in; None if it knows none."""
    # About its symmetry axis a spheroid may be turned at will.
    rotation = rotation.astype(float)
    row_is_known = np.logical_not(np.isnan(rotation).any(axis=(0, 2))).tolist()
    if all(row_is_known):
        return rotation
    axis = ellipsoid.symmetry_axis
    if axis is None or not row_is_known[axis]:
        return None
    direction = rotation[:, axis]
    across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction), axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    # By negative indices these are the axes that follow the symmetry axis in cyclic order.
    rotation[:, axis - 2] = across
    rotation[:, axis - 1] = np.cross(direction, across)
    return rotation


def angular_velocity(ellipsoid: Ellipsoid, observables: Observables) -> np.ndarray:
    """ω in space axes, shape (n, 3), in shear rates, of L and the rotation matrix; NaN where they leave it open."""
    # A spheroid needs its symmetry axis' row alone, a sphere L alone.
    momentum = observables.angular_momentum
    rotation = observables.rotation
    inertia = np.array(ellipsoid.inertia)
    axis = ellipsoid.symmetry_axis
    if ellipsoid.kind == "triaxial":
        return np.einsum("nij,i,nik,nk->nj", rotation, 1 / inertia, rotation, momentum)
    if axis is None:
        return momentum / inertia[0]
    along = np.sum(momentum * rotation[:, axis], axis=1, keepdims=True) * rotation[:, axis]
    return (momentum - along) / inertia[axis - 1] + along / inertia[axis]

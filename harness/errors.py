"""Errors of one solution against another: each has the name of what it measures."""

from dataclasses import dataclass
from math import inf

import numpy as np

from polhode.models.observables import Observables
from polhode.models.shape import Ellipsoid


@dataclass(frozen=True)
class Errors:
    """Largest errors along a run, and where.

    Parameters
    ----------
    slow : float
        Maximum over the samples of |ΔL_x|, |ΔL_y|, |ΔL_z|, |ΔE|, over I_max.
    slow_rms : float
        Root mean square over samples and slow variables, over I_max.
    slow_final : float
        At the last sample: all runs end at the same node, so that it looks small whatever happened before.
    energy : float
        Maximum of |ΔE| over I_max.
    orientation : float or None
        Maximum over the samples, in rad: the geodesic angle on SO(3) for a triaxial ellipsoid, the angle between
        symmetry axes for a spheroid, None for a sphere or where a form gives none.
    orientation_rms, orientation_final : float or None
        The same angle's root mean square, and at the last sample.
    worst_sample : int
        Index of the sample of the largest slow error.
    """

    slow: float
    slow_rms: float
    slow_final: float
    energy: float
    orientation: float | None
    orientation_rms: float | None
    orientation_final: float | None
    worst_sample: int


def errors(ellipsoid: Ellipsoid, found: Observables, true: Observables) -> Errors:
    """Errors of observables at the same n times.

    Raises
    ------
    ValueError
        If the numbers of samples differ.
    """
    if len(found.energy) != len(true.energy):
        raise ValueError(f"samples: got {len(found.energy)}, expected {len(true.energy)}")
    with np.errstate(over="ignore", invalid="ignore"):
        difference = np.abs(found.slow - true.slow) / max(ellipsoid.inertia)
    difference = np.where(np.isnan(difference), inf, difference)
    angle = orientation_difference(ellipsoid, found.rotation, true.rotation)
    worst = np.max(difference, axis=1)
    return Errors(
        slow=float(np.max(worst)),
        slow_rms=_rms(difference),
        slow_final=float(worst[-1]),
        energy=float(np.max(difference[:, 3])),
        orientation=None if angle is None else float(np.max(angle)),
        orientation_rms=None if angle is None else _rms(angle),
        orientation_final=None if angle is None else float(angle[-1]),
        worst_sample=int(np.argmax(worst)),
    )


def orientation_difference(ellipsoid: Ellipsoid, found: np.ndarray, true: np.ndarray) -> np.ndarray | None:
    """Angle in rad, shape (n,), between two sequences of matrices t_ij, shape (n, 3, 3); None where there is none.

    Computed from the length of the chord, 2√2 sin(angle/2) in the Frobenius norm on SO(3) and 2 sin(angle/2) between
    unit vectors, which keeps small angles exact; quaternions q and -q give the same matrix.
    """
    if ellipsoid.kind == "sphere":
        return None
    if ellipsoid.kind == "triaxial":
        chord = np.linalg.norm((found - true).astype(float), axis=(1, 2)) / np.sqrt(2)
    else:
        axis = ellipsoid.symmetry_axis
        chord = np.linalg.norm((found - true)[:, axis].astype(float), axis=1)
    if np.all(np.isnan(chord)):
        return None
    angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
    return np.where(np.isnan(angle), np.pi, angle)


def attainable(ellipsoid: Ellipsoid, observables: Observables) -> float:
    """Smallest slow error that double precision can hold: eps times the largest |L|, E over I_max."""
    largest = float(np.max(np.abs(observables.slow)))
    return float(np.finfo(float).eps) * largest / max(ellipsoid.inertia)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if np.all(np.isfinite(values)) else inf

"""Effective Stokes numbers: inertia over viscous resistance, axis by axis."""

from math import log, pi

from polhode.models.shape import Ellipsoid


def effective_stokes(ellipsoid: Ellipsoid, axis: int) -> float:
    """I/(8πX) of a body axis, the time, in units of St over the shear rate, in which its rotation adapts to the flow.

    For the symmetry axis of a spheroid this is the paper's St*/St (`Ellipsoid.stokes_star_per_stokes`).
    """
    return 1 / ellipsoid.damping[axis]


def axial_limit(kappa: float) -> float:
    """Leading order of St*/St = I_a/(8πX_c) of a spheroid as κ → ∞ or κ → 0.

    1/(10 κ²) for slender fibres, πκ/20 for flat disks. The paper prints ln κ/κ² for fibres: that is the law of the
    equatorial axes, `equatorial_limit`, as the axial resistance has no logarithm.
    """
    return 1 / (10 * kappa**2) if kappa > 1 else pi * kappa / 20


def equatorial_limit(kappa: float) -> float:
    """Leading orders of I_e/(8πY_c) of a spheroid as κ → ∞ or κ → 0: (2 ln 2κ - 1)/(20 κ²) and πκ/40."""
    return (2 * log(2 * kappa) - 1) / (20 * kappa**2) if kappa > 1 else pi * kappa / 40

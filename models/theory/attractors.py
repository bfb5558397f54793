"""Attractors of an ensemble: where particles end, and how close is there."""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import Rotation, fixed_points


@dataclass(frozen=True)
class Attractor:
    """A stable state of the slow variables; the two senses of a spheroid's spin are one."""

    rotation: Rotation  # the body axis along the vorticity
    state: np.ndarray  # (L_x, L_y, L_z, E) over the largest moment of inertia
    reach: float  # distance, in the same units, within which a particle counts as arrived


def attractors(ellipsoid: Ellipsoid, stokes: float, radius: float, *, circling: bool) -> tuple[Attractor, ...]:
    """Attractors that are distinct from the other fixed points.

    `radius` is the distance beyond `circle` that still counts as arrived; `circling` says whether the equations hold
    the motion about the fixed point, which averaged ones do not. None at St = 0 and inf, nor any whose reach is half
    the distance of another fixed point or more: a shape close to a sphere, or a small St.
    """
    if stokes in (0, inf):
        return ()
    unit = max(ellipsoid.inertia)
    states: dict[Rotation, np.ndarray] = {
        point.rotation: np.array([0.0, 0.0, point.state[2], -point.state[2] / 4]) / unit
        for point in fixed_points(ellipsoid)
    }
    stable = {point.rotation for point in fixed_points(ellipsoid) if point.stability == "stable node"}
    found = []
    for rotation, state in states.items():
        reach = radius + (circle(ellipsoid, stokes) if circling else 0.0)
        others = [float(np.linalg.norm(state - other)) for name, other in states.items() if name != rotation]
        if rotation in stable and reach < min(others, default=inf) / 2:
            found.append(Attractor(rotation, state, reach))
    return tuple(found)


def circle(ellipsoid: Ellipsoid, stokes: float) -> float:
    """Distance in (L, E) over I_max at which a particle circles rotation about its shortest axis, to order 1/St.

    There ω̇ = -(d/St)(ω - Ω_J) with Ω_J = -½ + ½ Λ cos t, so that ω oscillates by dΛ/(2 St) about -½ and E = Iω²/2 by
    half as much; d is the damping rate and Λ the anisotropy of the section across the axis. A sum of 0 for oblate ones.
    """
    longest, middle, shortest = ellipsoid.order
    a2, b2 = ellipsoid.scaled_axes[longest] ** 2, ellipsoid.scaled_axes[middle] ** 2
    return sqrt(5) / 4 * ellipsoid.damping[shortest] * (a2 - b2) / (a2 + b2) / stokes

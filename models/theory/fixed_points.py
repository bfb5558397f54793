"""Fixed points of the slow manifold, uniform rotation about a principal axis, and attractors."""

from dataclasses import dataclass
from math import inf, pi, sqrt
from typing import Literal, get_args

import numpy as np

from polhode.models.shape import Ellipsoid

ByLength = Literal["longest axis", "middle axis", "shortest axis"]
Rotation = ByLength | Literal["symmetry axis", "equatorial axis", "any axis of a sphere"]
Stability = Literal["stable node", "saddle", "singular"]


@dataclass(frozen=True)
class FixedPoint:
    """One fixed point of the averaged equations, where the body turns with the fluid, ω = -½ ẑ."""

    # The body axis along the vorticity; a spheroid tumbles about an equatorial axis.
    rotation: Rotation
    # L and E of a triaxial ellipsoid (`lxmain`–`emain`), L and η of a spheroid
    # (`lxsmain`–`nsmain`), L of a sphere: L and E in the units of `Observables`, η in shear rates.
    state: tuple[float, ...]
    # Per unit of slow time, in the order of the paper: along L_x and L_y first. A singular point
    # has these two alone.
    eigenvalues: tuple[float, ...]

    @property
    def stability(self) -> Stability:
        """Stable node, saddle, or singular, where the equations have no linear approximation."""
        if len(self.eigenvalues) < len(self.state):
            return "singular"
        return "stable node" if max(self.eigenvalues) < 0 else "saddle"


def fixed_points(ellipsoid: Ellipsoid) -> tuple[FixedPoint, ...]:
    """All fixed points of the averaged equations of an ellipsoid.

    A triaxial ellipsoid has three, from the longest to the shortest axis (section `elsa`); the one
    of the middle axis is singular, see `polhode.models.theory.separatrix`. A spheroid has a pair of
    spinning ones and a tumbling one (`spinmode_sph`, `tumbmode_sph`, with L_z = -I_a/2 and -I_e/2),
    a sphere one.
    """
    if ellipsoid.kind == "sphere":
        momentum = (0.0, 0.0, -ellipsoid.inertia[0] / 2)
        return (FixedPoint("any axis of a sphere", momentum, eigenvalues(ellipsoid, 0)[:3]),)
    # Rotation, body axis along the vorticity, and the last slow variable. At ω = -½ ẑ that is E = I/8, or
    # η, the angular velocity along a spheroid's axis: ±½ with the axis along -ẑ or ẑ.
    rotations: list[tuple[Rotation, int, float]]
    if ellipsoid.symmetry_axis is None:
        rotations = [
            (get_args(ByLength)[i], axis, ellipsoid.inertia[axis] / 8)
            for i, axis in enumerate(ellipsoid.order)
        ]
    else:
        axial = ellipsoid.symmetry_axis
        equatorial = (ellipsoid.symmetry_axis + 1) % 3
        rotations = [
            ("symmetry axis", axial, 0.5),
            ("symmetry axis", axial, -0.5),
            ("equatorial axis", equatorial, 0.0),
        ]
    points = []
    for rotation, axis, last in rotations:
        rates = eigenvalues(ellipsoid, axis)[: 2 if rotation == "middle axis" else 4]
        points.append(FixedPoint(rotation, (0.0, 0.0, -ellipsoid.inertia[axis] / 2, last), rates))
    return tuple(points)


def eigenvalues(ellipsoid: Ellipsoid, axis: int) -> tuple[float, float, float, float]:
    """Eigenvalues λ₁₋₄ of uniform rotation about a body axis, per unit of slow time.

    The paper's lists for the longest and the shortest axis of an ellipsoid (section `elsa`) and for
    the spinning and the tumbling spheroid (section `lsds`) are one formula. About the middle axis
    of a triaxial ellipsoid only the first two hold, as limits that are approached like 1/log.
    """
    squares = [length * length for length in ellipsoid.scaled_axes]
    inertia = ellipsoid.inertia
    resistance = ellipsoid.resistance
    along_x = 0.0
    along_y = 0.0
    wobble = 0.0
    for across in ((axis + 1) % 3, (axis + 2) % 3):
        third = 3 - axis - across
        # Jeffery's angular velocity about the axis `across` has two terms, of weights `share` and
        # 1 - share. One of them makes L_x decay, the other L_y.
        share = squares[third] / (squares[axis] + squares[third])
        along_x += resistance[across] * share
        along_y += resistance[across] * (1 - share)
        wobble += resistance[across] * (inertia[axis] - inertia[across]) / inertia[across]
    factor = -8 * pi / inertia[axis]
    return factor * along_x, factor * along_y, factor * resistance[axis], factor * wobble


@dataclass(frozen=True)
class Attractor:
    """A stable state of the slow variables; the two senses of a spheroid's spin are one."""

    rotation: Rotation  # the body axis along the vorticity
    state: np.ndarray  # (L_x, L_y, L_z, E) over the largest moment of inertia
    reach: float  # distance, in the same units, within which a particle counts as arrived


def attractors(
    ellipsoid: Ellipsoid, stokes: float, radius: float, *, circling: bool
) -> tuple[Attractor, ...]:
    """Attractors in simple shear that are distinct from the other fixed points.

    `radius` is the distance in (L, E), over I_max, that still counts as arrived. `circling` says whether
    the equations hold the motion about the fixed point, which averaged ones do not: then `circle` is added.
    None at St = 0 and inf, nor any whose reach is half the distance of another fixed point or more: a shape close
    to a sphere, or a small St.
    """
    if stokes in (0, inf):
        return ()
    unit = max(ellipsoid.inertia)
    points = fixed_points(ellipsoid)
    # At L_z = -I/2 the energy is I/8, a quarter of |L_z|.
    states: dict[Rotation, np.ndarray] = {
        point.rotation: np.array([0.0, 0.0, point.state[2], -point.state[2] / 4]) / unit
        for point in points
    }
    stable = {point.rotation for point in points if point.stability == "stable node"}
    reach = radius + (circle(ellipsoid, stokes) if circling else 0.0)
    stable_states = []
    for rotation, state in states.items():
        distances = [
            float(np.linalg.norm(state - second))
            for name, second in states.items()
            if name != rotation
        ]
        if rotation in stable and reach < min(distances, default=inf) / 2:
            stable_states.append(Attractor(rotation, state, reach))
    return tuple(stable_states)


def circle(ellipsoid: Ellipsoid, stokes: float) -> float:
    """Distance in (L, E) over I_max at which a particle circles rotation about its shortest axis.

    To order 1/St.
    """
    # There ω̇ = -(d/St)(ω - Ω_J) with Ω_J = -½ + ½ Λ cos t; d is the damping rate and Λ the
    # anisotropy of the section across the axis. Hence ω oscillates by dΛ/(2 St) about -½, and
    # E = Iω²/2 by half that amplitude, I being I_max: together by √(1 + ¼) = √5/2 times dΛ/(2 St).
    # The distance is 0 for oblate spheroids.
    longest, middle, shortest = ellipsoid.order
    a2 = ellipsoid.scaled_axes[longest] ** 2
    b2 = ellipsoid.scaled_axes[middle] ** 2
    return sqrt(5) / 4 * ellipsoid.damping[shortest] * (a2 - b2) / (a2 + b2) / stokes

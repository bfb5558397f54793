"""Resonances k₁ν₁ + k₂ν₂ = 0 between polhode and precession: which ones a run meets, and what they do to it.

A mode that comes near its resonance is kept out of the transformation by a mask (`polhode.models.second_order.torus`)
and left in the averaged equations (`polhode.models.second_order.field`): partial averaging (Sanders, Verhulst &
Murdock, Averaging Methods in Nonlinear Dynamical Systems, 2nd ed., ch. 7).
"""

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np

from polhode.models.scene import Scene
from polhode.models.second_order import tables as triaxial
from polhode.models.second_order.averages import EVERY_FRAME, FRAMES, SIZES, every_pose, fitted, phases
from polhode.models.second_order.field import MODE_NODES
from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.tables import Table
from polhode.models.second_order.torus import Mask, Torus
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Width of a mask over ν₂ at the resonance: a divisor smaller than about this is not divided by.
WIDTH = 0.12
# Divisors over the width beyond which a mask vanishes.
REACH = 3.0
# Largest |k₁|, |k₂| of the resonances looked for, and points along the path at which they are.
MODES, POINTS = (20, 3), 200


@dataclass(frozen=True)
class Resonance:
    """A mode that comes near its resonance in a run."""

    mask: Mask
    met: bool  # whether the divisor passes 0
    slow_time: float  # when, and at which a², the divisor is smallest
    a2: float
    share: float  # strength of the mode over that of the torque
    kick: float  # over I_max, what it is predicted to give L: √(2π/(St |dD/dt₂|)) · 2|P_k|


def resonances(scene: Scene, side: SidedBody, path: Array, low: float, high: float) -> list[Resonance]:
    """Modes that come near their resonances for a² from `low` to `high`, the strongest first."""
    squares, polhode = _across(side, low, high)
    found = []
    for k2 in range(1, MODES[1] + 1):
        for k1 in range(-MODES[0], MODES[0] + 1):
            divisor = k1 * polhode.rate + k2 * polhode.precession
            nearest = int(np.argmin(np.abs(divisor)))
            mask = Mask(k1, k2, WIDTH * float(polhode.precession[nearest]))
            met = bool(divisor.min() <= 0 <= divisor.max())
            if (k1 + k2) % 2 == 0 and (met or abs(divisor[nearest]) < mask.width):
                each = _resonance(scene, side, path, float(squares[nearest]), mask, met)
                # Beyond it the mode's P/D² is no larger than that of other modes.
                if met or abs(divisor[nearest]) < sqrt(each.share) * polhode.precession[nearest]:
                    found.append(each)
    return sorted(found, key=lambda resonance: -resonance.kick)


def _across(side: SidedBody, low: float, high: float) -> tuple[Array, Polhodes]:
    """Equispaced a² from `low` to `high`, shape (POINTS,), and their polhodes."""
    squares = np.linspace(low, high, POINTS)
    level = triaxial.level(squares)
    return squares, Polhodes(side, level, np.zeros(POINTS), phases(side, float(level.max())))


def _resonance(scene: Scene, side: SidedBody, path: Array, a2: float, mask: Mask, met: bool) -> Resonance:
    """Strength over all orientations of L at the point of the path where a² is nearest; rate of passage there."""
    h = 2 * path[:, 4] / np.sum(path[:, 1:4] ** 2, axis=1)
    passed = triaxial.depth(np.clip(side.share(h), 0, 1 - 1e-12))
    i = int(np.argmin(np.abs(passed - a2)))
    size, unit = float(np.linalg.norm(path[i, 1:4])), max(scene.ellipsoid.inertia)
    m = len(FRAMES)
    level = np.full(m, float(triaxial.level(np.array(a2))))
    polhode = Polhodes(side, level, np.zeros(m), max(phases(side, level[0]), 2 * abs(mask.k1) + 2))
    spectrum = Torus(polhode, np.full(m, size), np.zeros(m), FRAMES[:, 0], FRAMES[:, 1]).spectrum[..., :3]
    strength = float(np.abs(spectrum[:, mask.k1, mask.k2]).max())
    j = min(max(i, 1), len(path) - 2)
    drift = abs((passed[j + 1] - passed[j - 1]) / (path[j + 1, 0] - path[j - 1, 0]))
    beside = polhode.beside
    per_level = abs(mask.k1 * beside.rate[0] + mask.k2 * beside.precession[0]) * size
    passage = per_level * drift / -np.expm1(-a2)
    # It acts no longer than the run.
    time = min(sqrt(2 * np.pi * scene.torque_factor / passage) if passage > 0 else np.inf, scene.slow_time)
    share = strength / float(np.abs(spectrum).max())
    return Resonance(mask, met, float(path[i, 0]), a2, share, 2 * strength * time / unit)


@lru_cache(maxsize=256)
def mode_table(ellipsoid: Ellipsoid, longest: bool, mask: Mask, low: float, high: float) -> Table:
    """Series of a mode where its mask does not vanish, for a² from `low` to `high`; rows as from `mode`."""
    side = triaxial.side_of(ellipsoid, longest)
    squares, polhode = _across(side, low, high)
    divisor = mask.k1 * polhode.rate + mask.k2 * polhode.precession
    near = np.flatnonzero(np.abs(divisor) < REACH * mask.width)
    low, high = (float(squares[i]) for i in (max(near[0] - 1, 0), min(near[-1] + 1, POINTS - 1)))
    points = triaxial.chebyshev(MODE_NODES, low, high)
    found = [mode(side, mask, float(y)) for y in triaxial.level(points)]
    rows = np.array([numbers for numbers, _ in found]).T
    rows[2:4] *= triaxial.per_square(points)
    return Table(low, high, triaxial.series_of(rows), max(residual for _, residual in found))


def mode(side: SidedBody, mask: Mask, y: float) -> tuple[Array, float]:
    """The numbers l₁, l₂, y₁, y₂, a₁, a₂, b₁, b₂, q₁, q₂, q₃, q₄ of a mode at y, and the misfit over its strength.

    With A and B the parts of the flow's strain and spin that turn k₂ times about n, P_k is i(l₁A + l₂B) for l, the same
    with y₁ and y₂ over l for y', (a₁A + a₂B)/l for α and the same with b₁ and b₂ for β; of L₁ + iL₂ it is
    i(q₁A + q₂B + q₃C) with parts of k₂ - 1 turns, C being -il where there are none, and of L₁ - iL₂ iq₄A with k₂ + 1.
    """
    torus = every_pose(side, y, max(phases(side, y), 2 * abs(mask.k1) + 2))
    rates, sizes = torus.spectrum[:, mask.k1, mask.k2], SIZES
    strain, spin = _turning(EVERY_FRAME)
    own, up = (strain[mask.k2], spin[mask.k2]), (strain[mask.k2 + 1],)
    down = (strain[mask.k2 - 1], spin[mask.k2 - 1], -1j * sizes * (mask.k2 == 1))
    across, round_n = rates[:, 0], 1j * rates[:, 1]
    slow = [(own, -1j * rates[:, 2]), (own, -1j * rates[:, 3] * sizes)]
    phase = [(own, rates[:, i] * sizes) for i in (4, 5)]
    numbers, misfit = fitted([*slow, *phase, (down, -1j * (across + round_n)), (up, -1j * (across - round_n))])
    return np.array(numbers), misfit


def _turning(frames: Array) -> tuple[Array, Array]:
    """Parts of the flow's strain and spin that turn 0, 1, … 4 times about n, shape (5, m) each."""
    x, y, z = (frames[:, i] for i in range(3))
    x1, y1 = x[:, 0] - 1j * x[:, 1], y[:, 0] - 1j * y[:, 1]
    none = np.zeros(len(frames), complex)
    one, other = 0.5 * x[:, 2] * y1, 0.5 * y[:, 2] * x1
    strain = [x[:, 2] * y[:, 2] + none, one + other, x1 * y1, none, none]
    return np.array(strain), np.array([-0.5j * z[:, 2], one - other, none, none, none])


def mode_parameters(
    ellipsoid: Ellipsoid, torque_factor: float, mask: Mask, found: Table, start: tuple[float, float]
) -> tuple[float, ...]:
    """Parameters of a mode in a `SlowField`, from its table and the phases α and β at the start."""
    unit = max(ellipsoid.inertia)
    scale = np.full(len(found.series), 1 / unit)
    scale[4:8] *= torque_factor
    scale[10] = 1.0
    return (
        mask.k1 / (mask.width * unit),
        mask.k2 / (mask.width * unit),
        mask.k1 / torque_factor,
        mask.k2 / torque_factor,
        mask.k1 * start[0] + mask.k2 * start[1],
        *triaxial.window(found.low, found.high),
        *(float(mask.k2 == turns) for turns in (1, 2, 3)),
        *(scale[:, None] * found.series).ravel().tolist(),
    )

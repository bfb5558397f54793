"""Second-order averaged triaxial ellipsoid on one side of L² = 2EI₂: tables of its field, and poses from its states."""

from dataclasses import dataclass
from functools import lru_cache
from math import pi

import numpy as np

from polhode.models.second_order.averages import NAMES, SECOND, averages, phases
from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.torus import Mask, Torus, least_rotation, skew
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Chebyshev coefficients per function of a²; more than the first number of them where masks give it steps.
NODES = (32, 64, 96)
# Powers of I_max that each coefficient carries when L is measured in it.
SCALES = {"f0": 0, "g0": 0, "a1": 2, "b1": 2, "p1": 2, "p2": 2, "nu1": -1, "nu2": -1} | dict.fromkeys(
    ("f2", "g2", "r1", "r2", "ea", "eb"), 1
)
HIGHEST_SCALE = 3


@dataclass(frozen=True)
class Table:
    """Chebyshev coefficients of functions of a² on one side, for a² from `low` to `high`."""

    low: float
    high: float
    series: Array  # one row per function: of averages in the order of `NAMES`, y' as (a²)'/a²
    residual: float  # relative misfit of the closed structure, largest over the nodes


def depth(x: Array) -> Array:
    """a² = -ln(1 - x)."""
    return -np.log1p(-x)


def level(a2: Array) -> Array:
    """y = ln(x/(1 - x)) of a²."""
    return np.log(np.expm1(a2))


@lru_cache(maxsize=64)
def table(
    ellipsoid: Ellipsoid, longest: bool, low: float, high: float, masks: tuple[Mask, ...] = (), nodes: int = NODES[0]
) -> Table:
    """Table of one side: that around the longest semi-axis, or that around the shortest."""
    side = side_of(ellipsoid, longest)
    points = chebyshev(nodes, low, high)
    found, residual = averages(side, level(points), masks)
    for name in ("g0", "g2", "b1", "b2"):
        found[name] = found[name] * per_square(points)
    return Table(low, high, series_of(np.stack([found[name] for name in NAMES])), residual)


def per_square(a2: Array) -> Array:
    """(a²)'/a² over y'."""
    return -np.expm1(-a2) / a2


def side_of(ellipsoid: Ellipsoid, longest: bool) -> SidedBody:
    """The side around the longest or the shortest semi-axis."""
    axis = ellipsoid.order[0 if longest else 2]
    return SidedBody.of(ellipsoid, np.eye(3)[axis])


def parameters(ellipsoid: Ellipsoid, torque_factor: float, averaged: Table) -> tuple[float, ...]:
    """Parameters p of a `SlowField` without modes: the table's middle and reciprocal half width, then its series."""
    unit = max(ellipsoid.inertia)
    rows = []
    for name, row in zip(NAMES, averaged.series, strict=True):
        factor = torque_factor if name in SECOND or name in ("ea", "eb") else 1.0
        rows.append(factor / unit ** SCALES.get(name, HIGHEST_SCALE) * row)
    return *window(averaged.low, averaged.high), *np.concatenate(rows).tolist()


def window(low: float, high: float) -> tuple[float, float]:
    """Middle and reciprocal half width of an interval."""
    return 0.5 * (low + high), 2 / (high - low)


def chebyshev(points: int, low: float, high: float) -> Array:
    """Chebyshev points of an interval."""
    angles = pi * (np.arange(points) + 0.5) / points
    return 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angles)


def series_of(values: Array) -> Array:
    """Chebyshev coefficients, shape (k, n), of functions given at the points of `chebyshev`, shape (k, n)."""
    nodes = values.shape[1]
    angles = pi * (np.arange(nodes) + 0.5) / nodes
    series = 2 / nodes * values @ np.cos(np.outer(angles, np.arange(nodes)))
    series[:, 0] /= 2
    return series


@dataclass(frozen=True)
class Pose:
    """Slow or exact states in ambient form: L, shape (m, 3), and R, body (permuted) to space, shape (m, 3, 3)."""

    momentum: Array
    rotation: Array


def frame(momentum: Array, first: Array) -> Array:
    """Q, shape (m, 3, 3): columns e₁, n × e₁, n."""
    n = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    first = first - np.sum(n * first, axis=1)[:, None] * n
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(n, first), n], axis=-1)


def torus_at(
    side: SidedBody, momentum: Array, q: Array, y: Array, alpha: Array, beta: Array, masks: tuple[Mask, ...] = ()
) -> Torus:
    """The perturbation around states given by their torus coordinates, each shape (m,) or with frames (m, 3, 3)."""
    nodes = max(phases(side, float(np.max(y))), 2)
    polhode = Polhodes(side, y, alpha, nodes)
    return Torus(polhode, np.linalg.norm(momentum, axis=1), beta, q[:, 0], q[:, 1], masks)


def coordinates(side: SidedBody, pose: Pose, q: Array) -> tuple[Array, Array, Array]:
    """y, α and β, each shape (m,), of poses in frames Q; NaN if any of them lies on the other side of L² = 2EI₂."""
    from scipy.special import ellipkinc, ellipkm1

    n = q[:, :, 2]
    z = np.einsum("mij,mi->mj", pose.rotation, n)
    i1, i2, i3 = side.inverse_inertia
    below = (i1 - i3) * z[:, 0] ** 2 + (i2 - i3) * z[:, 1] ** 2
    above = (i2 - i3) * z[:, 2] ** 2 - (i1 - i2) * z[:, 0] ** 2
    if not np.all(below * above > 0):
        nothing = np.full(len(z), np.nan)
        return nothing, nothing, nothing
    y = np.log(below / above)
    a2, _, complement = Polhodes(side, y, np.zeros_like(y), 2).moduli
    share = 1 / (1 + np.exp(-y))
    amplitude = np.arctan2(np.sign(i2 - i3) * z[:, 1] / np.sqrt(share), z[:, 0] / np.sqrt(a2))
    alpha = pi / 2 * ellipkinc(amplitude, 1 - complement) / ellipkm1(complement)
    nodes = phases(side, float(np.max(y)))
    lead = Polhodes(side, y, alpha, nodes).lead[:, 0]
    turn = np.einsum("mji,mjk,mlk->mil", q, pose.rotation, least_rotation(z))
    return y, alpha, np.arctan2(turn[:, 1, 0], turn[:, 0, 0]) - lead


def swung(side: SidedBody, torque_factor: float, q: Array, torus: Torus) -> Pose:
    """Exact poses of slow ones: the generator's flow over 1/St."""
    change, turn = torus.ambient_here
    m = np.concatenate([np.zeros((len(change), 2)), torus.size[:, None]], axis=1) + torque_factor * change
    slow = torus.rotation[:, 0, 0]
    return Pose(np.einsum("mij,mj->mi", q, m), q @ rotation_by(torque_factor * turn) @ slow)


def rotation_by(vectors: Array) -> Array:
    """Rotations, shape (m, 3, 3), by vectors, shape (m, 3), in rad (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross = skew(vectors)
    return np.eye(3) + np.sinc(angle / pi) * cross + 0.5 * np.sinc(angle / (2 * pi)) ** 2 * (cross @ cross)


def relative_swing(
    side: SidedBody, momentum: Array, q: Array, level: Array, masks: tuple[Mask, ...]
) -> tuple[Array, Torus]:
    """Largest change of L over l and turn of R by the generator, shape (m,), over all phases; their torus."""
    torus = torus_at(side, momentum, q, level, 0 * level, 0 * level, masks)
    change, turn = torus.ambient
    relative = np.linalg.norm(change, axis=-1) / torus.size[:, None, None] + np.linalg.norm(turn, axis=-1)
    return relative.max(axis=(1, 2)), torus

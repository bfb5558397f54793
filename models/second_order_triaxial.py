"""Second-order averaged triaxial ellipsoid on one side of L² = 2EI₂, away from low-order resonances.

State y = (L/I_max, a, e₁, σ_α, σ_β): a² = -ln(1 - x) with x = (h - i₃)/(i₂ - i₃) says how far the polhode is from the
permanent axis, e₁ ⊥ L is carried along by parallel transport, the polhode phase is St σ_α and the precession phase
St σ_β. The averages are Chebyshev series in a² (`polhode.models.second_order_averages`).
"""

from dataclasses import dataclass
from functools import lru_cache
from math import pi

import numpy as np

from polhode.models.operations import Field, Operations
from polhode.models.second_order_averages import FIRST, SECOND, averages, phases
from polhode.models.second_order_torus import Polhode, Side, Torus, least_rotation
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Chebyshev coefficients per function of a².
NODES = 32
NAMES = (*FIRST, *SECOND, "nu1", "nu2")
# Powers of I_max that each coefficient carries when L is measured in it.
SCALES = {"f0": 0, "g0": 0, "a1": 2, "b1": 2, "p1": 2, "p2": 2, "nu1": -1, "nu2": -1} | dict.fromkeys(
    ("f2", "g2", "r1", "r2", "ea", "eb"), 1
)
HIGHEST_SCALE = 3


@dataclass(frozen=True)
class Table:
    """Chebyshev coefficients of the averages on one side, for a² from `low` to `high`.

    Parameters
    ----------
    low, high : float
    series : ndarray, shape (20, NODES)
        Rows in the order of `NAMES`; y' is divided by (a²)'s own factor, so that a' = a/2 times its row.
    residual : float
        Relative misfit of the closed structure, largest over the nodes.
    """

    low: float
    high: float
    series: Array
    residual: float


def depth(x: Array) -> Array:
    """a² = -ln(1 - x)."""
    return -np.log1p(-x)


def level(a2: Array) -> Array:
    """y = ln(x/(1 - x)) of a²."""
    return np.log(np.expm1(a2))


@lru_cache(maxsize=64)
def table(ellipsoid: Ellipsoid, longest: bool, low: float, high: float) -> Table:
    """Table of one side: that around the longest semi-axis, or that around the shortest."""
    side = side_of(ellipsoid, longest)
    angles = pi * (np.arange(NODES) + 0.5) / NODES
    points = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angles)
    found, residual = averages(side, level(points))
    # (a²)' = y'(1 - exp(-a²)), divided here by a².
    for name in ("g0", "g2", "b1", "b2"):
        found[name] = found[name] * -np.expm1(-points) / points
    values = np.stack([found[name] for name in NAMES])
    series = 2 / NODES * values @ np.cos(np.outer(angles, np.arange(NODES)))
    series[:, 0] /= 2
    return Table(low, high, series, residual)


def side_of(ellipsoid: Ellipsoid, longest: bool) -> Side:
    """The side around the longest or the shortest semi-axis."""
    axis = ellipsoid.order[0 if longest else 2]
    return Side.of(ellipsoid, np.eye(3)[axis])


def parameters(ellipsoid: Ellipsoid, torque_factor: float, averaged: Table) -> tuple[float, ...]:
    """Parameters p of `field`: 1/St, the table's middle and half width, then the series."""
    unit = max(ellipsoid.inertia)
    rows = []
    for name, row in zip(NAMES, averaged.series, strict=True):
        factor = torque_factor if name in SECOND or name in ("ea", "eb") else 1.0
        rows.append(factor / unit ** SCALES.get(name, HIGHEST_SCALE) * row)
    middle, half = 0.5 * (averaged.low + averaged.high), 0.5 * (averaged.high - averaged.low)
    return middle, 1 / half, *np.concatenate(rows).tolist()


def field(ops: Operations) -> Field:
    """Rates of (L/I_max, a, e₁, σ_α, σ_β) in slow time; p as from `parameters`."""
    root = ops.sqrt

    def rhs(y, p):
        lx, ly, lz, a, ex, ey, ez = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
        size = root(lx * lx + ly * ly + lz * lz)
        over = 1 / size
        nx, ny, nz = lx * over, ly * over, lz * over
        sx, sy, s0 = 0.5 * ny, 0.5 * nx, nx * ny
        w, s = 0.5 * nz * over, s0 * over

        t = (a * a - p[0]) * p[1]
        before, now = 1 + 0 * t, t
        f0, f2 = p[2] + p[3] * t, p[34] + p[35] * t
        g0, g2 = p[66] + p[67] * t, p[98] + p[99] * t
        r1, r2 = p[130] + p[131] * t, p[162] + p[163] * t
        ea, eb = p[194] + p[195] * t, p[226] + p[227] * t
        a1, a2 = p[258] + p[259] * t, p[290] + p[291] * t
        b1, b2 = p[322] + p[323] * t, p[354] + p[355] * t
        p1, p2 = p[386] + p[387] * t, p[418] + p[419] * t
        p3, p4 = p[450] + p[451] * t, p[482] + p[483] * t
        p5, p6 = p[514] + p[515] * t, p[546] + p[547] * t
        nu1, nu2 = p[578] + p[579] * t, p[610] + p[611] * t
        for k in range(2, NODES):
            before, now = now, 2 * t * now - before
            f0, f2 = f0 + p[2 + k] * now, f2 + p[34 + k] * now
            g0, g2 = g0 + p[66 + k] * now, g2 + p[98 + k] * now
            r1, r2 = r1 + p[130 + k] * now, r2 + p[162 + k] * now
            ea, eb = ea + p[194 + k] * now, eb + p[226 + k] * now
            a1, a2 = a1 + p[258 + k] * now, a2 + p[290 + k] * now
            b1, b2 = b1 + p[322 + k] * now, b2 + p[354 + k] * now
            p1, p2 = p1 + p[386 + k] * now, p2 + p[418 + k] * now
            p3, p4 = p3 + p[450 + k] * now, p4 + p[482 + k] * now
            p5, p6 = p5 + p[514 + k] * now, p6 + p[546 + k] * now
            nu1, nu2 = nu1 + p[578 + k] * now, nu2 + p[610 + k] * now

        growth = f0 + f2 * w + over * s * (a1 + a2 * w)
        # L'⊥ = n × (S u₁ + W u₂) + S⊥ v₁ + W v₂ with S = (sx, sy, 0) and W = (sx, -sy, 0).
        u1, u2 = r1 + over * s * p3, r2 + over * s * p4
        v1, v2 = over * (p1 + p5 * w), over * (p2 + p6 * w)
        ux, uy, flat = sx * (u1 + u2), sy * (u1 - u2), v1 * s0
        tx = sx * (v1 + v2) - nz * uy - flat * nx
        ty = sy * (v1 - v2) + nz * ux - flat * ny
        tz = nx * uy - ny * ux - flat * nz
        lost = (ex * tx + ey * ty + ez * tz) * over
        return (
            growth * lx + tx,
            growth * ly + ty,
            growth * lz + tz,
            0.5 * a * (g0 + g2 * w + over * s * (b1 + b2 * w)),
            -lost * nx,
            -lost * ny,
            -lost * nz,
            size * nu1 + ea * s,
            size * nu2 + eb * s,
        )

    return rhs


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


def torus_at(side: Side, momentum: Array, q: Array, y: Array, alpha: Array, beta: Array) -> Torus:
    """The perturbation around states given by their torus coordinates, each shape (m,) or with frames (m, 3, 3)."""
    nodes = max(phases(side, float(np.max(y))), 2)
    polhode = Polhode(side, y, alpha, nodes)
    return Torus(polhode, np.linalg.norm(momentum, axis=1), beta, q[:, 0], q[:, 1])


def coordinates(side: Side, pose: Pose, q: Array) -> tuple[Array, Array, Array]:
    """y, α and β, each shape (m,), of poses in frames Q."""
    from scipy.special import ellipkinc, ellipkm1

    n = q[:, :, 2]
    z = np.einsum("mij,mi->mj", pose.rotation, n)
    i1, i2, i3 = side.inverse_inertia
    below = (i1 - i3) * z[:, 0] ** 2 + (i2 - i3) * z[:, 1] ** 2
    above = (i2 - i3) * z[:, 2] ** 2 - (i1 - i2) * z[:, 0] ** 2
    y = np.log(below / above)
    a2, _, complement = Polhode(side, y, np.zeros_like(y), 2).moduli
    share = 1 / (1 + np.exp(-y))
    amplitude = np.arctan2(np.sign(i2 - i3) * z[:, 1] / np.sqrt(share), z[:, 0] / np.sqrt(a2))
    alpha = pi / 2 * ellipkinc(amplitude, 1 - complement) / ellipkm1(complement)
    nodes = phases(side, float(np.max(y)))
    lead = Polhode(side, y, alpha, nodes).lead[:, 0]
    turn = np.einsum("mji,mjk,mlk->mil", q, pose.rotation, least_rotation(z))
    return y, alpha, np.arctan2(turn[:, 1, 0], turn[:, 0, 0]) - lead


def swung(side: Side, torque_factor: float, q: Array, torus: Torus) -> Pose:
    """Exact poses of slow ones: the generator's flow over 1/St."""
    change, turn = torus.ambient_here
    m = np.concatenate([np.zeros((len(change), 2)), torus.size[:, None]], axis=1) + torque_factor * change
    slow = torus.rotation[:, 0, 0]
    return Pose(np.einsum("mij,mj->mi", q, m), q @ rotation_by(torque_factor * turn) @ slow)


def rotation_by(vectors: Array) -> Array:
    """Rotations, shape (m, 3, 3), by vectors, shape (m, 3), in rad (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    skew = np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), (0, 1), (-2, -1))
    return np.eye(3) + np.sinc(angle / pi) * skew + 0.5 * np.sinc(angle / (2 * pi)) ** 2 * (skew @ skew)

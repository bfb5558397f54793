"""What a triaxial scene needs before it can be averaged to second order: its side, its table, its slow start.

A run is refused where averaging to second order does not hold: through L² = 2EI₂, or where polhode and precession
resonate, k₁ν₁ + k₂ν₂ = 0, in a mode that the torque drives.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import inf, pi, sqrt

import numpy as np

from polhode.models import averaged
from polhode.models import second_order_triaxial as triaxial
from polhode.models.observables import Observables
from polhode.models.operations import FLOAT
from polhode.models.scene import Scene
from polhode.models.second_order_averages import FRAMES, phases
from polhode.models.second_order_error import Estimate
from polhode.models.second_order_torus import SMALLEST_DIVISOR, Polhode, Side, Torus
from polhode.models.second_order_triaxial import Pose
from polhode.models.slow_path import slow_path

Array = np.ndarray

# The table reaches beyond the first-order path by this share of a², and a² stays between these.
MARGIN = 0.07
LEAST, MOST = 1e-8, 5.0
# Modes driven by less than this share of the torque kick by less than the form's own error.
FAINT = 1e-8
# Largest |k₁|, |k₂| of the resonances looked for, and points along the path at which they are.
MODES, POINTS = (20, 3), 200
# Last Chebyshev coefficients over the largest, above which a table does not resolve its functions.
UNRESOLVED = 1e-6
START_PASSES, START_CLOSE = 60, 1e-14
# Points along the path at which the transformation's size is taken.
ESTIMATES = 40
# Times whose tori are held in memory together.
CHUNK = 128


class NotAveragedError(ValueError):
    """Second-order averaging does not hold for a run; the message is the condition."""


@dataclass(frozen=True)
class Prepared:
    """A run ready to be solved.

    Parameters
    ----------
    side : Side
    table : Table
    state : tuple of 9 float
        Slow start in the coordinates of `second_order_triaxial.field`.
    phases : tuple of 2 float
        α and β of the slow start.
    path : ndarray, shape (m, 5)
        t₂ and (L, E) along the first-order solution.
    """

    side: Side
    table: triaxial.Table
    state: tuple[float, ...]
    phases: tuple[float, float]
    path: Array


@dataclass(frozen=True)
class Resonance:
    """A resonance k₁ν₁ + k₂ν₂ = 0 met by a run, and the kick over I_max that it is predicted to give L."""

    k1: int
    k2: int
    slow_time: float
    share: float
    kick: float


@lru_cache(maxsize=64)
def prepared(scene: Scene) -> Prepared:
    """Prepare a triaxial scene of finite St, with orientation and L not 0.

    Raises
    ------
    NotAveragedError
        If the run crosses L² = 2EI₂ or resonates, or if St is too small for its start.
    """
    ellipsoid = scene.ellipsoid
    rotation, momentum = scene.initial.rotation[0], scene.initial.angular_momentum[0]
    body = rotation @ momentum
    side = Side.of(ellipsoid, body)
    path, squares = first_order_path(scene)
    if squares.min() < LEAST:
        raise NotAveragedError("the body rotates about a principal axis, where the polhode has no phase")
    low, high = _rounded(squares.min() * (1 - MARGIN), squares.max() * (1 + MARGIN))
    for resonance in resonances(scene, side, path, low, high):
        if resonance.share > FAINT:
            raise NotAveragedError(
                f"polhode and precession resonate ({resonance.k1}, {resonance.k2}) near "
                f"t₂ = {resonance.slow_time:.3g}, which would kick L by {resonance.kick:.1e} I_max"
            )
    longest = abs(side.axes[2, ellipsoid.order[0]]) == 1
    averages = triaxial.table(ellipsoid, longest, low, high)
    tail = np.abs(averages.series[:, -3:]).max(axis=1) / np.abs(averages.series).max(axis=1)
    if tail.max() > UNRESOLVED:
        raise NotAveragedError(f"the averages are not resolved (to {tail.max():.0e}): a resonance is too close")
    exact = Pose(momentum[None], (rotation.T @ side.axes.T)[None])
    slow, y, alpha, beta = _slow_start(side, scene.torque_factor, exact)
    a2 = float(np.log1p(np.exp(y)))
    if not low <= a2 <= high:
        raise NotAveragedError(f"St = {scene.stokes:g} is too small for this start")
    unit = max(ellipsoid.inertia)
    state = (*(slow.momentum[0] / unit).tolist(), sqrt(a2), *_first(slow.momentum)[0, :, 0].tolist(), 0.0, 0.0)
    return Prepared(side, averages, state, (alpha, beta), path)


def first_order_path(scene: Scene) -> tuple[Array, Array]:
    """First-order solution (t₂, L, E), shape (m, 5), and its a², shape (m,).

    Raises
    ------
    NotAveragedError
        If it crosses or comes close to L² = 2EI₂.
    """
    rhs, p = averaged.field(FLOAT), averaged.coefficients(scene.ellipsoid)
    unit = max(scene.ellipsoid.inertia)
    start = scene.initial.slow[0] / unit
    times, states = slow_path(lambda y: np.array(rhs(tuple(y.tolist()), p)), start, scene.slow_time)
    states = unit * states
    inertia = np.sort(scene.ellipsoid.inertia)
    h = 2 * states[:, 3] / np.sum(states[:, :3] ** 2, axis=1)
    near = 1 / inertia[2] if h[0] < 1 / inertia[1] else 1 / inertia[0]
    x = (h - near) / (1 / inertia[1] - near)
    beyond = np.flatnonzero(~(x < -np.expm1(-MOST)))
    if len(beyond):
        raise NotAveragedError(f"the run meets L² = 2EI₂ near t₂ = {times[beyond[0]]:.3g}")
    if times[-1] < scene.slow_time:
        raise NotAveragedError(f"|L| falls to 0 near t₂ = {times[-1]:.3g}")
    return np.column_stack([times, states]), triaxial.depth(np.maximum(x, 0))


def resonances(scene: Scene, side: Side, path: Array, low: float, high: float) -> list[Resonance]:
    """Resonances between polhode and precession for a² from `low` to `high`, the strongest first."""
    squares = np.linspace(low, high, POINTS)
    level = triaxial.level(squares)
    polhode = Polhode(side, level, np.zeros(POINTS), phases(side, float(level.max())))
    ratio = polhode.precession / polhode.rate
    found = []
    for k2 in range(1, MODES[1] + 1):
        for k1 in range(-MODES[0], MODES[0] + 1):
            divisor = k1 + k2 * ratio
            nearest = int(np.argmin(np.abs(divisor)))
            met = divisor.min() <= 0 <= divisor.max() or abs(divisor[nearest]) < 2 * SMALLEST_DIVISOR * ratio[nearest]
            if (k1 + k2) % 2 == 0 and met:
                found.append(_resonance(scene, side, path, squares[nearest], k1, k2))
    return sorted(found, key=lambda resonance: -resonance.share)


def _resonance(scene: Scene, side: Side, path: Array, a2: float, k1: int, k2: int) -> Resonance:
    """Strength over all orientations of L at the point of the path where a² is nearest; rate of passage there."""
    h = 2 * path[:, 4] / np.sum(path[:, 1:4] ** 2, axis=1)
    passed = triaxial.depth(np.clip(side.share(h), 0, 1 - 1e-12))
    i = int(np.argmin(np.abs(passed - a2)))
    size = float(np.linalg.norm(path[i, 1:4]))
    m = len(FRAMES)
    level = np.full(m, float(triaxial.level(np.array(a2))))
    polhode = Polhode(side, level, np.zeros(m), max(phases(side, level[0]), 2 * abs(k1) + 2))
    spectrum = Torus(polhode, np.full(m, size), np.zeros(m), FRAMES[:, 0], FRAMES[:, 1]).spectrum[..., :3]
    strength = float(np.abs(spectrum[:, k1, k2]).max())
    j = min(max(i, 1), len(path) - 2)
    drift = abs((passed[j + 1] - passed[j - 1]) / (path[j + 1, 0] - path[j - 1, 0]))
    beside = polhode.beside
    per_level = abs(k1 * beside.rate[0] + k2 * beside.precession[0]) * size
    passage = per_level * drift / -np.expm1(-a2) if drift > 0 else 0.0
    kick = (
        sqrt(2 * pi * scene.torque_factor / passage) * 2 * strength / max(scene.ellipsoid.inertia) if passage else inf
    )
    return Resonance(k1, k2, float(path[i, 0]), strength / float(np.abs(spectrum).max()), kick)


def _rounded(low: float, high: float) -> tuple[float, float]:
    """Bounds to three digits, outwards, so that near runs share a table."""
    down, up = 10 ** (np.floor(np.log10([low, high])) - 2)
    return float(np.floor(low / down) * down), float(np.ceil(high / up) * up)


def _first(momentum: Array) -> Array:
    """Frames Q of L alone, shape (m, 3, 3)."""
    away = np.eye(3)[np.argmin(np.abs(momentum), axis=1)]
    return triaxial.frame(momentum, away)


def _slow_start(side: Side, torque_factor: float, exact: Pose) -> tuple[Pose, float, float, float]:
    """Slow pose whose image is the exact one, with its y, α and β in the frame of `_first`."""
    slow = exact
    for _ in range(START_PASSES):
        q = _first(slow.momentum)
        y, alpha, beta = triaxial.coordinates(side, slow, q)
        if not np.all(np.isfinite([y, alpha, beta])):
            break
        image = triaxial.swung(side, torque_factor, q, triaxial.torus_at(side, slow.momentum, q, y, alpha, beta))
        excess = image.momentum - exact.momentum
        turn = image.rotation @ np.swapaxes(exact.rotation, 1, 2)
        vector = 0.5 * (turn - np.swapaxes(turn, 1, 2))[:, [2, 0, 1], [1, 2, 0]]
        if max(np.abs(excess).max() / np.linalg.norm(exact.momentum), np.abs(vector).max()) < START_CLOSE:
            return slow, float(y[0]), float(alpha[0]), float(beta[0])
        slow = Pose(slow.momentum - excess, triaxial.rotation_by(-vector) @ slow.rotation)
    raise NotAveragedError(f"St = {1 / torque_factor:g} is too small for this start")


def observe(scene: Scene, states: Array) -> Observables:
    """Observables with the complete rotation of states, shape (n, 9): fast phases and O(1/St) swing put back."""
    run, ellipsoid = prepared(scene), scene.ellipsoid
    pieces = [_exact(scene, run, states[i : i + CHUNK]) for i in range(0, len(states), CHUNK)]
    momentum = np.concatenate([piece.momentum for piece in pieces])
    rotation = np.swapaxes(np.concatenate([piece.rotation for piece in pieces]) @ run.side.axes, 1, 2)
    body = np.einsum("mij,mj->mi", rotation, momentum)
    return Observables(momentum, 0.5 * np.sum(body**2 / np.array(ellipsoid.inertia), axis=1), rotation)


def _exact(scene: Scene, run: Prepared, states: Array) -> Pose:
    alpha, beta = (phase + scene.stokes * states[:, 7 + i] for i, phase in enumerate(run.phases))
    momentum = states[:, :3] * max(scene.ellipsoid.inertia)
    q = triaxial.frame(momentum, states[:, 4:7])
    torus = triaxial.torus_at(run.side, momentum, q, triaxial.level(states[:, 3] ** 2), alpha, beta)
    return triaxial.swung(run.side, scene.torque_factor, q, torus)


@lru_cache(maxsize=64)
def estimated(scene: Scene) -> Estimate:
    """Model errors: the second-order term along the path, times the size of the transformation that it rests on."""
    run, factor, unit = prepared(scene), scene.torque_factor, max(scene.ellipsoid.inertia)
    rhs = triaxial.field(FLOAT)
    both, without = (triaxial.parameters(scene.ellipsoid, each, run.table) for each in (factor, 0.0))

    def rates(y: Array) -> Array:
        return np.array(rhs((*y.tolist(), 0.0, 0.0), both)[:7])

    times, states = slow_path(rates, np.array(run.state[:7]), scene.slow_time)
    inside = (run.table.low <= states[:, 3] ** 2) & (states[:, 3] ** 2 <= run.table.high)
    if times[-1] < scene.slow_time or not inside.all():
        return Estimate(inf, pi)
    gained = np.array([np.array(rhs((*y, 0.0, 0.0), without)[:3]) for y in states.tolist()])
    gained = np.abs(np.array([rates(y)[:3] for y in states]) - gained)
    second = np.concatenate([[0.0], np.cumsum(np.diff(times) * 0.5 * (gained[1:] + gained[:-1]).max(axis=1))])

    few = np.unique(np.linspace(0, len(times) - 1, ESTIMATES).astype(int))
    times, states, second = times[few], states[few], second[few]
    momentum = states[:, :3] * unit
    level = triaxial.level(states[:, 3] ** 2)
    torus = triaxial.torus_at(run.side, momentum, triaxial.frame(momentum, states[:, 4:]), level, 0 * level, 0 * level)
    change, turn = torus.ambient
    relative = np.linalg.norm(change, axis=-1) / torus.size[:, None, None] + np.linalg.norm(turn, axis=-1)
    swing = factor * relative.max(axis=(1, 2))
    slow = (second + swing * torus.size / unit) * swing
    speed = slow / factor * torus.polhode.precession * unit
    phase = np.sum(np.diff(times) * 0.5 * (speed[1:] + speed[:-1])) + swing.max()
    return Estimate(float(slow.max()), min(float(phase), pi))

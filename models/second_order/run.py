"""What a triaxial scene needs before it can be averaged to second order: its side, its table, its slow start.

A run is refused where averaging to second order does not hold: through L² = 2EI₂, or where polhode and precession
resonate, k₁ν₁ + k₂ν₂ = 0, in a mode that the torque drives.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, sqrt

import numpy as np

from polhode.models.forms import averaged
from polhode.models.observables import Observables
from polhode.models.operations import FLOAT
from polhode.models.scene import Scene, SlowStart
from polhode.models.second_order import tables as triaxial
from polhode.models.second_order.field import SlowField
from polhode.models.second_order.polhodes import SidedBody
from polhode.models.second_order.resonance import Resonance, mode_parameters, mode_table, resonances
from polhode.models.second_order.slow_path import slow_path
from polhode.models.second_order.tables import Pose
from polhode.models.second_order.torus import Mask
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# The table reaches beyond the first-order path by this share of a², and a² stays between these.
MARGIN = 0.07
LEAST, MOST = 1e-8, 5.0
# Modes driven by less than this share of the torque are left as they are; those that kick by less than this share of
# the error expected anyway are left out at their resonance, and their kick joins the estimate.
FAINT, SMALL_KICK = 1e-8, 0.1
# Resonant modes that a run may hold.
MOST_MODES = 8
# Last Chebyshev coefficients over the largest, above which a table does not resolve its functions.
UNRESOLVED = 1e-6
START_PASSES, START_CLOSE = 60, 1e-14
# Points along the path at which the transformation's size is taken.
ESTIMATES = 40
# Times whose tori are held in memory together.
CHUNK = 128
# Shares of the time to L² = 2EI₂ at which a run is tried to be stopped.
STOPS = (0.97, 0.94, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5)


class NotAveragedError(ValueError):
    """Second-order averaging does not hold for a run; the message is the condition, `until` the t₂ where it fails."""

    def __init__(self, condition: str, until: float = 0.0) -> None:
        super().__init__(condition)
        self.until = until


@dataclass(frozen=True)
class Prepared:
    """A run ready to be solved."""

    side: SidedBody
    table: triaxial.Table
    field: SlowField
    parameters: tuple[float, ...]  # what the field receives
    state: tuple[float, ...]  # slow start in the field's coordinates
    phases: tuple[float, float]  # α and β of the slow start
    path: Array  # t₂ and (L, E) along the first-order solution, shape (m, 5)
    treated: tuple[Resonance, ...] = ()  # resonant modes that the field keeps
    dropped: tuple[Resonance, ...] = ()  # those that neither it nor the transformation has

    @property
    def masks(self) -> tuple[Mask, ...]:
        """Masks of all of them."""
        return tuple(each.mask for each in (*self.treated, *self.dropped))


@lru_cache(maxsize=64)
def prepared(scene: Scene) -> Prepared:
    """Prepare a triaxial scene of finite St, with orientation and L not 0; raises NotAveragedError if it cannot be."""
    ellipsoid = scene.ellipsoid
    rotation, momentum = scene.initial.rotation[0], scene.initial.angular_momentum[0]
    body = rotation @ momentum
    side = SidedBody.of(ellipsoid, body)
    path, squares = first_order_path(scene)
    low, high, met = _met(scene, side, path, squares)
    treated, dropped = _sorted_out(scene, side, path, squares, met)
    longest = abs(side.axes[2, ellipsoid.order[0]]) == 1
    masks = tuple(each.mask for each in (*treated, *dropped))
    averages = _resolved(ellipsoid, longest, low, high, masks)
    exact = Pose(momentum[None], (rotation.T @ side.axes.T)[None])
    slow, y, alpha, beta = _slow_start(side, scene.torque_factor, exact, masks)
    a2 = float(np.log1p(np.exp(y)))
    if not low <= a2 <= high:
        raise NotAveragedError(f"St = {scene.stokes:g} is too small for this start")
    unit = max(ellipsoid.inertia)
    state = (*(slow.momentum[0] / unit).tolist(), sqrt(a2), *_first(slow.momentum)[0, :, 0].tolist(), 0.0, 0.0)
    p = list(triaxial.parameters(ellipsoid, scene.torque_factor, averages))
    for each in treated:
        found = mode_table(ellipsoid, longest, each.mask, low, high)
        p += mode_parameters(ellipsoid, scene.torque_factor, each.mask, found, (alpha, beta))
    field = SlowField(averages.series.shape[1], len(treated))
    return Prepared(side, averages, field, tuple(p), state, (alpha, beta), path, treated, dropped)


def _moves(scene: Scene) -> bool:
    """Whether there is a slow motion of a triaxial ellipsoid to be followed."""
    motion = 0 < scene.stokes < inf and np.any(scene.initial.angular_momentum)
    return scene.ellipsoid.kind == "triaxial" and bool(motion)


@lru_cache(maxsize=256)
def resonates(scene: Scene) -> bool:
    """Whether a run comes near resonances; False where it cannot be followed at all."""
    if not _moves(scene) or isinstance(scene.start, SlowStart):
        return False
    body = scene.initial.rotation[0] @ scene.initial.angular_momentum[0]
    try:
        return bool(_met(scene, SidedBody.of(scene.ellipsoid, body), *first_order_path(scene))[2])
    except NotAveragedError:
        return False


def _met(scene: Scene, side: SidedBody, path: Array, squares: Array) -> tuple[float, float, list[Resonance]]:
    """Bounds of a² for tables, and the resonances between them."""
    if squares.min() < LEAST:
        raise NotAveragedError("the body rotates about a principal axis, where the polhode has no phase")
    low, high = _rounded(squares.min() * (1 - MARGIN), squares.max() * (1 + MARGIN))
    return low, high, [each for each in resonances(scene, side, path, low, high) if each.share > FAINT]


def shorter(scene: Scene) -> Iterator[Scene]:
    """The same run, ended ever shorter of L² = 2EI₂; nothing if it is not triaxial or does not meet it."""
    if not _moves(scene):
        return
    try:
        first_order_path(scene)
    except NotAveragedError as error:
        if error.until > 0:
            yield from (replace(scene, time=share * error.until * scene.stokes) for share in STOPS)


def _sorted_out(
    scene: Scene, side: SidedBody, path: Array, squares: Array, met: list[Resonance]
) -> tuple[tuple[Resonance, ...], tuple[Resonance, ...]]:
    """Of the resonances of a run, those to be treated and those that it may do without."""
    few = path[np.unique(np.linspace(0, len(path) - 1, ESTIMATES).astype(int))]
    level = triaxial.level(np.interp(few[:, 0], path[:, 0], np.maximum(squares, LEAST)))
    masks = tuple(each.mask for each in met)
    swing = scene.torque_factor * triaxial.relative_swing(side, few[:, 1:4], _first(few[:, 1:4]), level, masks)[0]
    size = np.linalg.norm(few[:, 1:4], axis=1) / max(scene.ellipsoid.inertia)
    expected = float((swing**2 * size).max())
    treated = [each for each in met if each.kick > SMALL_KICK * expected]
    for each in treated[MOST_MODES:]:
        if each.kick > expected:
            raise NotAveragedError(
                f"polhode and precession resonate in {len(treated)} modes, of which {MOST_MODES} are treated and "
                f"({each.mask.k1}, {each.mask.k2}) near t₂ = {each.slow_time:.3g} would kick L by {each.kick:.1e} I_max"
            )
    kept = tuple(treated[:MOST_MODES])
    return kept, tuple(each for each in met if each.met and each not in kept)


def _resolved(ellipsoid: Ellipsoid, longest: bool, low: float, high: float, masks: tuple[Mask, ...]) -> triaxial.Table:
    """The table, with as many nodes as it needs."""
    tail = inf
    for nodes in triaxial.NODES if masks else triaxial.NODES[:1]:
        averages = triaxial.table(ellipsoid, longest, low, high, masks, nodes)
        tail = float((np.abs(averages.series[:, -3:]).max(axis=1) / np.abs(averages.series).max(axis=1)).max())
        if tail <= UNRESOLVED:
            return averages
    raise NotAveragedError(f"the averages are not resolved (to {tail:.0e}): a resonance is too close")


def first_order_path(scene: Scene) -> tuple[Array, Array]:
    """First-order solution (t₂, L, E), shape (m, 5), and its a², shape (m,), if it keeps away from L² = 2EI₂."""
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
        until = float(times[beyond[0]])
        raise NotAveragedError(f"the run meets L² = 2EI₂ near t₂ = {until:.3g}", until)
    if times[-1] < scene.slow_time:
        raise NotAveragedError(f"|L| falls to 0 near t₂ = {times[-1]:.3g}")
    return np.column_stack([times, states]), triaxial.depth(np.maximum(x, 0))


def _rounded(low: float, high: float) -> tuple[float, float]:
    """Bounds to three digits, outwards, so that near runs share a table."""
    down, up = 10 ** (np.floor(np.log10([low, high])) - 2)
    return float(np.floor(low / down) * down), float(np.ceil(high / up) * up)


def _first(momentum: Array) -> Array:
    """Frames Q of L alone, shape (m, 3, 3)."""
    away = np.eye(3)[np.argmin(np.abs(momentum), axis=1)]
    return triaxial.frame(momentum, away)


def _slow_start(
    side: SidedBody, torque_factor: float, exact: Pose, masks: tuple[Mask, ...]
) -> tuple[Pose, float, float, float]:
    """Slow pose whose image is the exact one, with its y, α and β in the frame of `_first`."""
    slow = exact
    for _ in range(START_PASSES):
        q = _first(slow.momentum)
        y, alpha, beta = triaxial.coordinates(side, slow, q)
        if not np.all(np.isfinite([y, alpha, beta])):
            break
        torus = triaxial.torus_at(side, slow.momentum, q, y, alpha, beta, masks)
        image = triaxial.swung(side, torque_factor, q, torus)
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
    torus = triaxial.torus_at(run.side, momentum, q, triaxial.level(states[:, 3] ** 2), alpha, beta, run.masks)
    return triaxial.swung(run.side, scene.torque_factor, q, torus)

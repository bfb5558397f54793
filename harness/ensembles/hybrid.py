"""Hybrid equations of many particles: averaged to first order where that is good enough, form `hybrid` elsewhere.

An error of L and E far above 1/St leaves the fast phases open: St times as large an angle. So
a method that keeps no more than that error may draw them evenly, as averaging says they are. The
error of averaging is largest where |L| is least; how small |L| may become is found on a sample that
runs both ways. A particle of smaller |L| follows the full equations until |L| has grown again, or
form `hybrid` where that would take longer.

`docs/scaling.md`, under Hybrid, says what users see of it. Words used here: L is the angular
momentum and I_max the largest moment of inertia. "Both ways" is averaged and by form `hybrid`.
"In lanes" is many particles side by side in SIMD registers, "alone" is one after another. The
"torus" of an L and E holds all orientations and angular velocities that have them. In shapes, m
counts times, n particles, and d components of a full state: (q, ω) of a triaxial body, (L, p̂) of
a spheroid. An averaged state has four: L and E over I_max of a triaxial body, L over the equatorial
moment of inertia and the spin about p̂ of a spheroid.
"""

from dataclasses import replace
from math import inf

import numpy as np

from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.forms.spheroid import Spheroid
from polhode.models.hybrid.plan import ERROR_PER_TOLERANCE
from polhode.models.libraries import IMPORTS
from polhode.models.scene import Scene, SlowStart
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import available_like
from polhode.solvers.contract import Status, installed
from polhode.solvers.ensembles.adaptive_steps import run_adaptive
from polhode.solvers.ensembles.equal_steps import TAYLOR, run, unplanned
from polhode.solvers.ensembles.taylor_batch import run_batches
from polhode.solvers.solve import solve

# Solver of particles that run one at a time.
SOLVER = "cyrk-vern8"
# Requested error times St from which on phases are drawn: the median error of averaging is some
# 14/St.
_OPEN = 10.0
# Particles that run both ways, some seconds of work; an estimate.
BOTH_WAYS = 64
# Particles that they are chosen from, averaged in lanes at little cost.
POOL = 4096
# Share of all particles that may miss the error: form `hybrid` is meant to keep it in 97.5 %.
_MISSED = 0.025
# Full equations last until |L| is this multiple of the least one that may be averaged; an estimate.
_CLEAR = 1.25
# Longest time, in inverse shear rates, for which full equations in lanes stand in for form
# `hybrid`: by trial, one run of that form takes as long as they take to get there.
FULL = 3e5
# Allowed error of the whole state over that of L and E. By trial the ratio is thousands, as the
# phases add up the errors of L: 100 is on the safe side.
_WHOLE = 100.0
# Times at which |L| is looked at, at least; an estimate.
PATH = 65
# The requested error over the tolerance of averaged equations: near L² = 2EI₂ they lose digits.
ERROR_OVER_TOLERANCE = 1e4

Array = np.ndarray


def least_momentum(scene: Scene, starts: Array, tolerance: float) -> float:
    """|L| over I_max down to which averaging to first order keeps an error of L and E over I_max; inf if nowhere.

    `starts` are states of the full equations, shape (n, d); the start of `scene` is not used.
    """
    unit = max(scene.ellipsoid.inertia)
    form = find_form(full_form(scene))
    if (
        tolerance * scene.stokes < _OPEN
        or not form.observe(scene, starts).angular_momentum.any(axis=1).all()
    ):
        return inf
    times = np.linspace(0.0, scene.time, PATH)
    path, _ = averaged(scene, starts, times, tolerance)
    least = least_between(scene, path).min(axis=0)
    count = len(starts)
    # Ranks, by the least |L|, of those that run both ways. By the cube they lie closest together
    # where |L| is small and averaging errs most.
    ranks = np.unique(np.ceil(count * np.linspace(0, 1, BOTH_WAYS + 1)[1:] ** 3).astype(int))
    # A path that averaging gave up has NaN, and counts as one of |L| = 0.
    chosen = np.argsort(np.nan_to_num(least))[ranks - 1]
    states, statuses = run_alone(scene, starts[chosen], times, tolerance / 10)
    finished = statuses == str(Status.REACHED_END)
    chosen = chosen[finished]
    # Share of all starts that each of them stands for: those between its rank and the one before.
    shares = (np.diff(ranks, prepend=0) / count)[finished]
    exact = form.observe(scene, states[:, finished].reshape(-1, states.shape[2])).slow.reshape(
        PATH, -1, 4
    )
    slow = (
        find_form(averaged_form(scene))
        .observe(scene, path[:, chosen].reshape(-1, 4))
        .slow.reshape(exact.shape)
    )
    missed = ~(np.abs(slow - exact).max(axis=(0, 2)) <= tolerance * unit)
    # `below` and `few` are places in `chosen`, ordered by |L|. Below the first, misses outnumber the
    # others by most. Above the second, no more than `_MISSED` of all particles miss, and one by chance:
    # the one of the largest share is left out.
    below = np.argmax(np.cumsum(np.append(0, np.where(missed, 1, -1))))
    above = np.append(shares * missed, 0)
    above[np.argmax(above)] = 0
    few = np.argmax(np.cumsum(above[::-1])[::-1] <= _MISSED)
    return float(np.append(least[chosen], inf)[max(below, few)])


def run_hybrid(
    scene: Scene,
    starts: Array,
    times: Array,
    tolerance: float,
    least: float,
    random: np.random.Generator,
) -> tuple[Array, Array]:
    """States of the full equations, shape (m, n, d), NaN from where one failed, and statuses.

    `times` must be evenly spaced from 0. `least_momentum` makes `least`. Phases are drawn from `random`.
    """
    if least == inf:
        return run_alone(scene, starts, times, tolerance)
    # Intervals of `grid`, on which |L| is looked at, in each interval of `times`: so many that
    # `grid` has `PATH` times or more.
    every = -(-(PATH - 1) // (len(times) - 1))
    grid = np.linspace(0.0, times[-1], every * (len(times) - 1) + 1)
    path, statuses = averaged(scene, starts, grid, tolerance)
    states = np.concatenate([starts[None], posed(scene, starts, path[every::every], random)])
    between = least_between(scene, path)
    failed = statuses != str(Status.REACHED_END)
    small = np.flatnonzero(failed | (between.min(axis=0) < least))
    # The place in `grid` from which |L| is large again: behind the last interval in which it is not.
    clear = len(between) - np.argmax((between[:, small] < _CLEAR * least)[::-1], axis=0)
    soon = ~failed[small] & (clear < len(between)) & (grid[clear] <= FULL)
    # Particles of the full equations in lanes, and those of form `hybrid`.
    lanes = small[soon]
    alone = small[~soon]
    if len(lanes):
        # All lanes change over to averaged equations together, when the last one may.
        then = clear[soon].max()
        begun, _ = run_full(scene, starts[lanes], grid[: then + 1], tolerance)
        ended, statuses[lanes] = averaged(scene, begun[-1], grid[then:] - grid[then], tolerance)
        states[:, lanes] = np.concatenate([begun, posed(scene, begun[-1], ended[1:], random)])[
            ::every
        ]
        # Those whose second, averaged part failed run anew.
        alone = np.append(alone, lanes[statuses[lanes] != str(Status.REACHED_END)])
    states[:, alone], statuses[alone] = run_alone(scene, starts[alone], times, tolerance)
    return states, statuses


def run_full(scene: Scene, starts: Array, times: Array, tolerance: float) -> tuple[Array, Array]:
    """States of the full equations, shape (m, n, d), and statuses, for an error of L and E of `tolerance`."""
    problem = find_form(full_form(scene)).problem(scene)
    whole = min(0.1, _WHOLE * tolerance)
    if not installed("llvmlite"):
        return run_batches(problem, starts, times, whole * TAYLOR)
    return run(problem, starts, times, whole, unplanned(problem, starts, times, whole))


def averaged(scene: Scene, starts: Array, times: Array, tolerance: float) -> tuple[Array, Array]:
    """States of the form averaged to first order, (m, n, 4), from full states, and statuses."""
    unit = max(scene.ellipsoid.inertia)
    # Any start does: `slow` replaces it.
    problem = find_form(averaged_form(scene)).problem(
        replace(scene, start=SlowStart((0.0, 0.0, unit), unit / 2))
    )
    if scene.ellipsoid.kind == "triaxial":
        slow = find_form(full_form(scene)).observe(scene, starts).slow / unit
    else:
        momentum = starts[:, :3]
        axis = starts[:, 3:]
        spin = np.sum(momentum * axis, axis=1) / Spheroid.of(scene.ellipsoid).inertia_ratio
        slow = np.column_stack([momentum, spin])
    return run_adaptive(problem, slow, times / scene.stokes, tolerance / ERROR_OVER_TOLERANCE)


def least_between(scene: Scene, path: Array) -> Array:
    """The least |L| over I_max between neighbouring times of averaged states, shape (m - 1, n).

    `path` has shape (m, n, 4). L is taken to move on a straight line from time to time.
    """
    body = scene.ellipsoid
    momentum = path[..., :3]
    # The path of a spheroid has L over its equatorial moment of inertia.
    unit = (
        1 if body.kind == "triaxial" else max(body.inertia) / Spheroid.of(body).equatorial_inertia
    )
    square, along = (
        np.einsum("mni,mni->mn", momentum[: len(later)], later)
        for later in (momentum, momentum[1:])
    )
    # On L₀ + s (L₁ - L₀), |L|² is |L₀|² - 2 s `back` + s² `way`, least at s = `share`. Dot products
    # alone are held, as differences of all vectors would take more memory.
    back = square[:-1] - along
    way = np.maximum(back + square[1:] - along, 1e-300)
    share = np.clip(back / way, 0, 1)
    return np.sqrt(np.maximum(square[:-1] - share * (2 * back - share * way), 0)) / unit


def posed(scene: Scene, starts: Array, slow: Array, random: np.random.Generator) -> Array:
    """States of the full equations, shape (m, n, d), on the tori of averaged states, shape (m, n, 4), drawn evenly."""
    # A body that stays on its side of L² = 2EI₂ keeps the sense in which its polhode circles the
    # axis: `starts` say it.
    if scene.ellipsoid.kind == "triaxial":
        return _posed(scene.ellipsoid, starts, slow * max(scene.ellipsoid.inertia), random)
    # A spheroid's axis p̂ lies on a cone about L, whose cosine is the part of L along p̂ over |L|. The
    # place on the cone is drawn.
    momentum = slow[..., :3]
    size = np.linalg.norm(momentum, axis=-1, keepdims=True)
    along = np.clip(Spheroid.of(scene.ellipsoid).inertia_ratio * slow[..., 3:] / size, -1, 1)
    across = np.cross(momentum, random.standard_normal(momentum.shape))
    across *= np.sqrt(1 - along**2) / np.linalg.norm(across, axis=-1, keepdims=True)
    return np.concatenate([momentum, along * momentum / size + across], axis=-1)


def _posed(ellipsoid: Ellipsoid, starts: Array, slow: Array, random: np.random.Generator) -> Array:
    """Quaternions and angular velocities on polhodes (`eq:omg1`–`eq:omg3`), as states, shape (m, n, 7).

    `slow` has L and E, shape (m, n, 4). z is the direction of L in body axes: |z| = 1 and Σ z_i²/I_i = h.
    """
    inertia = np.array(ellipsoid.inertia)
    first, middle, last = ellipsoid.order
    momentum = slow[..., :3]
    shape = slow.shape[:-1]
    square = np.sum(momentum**2, axis=-1)
    h = 2 * slow[..., 3] / square
    # Whether the polhode circles the longest axis, else the shortest one; that axis is the pole.
    longest = h > 1 / inertia[middle]
    # h of rotations about the pole, and about the axis that is neither the pole nor the middle one.
    near_limit = np.where(longest, 1 / inertia[first], 1 / inertia[last])
    far_limit = np.where(longest, 1 / inertia[last], 1 / inertia[first])
    rise = 1 / inertia[middle] - near_limit
    # Largest values of z_i² along the middle axis (`share`) and along the third one (`small`).
    share = np.clip((h - near_limit) / rise, 0, 1)
    small = rise / (far_limit - near_limit) * share
    # 1 - k² of the elliptic functions, above 0 so that K is finite.
    complement = np.clip((1 - share) / (1 - small), 1e-300, 1)
    # The fast phases: of the polhode in units of K, of the turn about L in units of π, and two signs.
    phase, turn, *signs = random.uniform(-1, 1, (4, *shape))
    with IMPORTS:
        from scipy.special import ellipj, ellipkm1

    sn, cn, dn, _ = ellipj(phase * ellipkm1(complement), 1 - complement)
    # Half of the polhode; the other half is its image.
    flip = np.sign(signs[0])
    # The sense is the sign of z along the pole. A particle keeps that of its start. On the other
    # side of L² = 2EI₂ it is drawn once for all times. `body` is L in body axes at the start, and
    # `began` is `longest` there.
    body = starts[:, 4:] * inertia
    began = np.sum(starts[:, 4:] * body, axis=1) * inertia[middle] > np.sum(body**2, axis=1)
    start_sense = np.sign(np.where(began, body[:, first], body[:, last]))
    sense = np.where(longest == began, start_sense, np.sign(signs[1][0]))
    z = np.empty((*shape, 3))
    along_pole = sense * np.sqrt(1 - small) * dn
    across_pole = flip * np.sqrt(small) * cn
    z[..., first] = np.where(longest, along_pole, across_pole)
    z[..., last] = np.where(longest, across_pole, along_pole)
    z[..., middle] = flip * np.sqrt(share) * sn
    # The rotations that carry z to n, the direction of L in space axes: the circle of unit
    # quaternions [cos(angle) (1 + z·n, z×n) + sin(angle) (0, z + n)] / √(2 (1 + z·n)).
    n = momentum / np.sqrt(square)[..., None]
    cosine = 1 + np.sum(z * n, axis=-1)
    angle = np.pi * turn
    size = np.sqrt(2 * cosine)
    real = np.cos(angle) * cosine
    imaginary = np.cos(angle)[..., None] * np.cross(z, n) + np.sin(angle)[..., None] * (z + n)
    q = np.concatenate([real[..., None], imaginary], axis=-1) / size[..., None]
    return np.concatenate([q, np.sqrt(square)[..., None] * z / inertia], axis=-1)


def run_alone(scene: Scene, starts: Array, times: Array, tolerance: float) -> tuple[Array, Array]:
    """States, NaN where one failed, and statuses of form `hybrid`, one particle after another."""
    problem = find_form("hybrid").problem(scene)
    states = np.full((len(times), *starts.shape), np.nan)
    statuses = np.empty(len(starts), dtype=object)
    for i, start in enumerate(starts.tolist()):
        solution = solve(
            replace(problem, start=tuple(start)),
            available_like(SOLVER),
            tolerance / ERROR_PER_TOLERANCE,
            times,
        )
        statuses[i] = str(solution.status)
        if solution.success:
            states[:, i] = solution.states
    return states, statuses

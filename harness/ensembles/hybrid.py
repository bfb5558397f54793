"""Hybrid equations of many particles: averaged to first order where that is good enough, form `hybrid` elsewhere.

An error of L and E far above 1/St leaves the fast phases open: their error, an angle, is St times as
large. So a method that keeps no more than that error may draw the phases evenly, as averaging says they
are. The error of averaging is largest where |L| is least. A sample that runs both ways shows how small
|L| may become. A particle of smaller |L| follows the full equations until |L| has grown again, or form
`hybrid` where that would take longer.

`docs/scaling.md`, under Hybrid, says what users see of it. Words used here: L is the angular
momentum and I_max the largest moment of inertia. "Both ways" is averaged and by form `hybrid`.
"In lanes" is many particles side by side in SIMD registers, "alone" is one after another. The
"torus" of an L and E holds all orientations and angular velocities that have them. In shapes, m
counts times, n particles, and d components of a full state: (q, ω) of a triaxial body, (L, p̂) of
a spheroid. An averaged state has four: L and E over I_max of a triaxial body, L over the equatorial
moment of inertia and the spin about p̂ of a spheroid.
"""

from dataclasses import replace
from math import ceil, inf

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
# Requested error times St from which on phases are drawn. An estimate near the error of averaging, which is
# 15/St in the median of triaxial bodies on one side of L² = 2EI₂ (reports/accuracy, "stays").
_MIN_ERROR_TIMES_STOKES = 10.0
# Particles that run both ways, some seconds of work. An estimate: the limit of |L| is known the better, the
# more run.
BOTH_WAYS = 64
# Particles that they are chosen from, averaged in lanes at little cost. An estimate: 64 for each that runs
# both ways, so that the smallest |L| of an ensemble are among them.
POOL = 4096
# Requested error over the one requested of the runs of form `hybrid` that judge averaging. An estimate: errors of
# these runs shift the judgement by a tenth of the requested error at most.
_JUDGED_OVER_JUDGE = 10
# Those of the pool run both ways whose ranks by |L|, over its size, are s³ for equispaced s. An estimate: a
# larger power chooses more particles of small |L|.
_RANK_POWER = 3
# Largest requested error of the whole state, over its size: beyond it steps lose all digits. An estimate.
_MAX_WHOLE = 0.1
# Share of all particles that may miss the error: form `hybrid` is meant to keep it in 97.5 %.
_MAX_MISSED_SHARE = 0.025
# Full equations last until |L| is this multiple of the least one that may be averaged. An estimate: without
# it a particle near the limit would go to and fro.
_CLEAR_FACTOR = 1.25
# Longest time, in inverse shear rates, for which full equations in lanes stand in for form `hybrid`. By
# trial, full equations take as long to get there as one run of that form.
MAX_FULL_TIME = 3e5
# The allowed error of the whole state over the allowed error of L and E. By trial errors have a ratio of
# thousands, as the phases add up the errors of L: 100 is on the safe side.
_WHOLE_OVER_SLOW = 100.0
# Least number of times at which |L| is looked at, 64 intervals. An estimate: between them L is taken to move
# on a straight line, and a smaller |L| on a bend goes unseen.
MIN_PATH_TIMES = 65
# The requested error over the tolerance of averaged equations: near L² = 2EI₂ they lose digits. An estimate:
# their cost grows slowly with it.
ERROR_OVER_TOLERANCE = 1e4
# Keeps quotients and elliptic integrals finite where a difference is 0.
_TINY = 1e-300

Array = np.ndarray


def least_momentum(scene: Scene, starts: Array, tolerance: float) -> float:
    """|L| over I_max down to which averaging to first order keeps an error of L and E over I_max; inf if nowhere.

    `starts` are states of the full equations, shape (n, d); the start of `scene` is not used.
    """
    if tolerance * scene.stokes < _MIN_ERROR_TIMES_STOKES:
        return inf
    # Averaged equations have no start at L = 0.
    momenta = find_form(full_form(scene)).observe(scene, starts).angular_momentum
    if not momenta.any(axis=1).all():
        return inf
    times = np.linspace(0.0, scene.time, MIN_PATH_TIMES)
    path, _ = averaged(scene, starts, times, tolerance)
    least = least_between(scene, path).min(axis=0)
    count = len(starts)
    # Ranks, by the least |L|, of the starts that run both ways. By the power they lie closest together
    # where |L| is small and averaging errs most.
    portions = np.linspace(0, 1, BOTH_WAYS + 1)[1:] ** _RANK_POWER
    ranks = np.unique(np.ceil(count * portions).astype(int))
    # A path that averaging gave up has NaN, and counts as one of |L| = 0.
    chosen = np.argsort(np.nan_to_num(least))[ranks - 1]
    states, statuses = run_alone(scene, starts[chosen], times, tolerance / _JUDGED_OVER_JUDGE)
    finished = statuses == str(Status.REACHED_END)
    chosen = chosen[finished]
    # Share of all starts that each chosen one stands for: those between its rank and the one before.
    shares = (np.diff(ranks, prepend=0) / count)[finished]
    missed = _missed(scene, states[:, finished], path[:, chosen], tolerance)
    return _border(least[chosen], missed, shares)


def _missed(scene: Scene, full: Array, averaged_path: Array, tolerance: float) -> Array:
    """Whether averaging misses an error of L and E over I_max, for each particle, shape (n,).

    `full` are states of the full equations, shape (m, n, d), `averaged_path` averaged ones, (m, n, 4).
    """
    times, particles, dimension = full.shape
    exact = find_form(full_form(scene)).observe(scene, full.reshape(-1, dimension)).slow
    slow = find_form(averaged_form(scene)).observe(scene, averaged_path.reshape(-1, 4)).slow
    differences = np.abs(slow - exact).reshape(times, particles, 4).max(axis=(0, 2))
    # A path that has NaN misses too.
    return ~(differences <= tolerance * max(scene.ellipsoid.inertia))


def _border(least: Array, missed: Array, shares: Array) -> float:
    """The |L| from which on particles may be averaged, inf if from none, of n particles that ran both ways.

    `least` is their least |L|, ascending, `missed` whether averaging missed the error, `shares` the shares
    of all particles that they stand for. A border at place i, 0 to n, averages the particles from i on.
    """
    # Before this border, misses outnumber the other particles by most.
    misses_over_others = np.cumsum(np.append(0, np.where(missed, 1, -1)))
    majority = np.argmax(misses_over_others)
    # From this border on, the particles that miss stand for no more than `_MAX_MISSED_SHARE` of all. One
    # may miss by chance: the one of the largest share is left out.
    missed_shares = np.append(shares * missed, 0)
    missed_shares[np.argmax(missed_shares)] = 0
    missed_from = np.cumsum(missed_shares[::-1])[::-1]
    few = np.argmax(missed_from <= _MAX_MISSED_SHARE)
    return float(np.append(least, inf)[max(majority, few)])


def run_hybrid(
    scene: Scene,
    starts: Array,
    times: Array,
    tolerance: float,
    least: float,
    random: np.random.Generator,
) -> tuple[Array, Array]:
    """States of the full equations, shape (m, n, d), NaN where a particle failed, and statuses, shape (n,).

    `times`, shape (m,), must be evenly spaced from 0. `least_momentum` makes `least`. Phases are drawn from
    `random`. All particles are averaged first; particles of small |L|, and failed ones, run anew.
    """
    if least == inf:
        return run_alone(scene, starts, times, tolerance)
    # |L| is looked at on `grid`: each interval of `times` has `every` of its intervals, the fewest that
    # give it `MIN_PATH_TIMES` times.
    every = ceil((MIN_PATH_TIMES - 1) / (len(times) - 1))
    grid = np.linspace(0.0, times[-1], every * (len(times) - 1) + 1)
    path, statuses = averaged(scene, starts, grid, tolerance)
    states = np.concatenate([starts[None], posed(scene, starts, path[every::every], random)])
    between = least_between(scene, path)
    failed = statuses != str(Status.REACHED_END)
    small = np.flatnonzero(failed | (between.min(axis=0) < least))
    # The place in `grid` from which |L| is large again: behind the last interval in which it is not.
    clear = len(between) - np.argmax((between[:, small] < _CLEAR_FACTOR * least)[::-1], axis=0)
    soon = ~failed[small] & (clear < len(between)) & (grid[clear] <= MAX_FULL_TIME)
    # Particles that follow the full equations in lanes, and particles that form `hybrid` follows alone.
    lanes = small[soon]
    alone = small[~soon]
    if len(lanes):
        # All lanes change over to averaged equations together, when the last one may.
        change = clear[soon].max()
        full, _ = run_full(scene, starts[lanes], grid[: change + 1], tolerance)
        slow, statuses[lanes] = averaged(scene, full[-1], grid[change:] - grid[change], tolerance)
        on_grid = np.concatenate([full, posed(scene, full[-1], slow[1:], random)])
        states[:, lanes] = on_grid[::every]
        # A particle whose second, averaged part failed runs anew.
        alone = np.append(alone, lanes[statuses[lanes] != str(Status.REACHED_END)])
    states[:, alone], statuses[alone] = run_alone(scene, starts[alone], times, tolerance)
    return states, statuses


def run_full(scene: Scene, starts: Array, times: Array, tolerance: float) -> tuple[Array, Array]:
    """States of the full equations, shape (m, n, d), and statuses, shape (n,).

    `tolerance` is the error of L and E over I_max that they are meant to keep.
    """
    problem = find_form(full_form(scene)).problem(scene)
    whole = min(_MAX_WHOLE, _WHOLE_OVER_SLOW * tolerance)
    # Without llvmlite no equal steps are compiled. `TAYLOR` makes the error of a whole run a tolerance of a step.
    if not installed("llvmlite"):
        return run_batches(problem, starts, times, whole * TAYLOR)
    return run(problem, starts, times, whole, unplanned(problem, starts, times, whole))


def averaged(scene: Scene, starts: Array, times: Array, tolerance: float) -> tuple[Array, Array]:
    """States of the form averaged to first order, shape (m, n, 4), from full starts, shape (n, d), and statuses.

    `times`, shape (m,), are in inverse shear rates, and `tolerance` is the error of L and E over I_max.
    """
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
    # Averaged equations run in slow time, t/St.
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
    # `square` is |L|² at each time, `along` L₀·L₁ of neighbouring times. On L₀ + s (L₁ - L₀), |L|² is
    # |L₀|² - 2 s `back` + s² `way`, least at s = `share`; `_TINY` keeps the quotient finite where L does
    # not change. Dot products alone are held, as differences of all vectors would take more memory.
    back = square[:-1] - along
    way = np.maximum(back + square[1:] - along, _TINY)
    share = np.clip(back / way, 0, 1)
    return np.sqrt(np.maximum(square[:-1] - share * (2 * back - share * way), 0)) / unit


def posed(scene: Scene, starts: Array, slow: Array, random: np.random.Generator) -> Array:
    """States of the full equations, shape (m, n, d), on the tori of averaged states, shape (m, n, 4), drawn evenly.

    `starts` are full states at the start, shape (n, d).
    """
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
    """Quaternions and angular velocities on polhodes (the paper's `eq:omg1`–`eq:omg3`), as states, shape (m, n, 7).

    `slow` has L and E, shape (m, n, 4). `starts` are full states at the start, shape (n, 7).
    """
    inertia = np.array(ellipsoid.inertia)
    momentum = slow[..., :3]
    square = np.sum(momentum**2, axis=-1)
    # The fast phases: of the polhode in units of K, of the turn about L in units of π, and two signs.
    phase, turn, half, other_sense = random.uniform(-1, 1, (4, *square.shape))
    h = 2 * slow[..., 3] / square
    # The sense that a particle has on the other side of L² = 2EI₂ is drawn once for all times.
    senses = _senses(ellipsoid, starts, h, np.sign(other_sense[0]))
    z = _on_polhode(ellipsoid, h, phase, np.sign(half), senses)
    n = momentum / np.sqrt(square)[..., None]
    q = _carrying(z, n, np.pi * turn)
    return np.concatenate([q, np.sqrt(square)[..., None] * z / inertia], axis=-1)


def _circles_longest(ellipsoid: Ellipsoid, h: Array) -> Array:
    """Whether a polhode with h = 2E/L² circles the longest axis; else it circles the shortest one."""
    _, middle, _ = ellipsoid.order
    return h > 1 / ellipsoid.inertia[middle]


def _senses(ellipsoid: Ellipsoid, starts: Array, h: Array, other_sense: Array) -> Array:
    """Sign of the component of L along the axis that the polhode circles, shape (m, n).

    A particle keeps the sense of its start on the start's side of L² = 2EI₂, and has `other_sense`, shape
    (n,), on the other side.
    """
    longest_axis, middle, shortest_axis = ellipsoid.order
    inertia = np.array(ellipsoid.inertia)
    omega = starts[:, 4:]
    body_momentum = omega * inertia
    energy2 = np.sum(omega * body_momentum, axis=1)
    began_longest = energy2 * inertia[middle] > np.sum(body_momentum**2, axis=1)
    along_pole = np.where(
        began_longest, body_momentum[:, longest_axis], body_momentum[:, shortest_axis]
    )
    return np.where(
        _circles_longest(ellipsoid, h) == began_longest, np.sign(along_pole), other_sense
    )


def _on_polhode(ellipsoid: Ellipsoid, h: Array, phase: Array, half: Array, senses: Array) -> Array:
    """Direction z of L in body axes, shape (m, n, 3), with |z| = 1 and Σ z_i²/I_i = h = 2E/L².

    `phase`, -1 to 1, is the place on half of a polhode, in units of K, the complete elliptic integral. The
    sign `half` chooses one of its halves, which are images of each other. `senses` are signs of z along the
    axis that it circles.
    """
    with IMPORTS:
        from scipy.special import ellipj, ellipkm1

    inertia = np.array(ellipsoid.inertia)
    longest_axis, middle, shortest_axis = ellipsoid.order
    longest = _circles_longest(ellipsoid, h)
    # The axis that the polhode circles is the pole, and the far axis is neither that nor the middle one. These
    # are h of rotations about the pole and about the far axis.
    near_limit = np.where(longest, 1 / inertia[longest_axis], 1 / inertia[shortest_axis])
    far_limit = np.where(longest, 1 / inertia[shortest_axis], 1 / inertia[longest_axis])
    rise = 1 / inertia[middle] - near_limit
    # Largest values of z_i² along the middle axis, and along the far one.
    middle_square = np.clip((h - near_limit) / rise, 0, 1)
    far_square = rise / (far_limit - near_limit) * middle_square
    # 1 - k² of the elliptic functions, above 0 so that K is finite.
    complement = np.clip((1 - middle_square) / (1 - far_square), _TINY, 1)
    sn, cn, dn, _ = ellipj(phase * ellipkm1(complement), 1 - complement)
    along_pole = senses * np.sqrt(1 - far_square) * dn
    along_far = half * np.sqrt(far_square) * cn
    z = np.empty((*h.shape, 3))
    z[..., longest_axis] = np.where(longest, along_pole, along_far)
    z[..., shortest_axis] = np.where(longest, along_far, along_pole)
    z[..., middle] = half * np.sqrt(middle_square) * sn
    return z


def _carrying(z: Array, n: Array, angle: Array) -> Array:
    """Unit quaternions of rotations that carry z to n, unit vectors of shape (m, n, 3).

    They form a circle, on which `angle`, in rad and of shape (m, n), is the place. The quaternion is
    [cos(angle) (1 + z·n, z×n) + sin(angle) (0, z + n)] / √(2 (1 + z·n)).
    """
    one_plus_cosine = 1 + np.sum(z * n, axis=-1)
    size = np.sqrt(2 * one_plus_cosine)
    real = np.cos(angle) * one_plus_cosine
    imaginary = np.cos(angle)[..., None] * np.cross(z, n) + np.sin(angle)[..., None] * (z + n)
    return np.concatenate([real[..., None], imaginary], axis=-1) / size[..., None]


def run_alone(scene: Scene, starts: Array, times: Array, tolerance: float) -> tuple[Array, Array]:
    """States of form `hybrid`, shape (m, n, d), NaN where one failed, and statuses, one particle after another.

    `tolerance` is the error of L and E over I_max.
    """
    problem = find_form("hybrid").problem(scene)
    states = np.full((len(times), *starts.shape), np.nan)
    statuses = np.empty(len(starts), dtype=object)
    for i, start in enumerate(starts.tolist()):
        solution = solve(
            replace(problem, start=tuple(start)),
            available_like(SOLVER),
            # The solver's tolerance at which form `hybrid` is meant to keep that error.
            tolerance / ERROR_PER_TOLERANCE,
            times,
        )
        statuses[i] = str(solution.status)
        if solution.success:
            states[:, i] = solution.states
    return states, statuses

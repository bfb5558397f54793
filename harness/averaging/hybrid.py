"""Errors and cost of `hybrid` on random starts, against the full equations.

`polhode accuracy --order hybrid` runs it, `reports/hybrid` shows it; `docs/second-order.md`, section 10,
says how the form chooses which segments of a run the full equations follow. A "full" run is one of the
full equations alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from time import perf_counter

import numpy as np

from polhode.harness.api import plan
from polhode.harness.averaging.second_order import (
    FULL_TOLERANCES,
    REFERENCE_TOLERANCES,
    reference_observables,
)
from polhode.harness.common import cache
from polhode.harness.common.files import digest
from polhode.harness.common.machine import here
from polhode.harness.common.progress import in_steps
from polhode.harness.common.store import Record
from polhode.harness.references.errors import errors
from polhode.harness.references.extended import unlike_runs
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.hybrid.form import Hybrid
from polhode.models.hybrid.plan import ERROR_PER_TOLERANCE
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import BodyStart, Scene
from polhode.models.second_order import swing, tables
from polhode.models.second_order.extent import squares_for, squares_of
from polhode.models.second_order.outline import outline
from polhode.models.second_order.path import path_of
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import available_like, solver as find_solver
from polhode.solvers.segments import SolvedSegment
from polhode.solvers.solve import solve
from polhode.solvers.taylor import extends_precision

# The constants of `hybrid` were chosen on starts of SEED; errors are measured on starts of _HELD_OUT.
SEED = 15
_HELD_OUT = (20261122, 7771)
_RANDOM = 120  # Starts of each held-out seed.
HYBRID_SAMPLES = 201  # Output times of a run.
SEGMENT_SOLVER = "cyrk-vern8"  # Of every segment of a hybrid run.
_LEAST_AXIS = 0.15  # Random semi-axes lie between this and 1.
# Random starts go through all pairs of St and slow time in turns.
STOKES = (1e4, 1e5, 1e6, 1e7)
SLOW_TIMES = (0.05, 0.2, 0.5, 1.0, 2.0)
REQUESTED_ERRORS = (1e-4, 1e-6, 1e-8)
# The reference of a run up to this duration, in inverse shear rates, is a run in long double; a
# looser run shows its error.
_LONG_DOUBLE_UP_TO = 1.2e5
# Longer runs are solved by two unrelated methods in double. Their difference is the reference's
# uncertainty. Pairs of solver and tolerance.
_DOUBLE = (("taylor", 1e-16), ("cyrk-vern8", 1e-14))
# Runs above this duration, in inverse shear rates, have no reference: it would take minutes.
_LONGEST = 5.1e6
# The speed of random starts is measured at one slow time and error, against FULL_SOLVERS at the
# loosest tolerance that meets the error.
_FAST_SEED = 16
FAST = {1e6: 40, 1e7: 12, 1e8: 12}  # Number of starts by St.
FAST_SLOW_TIME = 0.5
FAST_ERROR = 1e-6  # Of L and E, over I_max.
FEW_SAMPLES = 11  # Output times of a run that shows few.
SPEED_REPEATS = 3  # Turns, and runs of each turn, of which the fastest counts.
FULL_SOLVERS = ("cyrk-vern8", "taylor")
# And against a full solver of spheroids that knows St; its tolerance is meant for the whole run.
KNOWING = "splitting"
KNOWING_TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9)
# Least |cos| of the angle between the vorticity and the shortest axis (the symmetry axis of a
# spheroid) of a body that has settled: one side up or the other. An estimate.
_SETTLED = 0.9
HYBRID_PARTS = ("errors", "speed")


@dataclass(frozen=True)
class HybridError:
    """One run of a random start: errors of L and E over I_max, of the orientation in rad; NaN without a reference."""

    start: int
    kind: str
    axes: str
    stokes: float
    slow_time: float
    error: float  # requested
    status: str
    slow: float  # measured error of L and E
    orientation: float  # measured error of the orientation
    estimated: float  # stated upper end of the error of L and E
    uncertainty: float  # of the reference's L and E
    full_share: float  # share of the time that the full equations follow
    segments: int = field(metadata={"former": "pieces"})
    # 1 if the body ends the same side up as in the reference, 0 if not, NaN if that is uncertain.
    mirror: float


@dataclass(frozen=True)
class Speed:
    """Wall times of a run in s, and of the best full solution that meets the error."""

    start: int
    kind: str
    stokes: float
    slow: float
    full_share: float
    seconds: float  # with HYBRID_SAMPLES output times
    few_seconds: float  # with FEW_SAMPLES output times
    solver: str
    tolerance: float
    full_seconds: float
    new_shape: float = 0.0  # seconds that the tables of a triaxial shape take, not seen before,
    known_shape: float = 0.0  # and read from disk
    knowing_seconds: float = nan  # of the full solver that knows St
    # Steps of the segments that the full equations follow, and of the best full solution; NaN
    # unless the same solver took both.
    segment_steps: float = field(default=nan, metadata={"former": "window_steps"})
    full_steps: float = nan


def random_scenes(count: int = _RANDOM, seed: int = SEED) -> Iterator[Scene]:
    """Random starts, every other one triaxial, over all St and slow times."""
    # Axes are log-uniform, orientations isotropic, angular velocities of three standard normals.
    draw = np.random.default_rng(seed)
    for i in range(count):
        axes = np.exp(draw.uniform(np.log(_LEAST_AXIS), 0.0, 3))
        quaternion = draw.normal(size=4)
        spin = draw.normal(size=3)
        # A spheroid: two axes are alike, and the third is the first, second or last one in turns.
        if i % 2:
            axes[(i // 2 % 3 + 1) % 3] = axes[(i // 2 % 3 + 2) % 3]
        stokes = STOKES[i // 2 % len(STOKES)]
        time = SLOW_TIMES[i // (2 * len(STOKES)) % len(SLOW_TIMES)] * stokes
        start = BodyStart(tuple(quaternion.tolist()), tuple(spin.tolist()))
        yield Scene(Ellipsoid(tuple(axes.tolist())), stokes, start, time)


def reference_of(scene: Scene, samples: int = HYBRID_SAMPLES) -> tuple[Observables, float, float]:
    """The full equations' solution at equispaced times, from the cache or computed, and how far it may be off."""
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    values = (*problem.start, *(problem.parameters or ()), problem.end)
    key = digest(
        [
            "hybrid",
            problem.name,
            [value.hex() for value in values],
            samples,
            REFERENCE_TOLERANCES,
            _DOUBLE,
            *([] if extends_precision() else ["without heyoka"]),
        ]
    )
    cached = cache.load(key)
    if cached is None:
        if problem.end <= _LONG_DOUBLE_UP_TO:
            tight, apart = reference_observables(scene, samples)
        else:
            times = np.linspace(0.0, problem.end, samples)
            runs = (
                (solve(problem, *how, times).states for how in _DOUBLE)
                if all(find_solver(name).available for name, _ in _DOUBLE)
                else unlike_runs(problem, times).values()
            )
            tight, double = (form.observe(scene, states) for states in runs)
            apart = errors(scene.ellipsoid, double, tight)
        cached = {name: values.astype(float) for name, values in vars(tight).items()}
        cached = cache.save(
            key, cached | {"uncertainty": np.array([apart.slow, apart.orientation])}
        )
    slow, orientation = cached.pop("uncertainty").tolist()
    return Observables(**cached), slow, orientation


def measure_errors(scenes: Sequence[Scene], quiet: bool = False) -> list[HybridError]:
    """Runs of the scenes at every error; scenes whose reference takes minutes are left out."""
    rows = []
    for i, scene in enumerate(in_steps(scenes, "errors", "scenes", quiet)):
        if scene.time <= _LONGEST:
            reference = reference_of(scene)
            rows += [_measured(i, scene, error, reference) for error in REQUESTED_ERRORS]
    return rows


def _measured(
    start: int, scene: Scene, error: float, reference_and_doubt: tuple[Observables, float, float]
) -> HybridError:
    """The row of a start for a requested error, `reference_and_doubt` being what `reference_of` gives."""
    reference, slow_off, orientation_off = reference_and_doubt
    run = plan(
        scene,
        Hybrid.name,
        available_like(SEGMENT_SOLVER),
        error / ERROR_PER_TOLERANCE,
        error,
        "slow",
        HYBRID_SAMPLES,
    ).run()
    slow = orientation = mirror = nan
    if run.success:
        measured = errors(scene.ellipsoid, run.observables, reference)
        slow = measured.slow
        orientation = measured.orientation or nan
        # The body axis that shows which side is up, and its z at the end of the reference.
        axis = scene.ellipsoid.symmetry_axis
        axis = scene.ellipsoid.order[2] if axis is None else axis
        up = float(reference.rotation[-1, axis, 2])
        if abs(up) > _SETTLED and orientation_off < 1 - _SETTLED:
            mirror = float(up * run.rotation[-1, axis, 2] > 0)
    axes = ":".join(f"{axis:.3g}" for axis in scene.ellipsoid.semi_axes)
    return HybridError(
        *(start, scene.ellipsoid.kind, axes, scene.stokes, scene.slow_time, error, str(run.status)),
        *(slow, orientation, run.error.slow.high if run.error.slow else nan, slow_off),
        *(_share(run.segments, scene.slow_time), len(run.segments), mirror),
    )


def measure_speed(quiet: bool = False) -> list[Speed]:
    """Times of random starts at each St."""
    scenes = []
    for stokes, count in FAST.items():
        for i, scene in enumerate(random_scenes(count, _FAST_SEED)):
            scenes.append((i, replace(scene, stokes=stokes, time=FAST_SLOW_TIME * stokes)))
    return [_timed(i, scene) for i, scene in in_steps(scenes, "speed", "runs", quiet)]


def _timed(start: int, scene: Scene) -> Speed:
    """The row of a start at `FAST_ERROR`; `at` is the tolerance of a full run."""
    form = Hybrid()
    times = np.linspace(0.0, scene.time, HYBRID_SAMPLES)
    problem = form.problem(scene)
    tolerance = FAST_ERROR / ERROR_PER_TOLERANCE
    segment_solver = available_like(SEGMENT_SOLVER)

    def seconds(times: np.ndarray) -> float:
        """Wall time of a run that looks ahead anew, as a first one must."""
        for cached in (outline, path_of):
            cached.cache_clear()
        began = perf_counter()
        solve(problem, segment_solver, tolerance, times)
        return perf_counter() - began

    run = solve(problem, segment_solver, tolerance, times)
    slow = nan
    # Steps of full runs by solver and tolerance, as `_full` gives them.
    full = dict[tuple[str, float], float]()
    exact = find_form(full_form(scene)).problem(scene)
    if scene.time <= _LONGEST:
        reference, *_ = reference_of(scene)
        slow = (
            errors(scene.ellipsoid, form.observe(scene, run.states), reference).slow
            if run.success
            else nan
        )
        full = _full(scene, exact, times, reference)
    # In turns, so that a slow moment of the machine hits them alike; each warm, whatever the one
    # before left in caches.
    timed_runs: list[Callable[[], float]] = [
        lambda: seconds(times),
        # Every 20th of the 201 times: FEW_SAMPLES of them.
        lambda: seconds(times[:: HYBRID_SAMPLES // (FEW_SAMPLES - 1)]),
    ]
    timed_runs += [
        lambda solver=solver, at=at: solve(exact, solver, at, times).seconds for solver, at in full
    ]
    turns = [[*map(_fastest, timed_runs)] for _ in range(SPEED_REPEATS)]
    taken, few, *full_seconds = np.min(turns, axis=0).tolist()
    seconds_of = dict(zip(full, full_seconds, strict=True))
    # The solver that knows St has a column of its own, and is not among the others.
    knowing = min((seconds_of.pop(pair) for pair in full if pair[0] == KNOWING), default=nan)
    (solver, at), best = min(
        seconds_of.items(), key=lambda entry: entry[1], default=(("", nan), nan)
    )
    costs = slow, _share(run.segments, scene.time), taken, few, solver, at, best
    steps = (
        sum(stage.steps or 0 for stage in run.segments if not stage.averaged),
        full.get((segment_solver, at), nan),
    )
    steps = steps if solver == segment_solver else (nan, nan)
    return Speed(
        start,
        scene.ellipsoid.kind,
        scene.stokes,
        *costs,
        *_prepared(scene.ellipsoid),
        knowing,
        *steps,
    )


def _prepared(ellipsoid: Ellipsoid) -> tuple[float, float]:
    """Seconds that the tables of a triaxial shape take, made anew and read from disk; 0 for other shapes.

    There are tables for each side of L² = 2EI₂: for polhodes about the longest and the shortest axis.
    """
    if ellipsoid.kind != "triaxial":
        return 0.0, 0.0

    def read() -> float:
        """Seconds that the tables take from disk, with nothing of them in memory."""
        for cached in (tables.table, swing.series_for, squares_for):
            cached.cache_clear()
        began = perf_counter()
        for longest in (False, True):
            tables.table(ellipsoid, longest)
            squares_for(ellipsoid, longest)
            swing.series_for(ellipsoid, longest)
        return perf_counter() - began

    read()
    began = perf_counter()
    for side in (tables.side_of(ellipsoid, longest) for longest in (False, True)):
        tables.made(side)
        squares_of(swing.series_of(side))
    return perf_counter() - began, read()


def _fastest(run: Callable[[], float]) -> float:
    """Shortest wall time, in seconds, of several runs one after the other."""
    return min(run() for _ in range(SPEED_REPEATS))


def _full(
    scene: Scene, problem: Problem, times: np.ndarray, reference: Observables
) -> dict[tuple[str, float], float]:
    """Steps of runs in full, by each solver at the loosest tolerance that meets the error."""
    form = find_form(full_form(scene))
    steps = dict[tuple[str, float], float]()
    tried: list[tuple[str, Sequence[float]]] = [(name, FULL_TOLERANCES) for name in FULL_SOLVERS]
    if find_solver(KNOWING).takes(problem):
        tried.append((KNOWING, KNOWING_TOLERANCES))
    for solver, tolerances in tried:
        if not find_solver(solver).available:
            continue
        for tolerance in tolerances:
            run = solve(problem, solver, tolerance, times)
            if (
                run.success
                and errors(scene.ellipsoid, form.observe(scene, run.states), reference).slow
                <= FAST_ERROR
            ):
                steps[solver, tolerance] = run.work.steps or nan
                break
    return steps


def _share(segments: Sequence[SolvedSegment], whole: float) -> float:
    """Share of a run's time that the full equations follow."""
    full = sum(segment.end - segment.begin for segment in segments if not segment.averaged)
    return full / whole


def measure(old: "Study | None", part: str, *, quick: bool, quiet: bool) -> "Study":
    """Both parts, or one of them anew; quick: a few starts, and no times."""
    study = old or Study([], [])
    if part in ("", "errors"):
        scenes = []
        for seed in _HELD_OUT:
            scenes += random_scenes(4 if quick else _RANDOM, seed)
        rows = measure_errors(scenes, quiet)
        study = replace(study, errors=rows, timed={**study.timed, "errors": here()})
    if part in ("", "speed") and not quick:
        study = replace(study, speed=measure_speed(quiet), timed={**study.timed, "speed": here()})
    return study


@dataclass(frozen=True)
class Study:
    """All that is measured of the form."""

    errors: Sequence[HybridError]
    speed: Sequence[Speed]
    timed: Mapping[str, Record] = field(default_factory=dict)

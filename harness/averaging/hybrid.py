"""Errors and cost of `hybrid` on random starts, against the full equations.

`polhode accuracy --order hybrid` runs it, `reports/hybrid` shows it; `docs/second-order.md`, section 10,
says how the form chooses which segments of a run the full equations follow. A "full" run is one of the
full equations alone. Form `hybrid` at a tolerance requests an error of L and E, over I_max, that is
`ERROR_PER_TOLERANCE` times as large.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import nan
from time import perf_counter
from typing import NamedTuple

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
from polhode.harness.common.timing import Timing
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

# The constants of `hybrid` were chosen on starts of SEED; errors are measured on starts of _HELD_OUT. The
# seeds themselves are any numbers.
SEED = 15
_HELD_OUT = (20261122, 7771)
# Starts of each held-out seed. An estimate: twice as many would narrow the intervals of shares by √2.
_RANDOM = 120
_QUICK_RANDOM = 4  # Starts of each held-out seed with `quick`.
HYBRID_SAMPLES = 201  # Output times of a run, as of `polhode.solve`.
# Solver of every segment of a hybrid run, or one like it where its library is missing: the first of the explicit
# ones that `polhode.solve` takes.
SEGMENT_SOLVER = "cyrk-vern8"
# Random semi-axes lie between this and 1. An estimate: the study says nothing of more slender or flatter bodies.
_LEAST_AXIS = 0.15
# Random starts go through all pairs of St and slow time t₂ = t/St in turns. These values, and the errors of L
# and E over I_max that are requested, are an estimate of what users ask.
STOKES = (1e4, 1e5, 1e6, 1e7)
SLOW_TIMES = (0.05, 0.2, 0.5, 1.0, 2.0)
REQUESTED_ERRORS = (1e-4, 1e-6, 1e-8)
# The reference of a run up to this duration, in inverse shear rates, is a run in long double; a
# looser run shows its error. An estimate that bounds the cost: twice as long a run takes twice the time.
_LONG_DOUBLE_UP_TO = 1.2e5
# Longer runs are solved by two unrelated methods in double, here with their tolerances. The difference of
# the two is the reference's uncertainty. The tolerances are near rounding, so that it is small.
_DOUBLE = (("taylor", 1e-16), ("cyrk-vern8", 1e-14))
# Runs above this duration, in inverse shear rates, have no reference: it would take minutes. The largest
# duration below is 0.5 of slow time at St = 1e7.
_LONGEST = 5.1e6
# The speed of random starts is measured at one slow time and error, against FULL_SOLVERS at the
# loosest tolerance that meets the error.
_FAST_SEED = 16  # Any number but SEED, on whose starts constants were chosen.
# Number of starts by St: an estimate, fewer where a run takes longer.
FAST = {1e6: 40, 1e7: 12, 1e8: 12}
FAST_SLOW_TIME = 0.5  # In the middle of SLOW_TIMES.
FAST_ERROR = 1e-6  # Of L and E, over I_max: in the middle of REQUESTED_ERRORS.
# Output times of a run that shows few: nearly all of its time is then the integration's.
FEW_SAMPLES = 11
# Turns in which runs are timed, and runs in each turn: the fastest of all counts. An estimate: more take longer
# and are disturbed less.
SPEED_REPEATS = 3
# Solvers of the full runs. A choice: the solver of the segments, and Taylor's method, whose order is higher.
FULL_SOLVERS = ("cyrk-vern8", "taylor")
# The speed is measured against this full solver of spheroids too, which knows that the torque is small. Its
# tolerance is meant for the whole run, so that looser ones than FULL_TOLERANCES suffice: from FAST_ERROR on.
KNOWING = "splitting"
KNOWING_TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9)
# Least |cos| of the angle between the vorticity and the shortest axis (the symmetry axis of a
# spheroid) of a body that has settled: one side up or the other. An estimate: bodies that are still tilted
# more than 26 degrees at the end are not counted.
_SETTLED = 0.9
# Largest uncertainty of the reference's orientation, in rad, by which its side is sure: the cosine changes by
# less than the angle, and stays at 0.8 or more.
_SURE_ORIENTATION = 1 - _SETTLED
HYBRID_PARTS = ("errors", "speed")
_NOT_TIMED = Timing((nan,))  # Where there is no run.


class HybridReference(NamedTuple):
    """The full equations' solution at equispaced times, and how far it may be off."""

    observables: Observables
    slow: float  # of L and E, over I_max
    orientation: float  # in rad


class FullMethod(NamedTuple):
    """Solver and tolerance of a full run; no solver where there is no run."""

    solver: str = ""
    tolerance: float = nan


@dataclass(frozen=True)
class HybridError:
    """One run of a random start: errors of L and E over I_max, of the orientation in rad; NaN if the run failed."""

    start: int  # its number in the sequence
    kind: str  # of the shape
    axes: str  # a:b:c
    stokes: float
    slow_time: float  # duration over St
    error: float  # requested, of L and E
    status: str
    slow: float  # measured error of L and E
    orientation: float  # measured error of the orientation
    estimated: float  # stated upper end of the error of L and E
    uncertainty: float  # of the reference's L and E
    full_share: float  # share of the time that the full equations follow
    # Number of segments. Older tables have it under another name.
    segments: int = field(metadata={"former": "pieces"})
    # 1 if the body ends the same side up as in the reference, 0 if not. NaN if the run failed, the reference has
    # not settled (`_SETTLED`), or its orientation is uncertain.
    mirror: float


@dataclass(frozen=True)
class Speed:
    """Wall times of a run in s, and of the best full solution that meets the error."""

    start: int  # its number in the sequence
    kind: str  # of the shape
    stokes: float
    slow: float  # error of L and E of the hybrid run, over I_max; NaN if it failed or has no reference
    full_share: float  # share of the time that the full equations follow
    seconds: float  # of the hybrid run with HYBRID_SAMPLES output times
    few_seconds: float  # of the hybrid run with FEW_SAMPLES output times
    solver: str  # of the best full solution; empty if there is none
    tolerance: float  # of the best full solution
    full_seconds: float  # of the best full solution
    # Seconds that the tables of a triaxial shape take: of one not seen before, and read from disk.
    new_shape: float = 0.0
    known_shape: float = 0.0
    knowing_seconds: float = nan  # of the full solver that knows St
    # Steps of the segments that the full equations follow, and of the best full solution; NaN
    # unless the same solver took both.
    segment_steps: float = field(default=nan, metadata={"former": "window_steps"})
    full_steps: float = nan
    # Spread of the repeats of each time in s: the longest of the turns' shortest times minus the
    # shortest. NaN in tables that did not keep it.
    seconds_spread: float = nan
    few_seconds_spread: float = nan
    full_seconds_spread: float = nan
    knowing_seconds_spread: float = nan


def random_scenes(count: int = _RANDOM, seed: int = SEED) -> Iterator[Scene]:
    """Random starts, every other one triaxial, over all St and slow times.

    The first scenes of a longer sequence are the scenes of a shorter one.
    """
    # Axes are log-uniform, orientations isotropic, angular velocities of three standard normals.
    draw = np.random.default_rng(seed)
    for i in range(count):
        axes = np.exp(draw.uniform(np.log(_LEAST_AXIS), 0.0, 3))
        quaternion = draw.normal(size=4)
        spin = draw.normal(size=3)
        # A triaxial start and the spheroid after it are a pair, with one St and one slow time.
        pair = i // 2
        if i % 2:
            # Two axes of a spheroid are alike. The odd one is the first, second or third in turns.
            odd = pair % 3
            axes[(odd + 1) % 3] = axes[(odd + 2) % 3]
        stokes = STOKES[pair % len(STOKES)]
        slow_time = SLOW_TIMES[pair // len(STOKES) % len(SLOW_TIMES)]
        time = slow_time * stokes
        start = BodyStart(tuple(quaternion.tolist()), tuple(spin.tolist()))
        yield Scene(Ellipsoid(tuple(axes.tolist())), stokes, start, time)


def reference_of(scene: Scene, samples: int = HYBRID_SAMPLES) -> HybridReference:
    """The reference of a scene at equispaced times, from the cache or computed."""
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    numbers = (*problem.start, *(problem.parameters or ()), problem.end)
    content = [
        "hybrid",
        problem.name,
        [number.hex() for number in numbers],
        samples,
        REFERENCE_TOLERANCES,
        _DOUBLE,
    ]
    if not extends_precision():
        # Without heyoka there is no long double, and other methods make the reference.
        content.append("without heyoka")
    key = digest(content)
    arrays = cache.load(key)
    if arrays is None:
        if problem.end <= _LONG_DOUBLE_UP_TO:
            tight, apart = reference_observables(scene, samples)
        else:
            times = np.linspace(0.0, problem.end, samples)
            if all(find_solver(solver).available for solver, _ in _DOUBLE):
                runs = [
                    solve(problem, solver, tolerance, times).states for solver, tolerance in _DOUBLE
                ]
            else:
                runs = unlike_runs(problem, times).values()
            tight, other = (form.observe(scene, states) for states in runs)
            apart = errors(scene.ellipsoid, other, tight)
        arrays = {name: values.astype(float) for name, values in vars(tight).items()}
        arrays["uncertainty"] = np.array([apart.slow, apart.orientation])
        arrays = cache.save(key, arrays)
    slow, orientation = arrays.pop("uncertainty").tolist()
    return HybridReference(Observables(**arrays), slow, orientation)


def measure_errors(scenes: Sequence[Scene], quiet: bool = False) -> list[HybridError]:
    """Runs of the scenes at every error; scenes whose reference takes minutes are left out."""
    rows = []
    for i, scene in enumerate(in_steps(scenes, "errors", "scenes", quiet)):
        if scene.time <= _LONGEST:
            reference = reference_of(scene)
            rows += [_measured(i, scene, error, reference) for error in REQUESTED_ERRORS]
    return rows


def _measured(start: int, scene: Scene, error: float, reference: HybridReference) -> HybridError:
    """The row of a start for a requested error of L and E over I_max."""
    run = plan(
        scene,
        form=Hybrid.name,
        solver=available_like(SEGMENT_SOLVER),
        tolerance=error / ERROR_PER_TOLERANCE,
        error=error,
        want="slow",
        samples=HYBRID_SAMPLES,
    ).run()
    slow = nan
    orientation = nan
    mirror = nan
    body = scene.ellipsoid
    if run.success:
        measured = errors(body, run.observables, reference.observables)
        slow = measured.slow
        orientation = measured.orientation or nan
        # The body axis that shows which side is up: the symmetry axis, or else the shortest one. `up` is
        # its z component at the end of the reference, which must be sure of it.
        axis = body.order[2] if body.symmetry_axis is None else body.symmetry_axis
        up = float(reference.observables.rotation[-1, axis, 2])
        if abs(up) > _SETTLED and reference.orientation < _SURE_ORIENTATION:
            mirror = float(up * run.rotation[-1, axis, 2] > 0)
    return HybridError(
        start=start,
        kind=body.kind,
        axes=":".join(f"{length:.3g}" for length in body.semi_axes),
        stokes=scene.stokes,
        slow_time=scene.slow_time,
        error=error,
        status=str(run.status),
        slow=slow,
        orientation=orientation,
        estimated=run.error.slow.high if run.error.slow else nan,
        uncertainty=reference.slow,
        full_share=_share(run.segments, scene.slow_time),
        segments=len(run.segments),
        mirror=mirror,
    )


def measure_speed(quiet: bool = False) -> list[Speed]:
    """Times of random starts at each St."""
    scenes = []
    for stokes, count in FAST.items():
        for i, scene in enumerate(random_scenes(count, _FAST_SEED)):
            scenes.append((i, replace(scene, stokes=stokes, time=FAST_SLOW_TIME * stokes)))
    return [_timed(i, scene) for i, scene in in_steps(scenes, "speed", "runs", quiet)]


def _timed(start: int, scene: Scene) -> Speed:
    """The row of a start at `FAST_ERROR`: error and times of the hybrid run, times of full runs beside it."""
    form = Hybrid()
    problem = form.problem(scene)
    full_problem = find_form(full_form(scene)).problem(scene)
    times = np.linspace(0.0, scene.time, HYBRID_SAMPLES)
    # Every 20th of the 201 times.
    few_times = times[:: HYBRID_SAMPLES // (FEW_SAMPLES - 1)]
    tolerance = FAST_ERROR / ERROR_PER_TOLERANCE
    segment_solver = available_like(SEGMENT_SOLVER)
    run = solve(problem, segment_solver, tolerance, times)
    slow = nan
    steps_of: dict[FullMethod, float] = {}
    if scene.time <= _LONGEST:
        reference = reference_of(scene).observables
        if run.success:
            slow = errors(scene.ellipsoid, form.observe(scene, run.states), reference).slow
        steps_of = _full_methods(scene, full_problem, times, reference)

    def hybrid_seconds(times: np.ndarray) -> float:
        """Wall time of a run that looks ahead anew, as a first one must."""
        for cached in (outline, path_of):
            cached.cache_clear()
        began = perf_counter()
        solve(problem, segment_solver, tolerance, times)
        return perf_counter() - began

    def full_seconds(method: FullMethod) -> float:
        """Wall time of a full run."""
        return solve(full_problem, method.solver, method.tolerance, times).seconds

    timed_runs = [partial(hybrid_seconds, times), partial(hybrid_seconds, few_times)]
    timed_runs += [partial(full_seconds, method) for method in steps_of]
    hybrid_timing, few_timing, *full_timings = _in_turns(timed_runs)
    timing_of = dict(zip(steps_of, full_timings, strict=True))
    # The solver that knows St has a column of its own, and is not among the others.
    knowing_timing = _NOT_TIMED
    for method in steps_of:
        if method.solver == KNOWING:
            knowing_timing = timing_of.pop(method)
    best = min(timing_of, key=lambda method: timing_of[method].seconds, default=FullMethod())
    full_timing = timing_of.get(best, _NOT_TIMED)
    segment_steps = nan
    full_steps = nan
    if best.solver == segment_solver:
        segment_steps = sum(segment.steps or 0 for segment in run.segments if not segment.averaged)
        full_steps = steps_of[best]
    new_shape, known_shape = _table_seconds(scene.ellipsoid)
    return Speed(
        start=start,
        kind=scene.ellipsoid.kind,
        stokes=scene.stokes,
        slow=slow,
        full_share=_share(run.segments, scene.time),
        seconds=hybrid_timing.seconds,
        few_seconds=few_timing.seconds,
        solver=best.solver,
        tolerance=best.tolerance,
        full_seconds=full_timing.seconds,
        new_shape=new_shape,
        known_shape=known_shape,
        knowing_seconds=knowing_timing.seconds,
        segment_steps=segment_steps,
        full_steps=full_steps,
        seconds_spread=hybrid_timing.spread,
        few_seconds_spread=few_timing.spread,
        full_seconds_spread=full_timing.spread,
        knowing_seconds_spread=knowing_timing.spread,
    )


def _in_turns(runs: Sequence[Callable[[], float]]) -> list[Timing]:
    """Wall times of each of several runs: the shortest of each turn.

    Runs take turns, so that a slow moment of the machine hits them alike. In its turn each run is repeated,
    so that it is warm, whatever the one before left in caches.
    """
    turns = [list(map(_fastest, runs)) for _ in range(SPEED_REPEATS)]
    return [Timing(times) for times in zip(*turns, strict=True)]


def _table_seconds(ellipsoid: Ellipsoid) -> tuple[float, float]:
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

    # Makes the files of a shape that was not seen before.
    read()
    began = perf_counter()
    for longest in (False, True):
        side = tables.side_of(ellipsoid, longest)
        tables.made(side)
        squares_of(swing.series_of(side))
    made_anew = perf_counter() - began
    return made_anew, read()


def _fastest(run: Callable[[], float]) -> float:
    """Shortest wall time, in seconds, of several runs one after the other."""
    return min(run() for _ in range(SPEED_REPEATS))


def _full_methods(
    scene: Scene, problem: Problem, times: np.ndarray, reference: Observables
) -> dict[FullMethod, float]:
    """Each solver at the loosest tolerance that meets `FAST_ERROR`, with the steps of its run."""
    form = find_form(full_form(scene))
    steps: dict[FullMethod, float] = {}
    tolerances_of: dict[str, Sequence[float]] = dict.fromkeys(FULL_SOLVERS, FULL_TOLERANCES)
    if find_solver(KNOWING).takes(problem):
        tolerances_of[KNOWING] = KNOWING_TOLERANCES
    for solver, tolerances in tolerances_of.items():
        if not find_solver(solver).available:
            continue
        for tolerance in tolerances:
            run = solve(problem, solver, tolerance, times)
            if not run.success:
                continue
            error = errors(scene.ellipsoid, form.observe(scene, run.states), reference).slow
            if error <= FAST_ERROR:
                steps[FullMethod(solver, tolerance)] = run.work.steps or nan
                break
    return steps


def _share(segments: Sequence[SolvedSegment], whole: float) -> float:
    """Share of a run's time that the full equations follow.

    `whole` is the run's duration in the time of its segments: slow time of a `SceneSolution`, inverse shear
    rates of a `Solution`.
    """
    full = sum(segment.end - segment.begin for segment in segments if not segment.averaged)
    return full / whole


def measure(old: "Study | None", part: str, *, quick: bool, quiet: bool) -> "Study":
    """Both parts, or one of them anew.

    Parameters
    ----------
    old : Study or None
        An earlier study, whose other part is kept.
    part : str
        One of HYBRID_PARTS; empty for both.
    quick : bool
        Measure the errors of a few starts, and no times.
    quiet : bool
        Show no progress.
    """
    study = old or Study([], [])
    if part in ("", "errors"):
        scenes = []
        for seed in _HELD_OUT:
            scenes += random_scenes(_QUICK_RANDOM if quick else _RANDOM, seed)
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
    # When and where each part was measured, by the part's name.
    timed: Mapping[str, Record] = field(default_factory=dict)

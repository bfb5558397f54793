"""Errors of the averaged forms over random bodies, by St: references, forms, their own estimates, costs.

`polhode accuracy` runs it, `reports/accuracy` shows it. A task is one body at one St: `measure` makes
its record, `run` does the tasks that are left, `tables_of` makes tables of all records.

Columns of the table of errors: "slow" is the error of L and E over I_max, and "turned" the error of the
orientation in rad. In the table of references the same names say how far the reference may be off. "bound"
and "turned_bound" are the upper ends that `solve` states for the two errors. Each of these has a column for
each slow time t₂ = t/St of STUDIED_SLOW_TIMES, `slow_0.05` to `slow_1`, with the largest value up to that
time. "refused" says why a form does not follow a run further. `docs/second-order.md` has the theory.
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import asdict
from io import StringIO
from itertools import islice, pairwise
from math import inf, nan
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time, thread_time
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import read_csv
from polhode.harness.answers.confirmed import confirmation
from polhode.harness.answers.rules import Method
from polhode.harness.answers.runs import Run as AnswerRun, Runner
from polhode.harness.answers.statement import Difference, difference
from polhode.harness.averaging.bodies import KINDS, Body, drawn
from polhode.harness.common.files import digest, dumps, loads, read_file, write_file
from polhode.harness.common.machine import surroundings, surroundings_of
from polhode.harness.common.progress import Steps
from polhode.harness.common.store import Record, Store
from polhode.harness.references.errors import attainable
from polhode.harness.references.extended import (
    ReferenceFailedError,
    Run,
    reference_runs,
    unlike_runs,
)
from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.form import Form, FormNotValidError
from polhode.models.hybrid.form import Hybrid
from polhode.models.hybrid.plan import ERROR_PER_TOLERANCE
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.second_order.form import SecondOrder
from polhode.models.second_order.outline import outline
from polhode.models.second_order.path import path_of
from polhode.solvers.catalogue import available_like, solver as find_solver
from polhode.solvers.compile import parameter_array
from polhode.solvers.contract import UNLIMITED, Status
from polhode.solvers.ensembles.taylor_batch import run_batches
from polhode.solvers.solve import Solution, solve

# Bodies of each kind by St, at most; the first ones of a kind are measured first. Estimates: more bodies
# make the intervals of shares and exponents narrower. A reference takes a time that grows with St, so that
# there are fewer at the largest.
BODIES = {
    10.0: 200,
    100.0: 200,
    1000.0: 200,
    3160.0: 200,
    1e4: 200,
    31600.0: 200,
    1e5: 200,
    1e6: 200,
    1e7: 60,
    1e8: 20,
}
# How many more bodies a kind has at an St, in place of those whose two references do not confirm each other: the
# bodies 45 and 54 of the kind "crosses".
REPLACED = {("crosses", 1e6): 1, ("crosses", 1e7): 1}
# Bodies of each kind by St for a look with `--quick`; an estimate. No quantile counts fewer than
# `shares.LEAST_BODIES`, 20.
QUICK_BODIES = dict.fromkeys((1000.0, 1e4), 20)
# Slow times up to which errors are taken. One run, to the last of them, gives all. Estimates.
STUDIED_SLOW_TIMES = (0.05, 0.2, 0.5, 1.0)
# Samples from one slow time to the next; an estimate.
_SEGMENT_SAMPLES = 50
# St at which the errors that `solve` states of averaged runs are noted, and the number of bodies of each kind;
# estimates that bound what the runs for statements cost. `shares.bounded` counts the statements from
# `shares.STATED_FROM` on: those at smaller St stand in `errors.csv` alone. No reason is recorded for the
# choice among the St of `BODIES`.
STATED_STOKES = (100.0, 1000.0, 1e4, 31600.0, 1e5, 1e6, 1e7, 1e8)
STATED_BODIES = 200
# Bodies of each kind whose runs are timed: pages show the median. An estimate that bounds the cost.
TIMED_BODIES = 8
# Bodies of each kind that `hybrid` follows by St, estimates that bound the cost: fewer where references take
# longer. At smaller St the form follows the full equations all the time.
HYBRID_BODIES = {1e4: 60, 1e5: 60, 1e6: 20, 1e7: 5, 1e8: 2}
# Errors of L and E over I_max that `hybrid` is asked for; estimates.
REQUESTED_ERRORS = (1e-4, 1e-6, 1e-8)
# Bodies of each kind by St for which the cost of the full equations is measured; estimates that bound the
# time of the study.
COST_BODIES = {100.0: 8, 1000.0: 8, 1e4: 8, 1e5: 8, 1e6: 3}
# Tolerances that are tried from the loosest on, until a run errs by no more than the least error, which is
# the least of `shares.ERRORS_MET`.
_COST_TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
_COST_LEAST_ERROR = 1e-8
# Solvers of the full equations whose cost is measured: the usual one, and the one for spheroids that knows that
# the torque is small. A solver that is missing, or does not take the form, is left out.
_COST_SOLVERS = ("cyrk-vern8", "splitting")
# Runs of at most `_COST_LONG` seconds are timed `_BODY_COST_REPEATS` times, and the fastest counts. Both are
# estimates: a longer run is hardly disturbed.
_COST_LONG = 0.02
_BODY_COST_REPEATS = 3
# The reference is a run in long double up to this St, and a looser one shows its error. The limit is an
# estimate that bounds the time. The runs are pairs of a precision and a tolerance: the tight one is near the
# last digit of long double, the loose one has a hundred times its tolerance.
LONG_DOUBLE_UP_TO = 1000.0
_LONG_DOUBLE: tuple[Run, Run] = (("long double", 1e-18), ("long double", 1e-16))
# Up to a larger St the reference is Taylor's method in double precision. A Runge-Kutta method, for
# spheroids a splitting method, shows its error. These tolerances and those below are estimates.
_TAYLOR = ("taylor", 1e-13)
# Solver and tolerance of that other run, by the form of the full equations.
_UNLIKE = {"quaternion": ("cyrk-vern8", 1e-13), "spheroid-axis": ("splitting", 1e-11)}
# Largest St at which Taylor's method gives the reference of a spheroid, an estimate that bounds the time.
# At larger St a splitting method does; stroboscopic averaging, whose steps take many turns each, shows its error.
_TAYLOR_UP_TO = 1e6
_FAR_SPHEROIDS = (("splitting", 1e-11), ("stroboscopic", 1e-11))
# Difference of L and E, over I_max, from which on two runs do not confirm each other. An estimate: the
# largest difference of two that do is 5e-6 (`reports/accuracy/references.csv`), and one pair differs by 2e-4.
_APART = 1e-4
# Solver of the averaged forms, a tolerance that a user may take (an estimate), and one whose
# error counts for nothing. The column "solver_error" shows what the first of them costs.
FORM_SOLVER = "cyrk-vern8"
FORM_TOLERANCE = 1e-9
_EXACT_TOLERANCE = 1e-12
# Steps of an averaged run, at most, so that none goes on without end; an estimate.
_MAX_STEPS = 300_000
# Bodies in a batch: the lanes that Taylor's method has with two registers of 256 bits, four doubles each. If
# heyoka recommends wider ones, half of its lanes repeat a body.
_BATCH = 8
# A task takes about `_ANY_TASK` seconds, and seconds per unit of St: of a triaxial body, of a spheroid,
# and of a spheroid beyond `_TAYLOR_UP_TO`. These numbers serve the order of tasks alone. They are
# estimates: no measurement of them is recorded.
_ANY_TASK = 0.1
_SECONDS_PER_STOKES = 2.2e-6
_SPHEROIDS_PER_STOKES = 1.2e-6
_FAR_SPHEROIDS_PER_STOKES = 1e-7
# Tasks are ordered by seconds**_COST_POWER × (number of the body + _HEAD_START), the smallest first. So a study
# that is cut short has some bodies at every St. Both numbers are estimates.
_COST_POWER = 0.35
_HEAD_START = 20
# Changes whenever a record's meaning does, so that no old record is taken for a new one.
_SCHEMA = 1
_DATA_TABLES = ("bodies", "references", "errors", "costs")
_DIGITS = 3  # Significant digits of measured numbers in the tables.

Array = np.ndarray
Frame = Any  # Of pandas, whose types say too little of it.
# Slow times of a run's samples, shape (201,): 0, then equal steps up to each of STUDIED_SLOW_TIMES.
# `_LAST_SAMPLES` has the places of these four.
_SEGMENTS_OF_TIMES = [
    np.linspace(begin, end, _SEGMENT_SAMPLES + 1)[1:]
    for begin, end in pairwise((0.0, *STUDIED_SLOW_TIMES))
]
TIMES = np.concatenate([[0.0], *_SEGMENTS_OF_TIMES])
_LAST_SAMPLES = [_SEGMENT_SAMPLES * (i + 1) for i in range(len(STUDIED_SLOW_TIMES))]


class Task(NamedTuple):
    """One body at one St."""

    kind: str
    body: int
    stokes: float

    @property
    def key(self) -> str:
        """Its key in a store."""
        return digest([_SCHEMA, *self])


class Reference(NamedTuple):
    """The full equations' solution at TIMES, and how far it may be off up to each of STUDIED_SLOW_TIMES."""

    observables: Observables
    slow: list[float]  # largest difference of L and E, over I_max, of two methods
    turned: list[float]  # largest difference of their orientations, in rad
    method: str  # the solvers, the one whose solution it is first


def tasks(bodies: dict[float, int], kinds: Iterable[str] = KINDS) -> list[Task]:
    """All bodies of the kinds at all St, cheap ones first."""
    all_tasks = []
    for kind in kinds:
        for stokes, count in bodies.items():
            all_tasks += [Task(kind, body, stokes) for body in range(count)]
    return sorted(all_tasks, key=_rank)


def whole() -> list[Task]:
    """All tasks of the study, cheap ones first."""
    more = [
        Task(kind, BODIES[stokes] + number, stokes)
        for (kind, stokes), count in REPLACED.items()
        for number in range(count)
    ]
    return sorted([*tasks(BODIES), *more], key=_rank)


def _rank(task: Task) -> float:
    """The number by which tasks are ordered, a smaller one first: of the estimated seconds and the body."""
    rate = _SECONDS_PER_STOKES
    if task.kind in ("prolate", "oblate"):
        rate = _SPHEROIDS_PER_STOKES
        if task.stokes > _TAYLOR_UP_TO:
            rate = _FAR_SPHEROIDS_PER_STOKES
    seconds = _ANY_TASK + rate * task.stokes
    return seconds**_COST_POWER * (task.body + _HEAD_START)


def reference_of(scene: Scene, by_taylor: Array | None = None) -> Reference:
    """The reference of a scene; raises ReferenceFailedError if two methods do not confirm each other.

    `by_taylor` are the states of its run by Taylor's method, shape (201, d), where that has been made.
    """
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    times = TIMES * scene.stokes
    pair = (_TAYLOR, _UNLIKE[form.name])
    if scene.stokes > _TAYLOR_UP_TO and form.name == "spheroid-axis":
        pair = _FAR_SPHEROIDS
    names = [name for name, _ in pair]
    method = ", ".join(names)
    if scene.stokes <= LONG_DOUBLE_UP_TO:
        method = "long double"
        runs = reference_runs(problem, times, _LONG_DOUBLE)
    elif all(find_solver(name).available for name in names):
        (first, tolerance), (second, other_tolerance) = pair
        if by_taylor is None or first != _TAYLOR[0]:
            by_taylor = _states(problem, first, tolerance, times)
        runs = (by_taylor, _states(problem, second, other_tolerance, times))
    else:
        by_solver = unlike_runs(problem, times)
        method = ", ".join(by_solver)
        runs = by_solver.values()
    tight, loose = (form.observe(scene, states) for states in runs)
    # From long double back to double.
    tight = Observables(*(values.astype(float) for values in vars(tight).values()))
    loose = Observables(*(values.astype(float) for values in vars(loose).values()))
    slow, turned = _largest(difference(scene.ellipsoid, tight, loose))
    if not max(slow) < _APART:
        raise ReferenceFailedError(f"{method}: runs are {max(slow):.1g} apart")
    # Two runs may agree by chance to less than rounding allows.
    least = attainable(scene.ellipsoid, tight)
    return Reference(tight, [max(least, value) for value in slow], turned, method)


def _states(problem: Problem, solver: str, tolerance: float, times: Array) -> Array:
    """States of a run, shape (n, d); ReferenceFailedError if it does not reach its end."""
    run = solve(problem, solver, tolerance, times)
    if not run.success:
        raise ReferenceFailedError(f"{solver} ended with {run.status}")
    return run.states


def _largest(apart: Difference) -> tuple[list[float], list[float]]:
    """Largest differences of L and E, and of the orientation, up to each of STUDIED_SLOW_TIMES."""
    return _largest_up_to(apart.slow), _largest_up_to(apart.orientation)


def _largest_up_to(values: Array | None) -> list[float]:
    """Largest values up to each of STUDIED_SLOW_TIMES; NaN beyond the last sample, or without values."""
    largest = [nan] * len(STUDIED_SLOW_TIMES)
    if values is None:
        return largest
    for i, last in enumerate(_LAST_SAMPLES):
        if last < len(values):
            largest[i] = float(np.max(values[: last + 1]))
    return largest


def measure_together(several: Sequence[Task]) -> list[Record]:
    """The records of tasks at one St; Taylor's method runs their bodies in the lanes of one batch.

    That takes some seventh of the time of runs one by one.
    """
    bodies = [drawn(task.kind, task.body) for task in several]
    runs = dict[int, Array]()
    seconds = 0.0
    if _in_batches(several[0]):
        began = process_time()
        runs = _by_taylor([body.scene(several[0].stokes) for body in bodies])
        seconds = (process_time() - began) / max(1, len(runs))
    return [
        measure(task, body, runs.get(place), seconds if place in runs else 0.0)
        for place, (task, body) in enumerate(zip(several, bodies, strict=True))
    ]


def _in_batches(task: Task) -> bool:
    """Whether Taylor's method in double precision runs the body in a batch."""
    # Kinds of any shape have spheroids among them, which `_by_taylor` leaves out.
    may_be_triaxial = task.kind not in ("prolate", "oblate")
    return may_be_triaxial and task.stokes > LONG_DOUBLE_UP_TO and find_solver(_TAYLOR[0]).available


def _by_taylor(scenes: Sequence[Scene]) -> dict[int, Array]:
    """States by Taylor's method of those scenes, by their place, that are quaternions and reach their end."""
    form = find_form("quaternion")
    places = [place for place, scene in enumerate(scenes) if full_form(scene) == form.name]
    problems = [form.problem(scenes[place]) for place in places]
    if not problems:
        return {}
    starts = np.array([problem.start for problem in problems])
    parameters = np.array([parameter_array(problem) for problem in problems])
    times = TIMES * scenes[0].stokes
    states, statuses = run_batches(
        problems[0], starts, times, _TAYLOR[1], parameters, max_steps=UNLIMITED
    )
    return {
        place: states[:, i]
        for i, place in enumerate(places)
        if statuses[i] == str(Status.REACHED_END)
    }


def measure(
    task: Task,
    body: Body | None = None,
    by_taylor: Array | None = None,
    taylor_seconds: float = 0.0,
) -> Record:
    """Everything that is measured of a body at one St, as plain data.

    Keys: "body" has the body, "reference" its row of the table of references, "errors" and "costs" the rows
    of the tables of these names. Without a reference its row has the reason under "failure", and the two
    lists are empty. A `body` that is not given is drawn. `by_taylor` is the run of `reference_of` that has
    been made, in `taylor_seconds` of processor time.
    """
    body = body or drawn(task.kind, task.body)
    scene = body.scene(task.stokes)
    # Processor time of all threads: what a reference costs. Forms are timed by this thread alone.
    began = process_time()
    task_columns = task._asdict()
    try:
        reference = reference_of(scene, by_taylor)
    except ReferenceFailedError as failure:
        row = {**task_columns, "method": "", "failure": str(failure), "seconds": nan}
        blank = [nan] * len(STUDIED_SLOW_TIMES)
        row |= _columns("slow", blank) | _columns("turned", blank)
        return {"body": asdict(body), "reference": row, "errors": [], "costs": []}
    seconds = process_time() - began + taylor_seconds
    row = {**task_columns, "method": reference.method, "failure": "", "seconds": seconds}
    row |= _columns("slow", reference.slow) | _columns("turned", reference.turned)
    with_stated = task.body < STATED_BODIES and task.stokes in STATED_STOKES
    errors = [
        _first_order(body, task, reference, with_stated),
        _second_order(body, task, reference, with_stated),
    ]
    if task.body < HYBRID_BODIES.get(task.stokes, 0):
        timed = task.body < TIMED_BODIES
        errors += [_hybrid(scene, reference, requested, timed) for requested in REQUESTED_ERRORS]
    costs = []
    if task.body < COST_BODIES.get(task.stokes, 0):
        costs = list(_costs(scene, reference))
    return {
        "body": asdict(body),
        "reference": row,
        "errors": [task_columns | error for error in errors],
        "costs": [task_columns | cost for cost in costs],
    }


def columns_up_to(name: str) -> list[str]:
    """Columns of a number up to each of STUDIED_SLOW_TIMES."""
    return [f"{name}_{slow_time:g}" for slow_time in STUDIED_SLOW_TIMES]


def _columns(name: str, values: Sequence[float]) -> dict[str, float]:
    """Values at STUDIED_SLOW_TIMES under the names of their columns."""
    return dict(zip(columns_up_to(name), values, strict=True))


def _row(form: str, requested: float = nan, refused: str = "") -> Record:
    """A row without numbers yet."""
    row = {"form": form, "requested": requested}
    for name in ("slow", "turned", "bound", "turned_bound"):
        row |= _columns(name, [nan] * len(STUDIED_SLOW_TIMES))
    return row | {"solver_error": nan, "seconds": nan, "refused": refused}


def _first_order(body: Body, task: Task, reference: Reference, with_stated: bool) -> Record:
    """The row of the form averaged to first order."""
    scene = body.scene(task.stokes)
    form = find_form(averaged_form(scene))
    try:
        form.check(scene)
    except FormNotValidError as refusal:
        return _row(form.name, refused=refusal.condition)
    return _averaged(body, task, form, reference, STUDIED_SLOW_TIMES, with_stated)


def _second_order(body: Body, task: Task, reference: Reference, with_stated: bool) -> Record:
    """The row of the second-order form, up to the last of STUDIED_SLOW_TIMES that the form follows."""
    form = SecondOrder()
    reached = []
    reason = ""
    for slow_time in STUDIED_SLOW_TIMES:
        try:
            form.check(body.scene(task.stokes, slow_time))
        except FormNotValidError as refusal:
            reason = refusal.condition
            break
        reached.append(slow_time)
    if not reached:
        return _row(form.name, refused=reason)
    row = _averaged(body, task, form, reference, reached, with_stated)
    return row | {"refused": reason}


def _averaged(
    body: Body,
    task: Task,
    form: Form,
    reference: Reference,
    slow_times: Sequence[float],
    with_stated: bool,
) -> Record:
    """The row of a form: its model error up to the last slow time, the solver's error, what `solve` states.

    A run to `_EXACT_TOLERANCE` gives the model error: there the solver's error counts for nothing. The
    solver's error is the difference between that run and a run to `FORM_TOLERANCE`. A run of its own that
    ends at a slow time, as a user's would, makes the statement of `solve` for that slow time.
    """
    scene = body.scene(task.stokes, slow_times[-1])
    count = _LAST_SAMPLES[len(slow_times) - 1] + 1
    times = TIMES[:count]
    exact = _observed(scene, form, _EXACT_TOLERANCE, times)
    usual = _observed(scene, form, FORM_TOLERANCE, times)
    if exact is None or usual is None:
        return _row(form.name, refused="the run did not reach its end")
    row = _row(form.name)
    if task.body < TIMED_BODIES:
        # The run above has compiled the form. The time is this thread's, without BLAS's threads and
        # without tasks that run beside this one.
        began = thread_time()
        _observed(scene, form, FORM_TOLERANCE, times)
        row["seconds"] = thread_time() - began
    slow, turned = _largest(difference(scene.ellipsoid, exact, reference.observables[:count]))
    row |= _columns("slow", slow) | _columns("turned", turned)
    row["solver_error"] = float(difference(scene.ellipsoid, usual, exact).slow.max())
    if with_stated:
        for slow_time in slow_times:
            row |= stated_of(body, task, form, slow_time)
    return row


def stated_of(body: Body, task: Task, form: Form, slow_time: float) -> dict[str, float]:
    """Upper ends that `solve` states for a run to a slow time, by column; NaN where it states none."""
    scene = body.scene(task.stokes, slow_time)
    runner = Runner(scene, np.array([0.0, scene.time]))
    run = runner.run(Method(form, find_solver(available_like(FORM_SOLVER))), FORM_TOLERANCE)
    stated = confirmation(runner, run)
    return {
        f"bound_{slow_time:g}": stated.slow.high if stated.slow else nan,
        f"turned_bound_{slow_time:g}": stated.orientation.high if stated.orientation else nan,
    }


def _observed(scene: Scene, form: Form, tolerance: float, slow_times: Array) -> Observables | None:
    """Observables of an averaged run; None if it does not reach its end.

    The times of averaged forms are slow times themselves (`Problem.time_unit`), and are not scaled by St.
    """
    run = solve(
        form.problem(scene),
        available_like(FORM_SOLVER),
        tolerance,
        slow_times,
        max_steps=_MAX_STEPS,
    )
    return form.observe(scene, run.states) if run.success else None


def _hybrid(scene: Scene, reference: Reference, requested: float, timed: bool) -> Record:
    """The row of form `hybrid` for a requested error of L and E over I_max."""
    form = Hybrid()
    row = _row(form.name, requested)
    runner, run = hybrid_run(scene, requested)
    if timed:
        # The run above has made the tables and compiled the form. The look ahead counts: it is done anew.
        for cached in (outline, path_of):
            cached.cache_clear()
        began = thread_time()
        runner.run(run.method, run.tolerance)
        row["seconds"] = thread_time() - began
    if not run.success:
        return row | {"refused": f"ended with {run.solution.status}"}
    observables = form.observe(scene, runner.rows(run.solution).states)
    slow, turned = _largest(difference(scene.ellipsoid, observables, reference.observables))
    row |= _columns("slow", slow) | _columns("turned", turned)
    return row | stated_by_hybrid(runner, run)


def hybrid_run(scene: Scene, requested: float) -> tuple[Runner, AnswerRun]:
    """A run of `hybrid` for a requested error, and who ran it."""
    runner = Runner(scene, TIMES * scene.stokes)
    method = Method(Hybrid(), find_solver(available_like(FORM_SOLVER)))
    return runner, runner.run(method, requested / ERROR_PER_TOLERANCE)


def stated_by_hybrid(runner: Runner, run: AnswerRun) -> dict[str, float]:
    """Upper ends that `solve` states for a run up to each slow time, by column; none where it states none."""
    along = confirmation(runner, run).at(TIMES / TIMES[-1]).along
    if along.slow is None:
        return {}
    slow, turned = _largest(Difference(along.slow, along.orientation))
    return _columns("bound", slow) | _columns("turned_bound", turned)


def _costs(scene: Scene, reference: Reference) -> Iterator[Record]:
    """Runs of the full equations at ever tighter tolerances, until the error is `_COST_LEAST_ERROR` at most."""
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    for name in _COST_SOLVERS:
        solver = find_solver(name)
        if not (solver.available and solver.takes(problem)):
            continue
        for tolerance in _COST_TOLERANCES:
            run, seconds = _fastest(problem, name, tolerance, TIMES * scene.stokes)
            if not run.success:
                continue
            observables = form.observe(scene, run.states)
            error = float(
                difference(scene.ellipsoid, observables, reference.observables).slow.max()
            )
            yield {"solver": name, "tolerance": tolerance, "error": error, "seconds": seconds}
            if error <= _COST_LEAST_ERROR:
                break


def _fastest(
    problem: Problem, solver: str, tolerance: float, times: Array
) -> tuple[Solution, float]:
    """A run, and its processor time in s, the least of several where it is short; they are alike."""
    # The first run compiles, and is not timed.
    solve(problem, solver, tolerance, times[:2])
    runs = []
    seconds = []
    for _ in range(_BODY_COST_REPEATS):
        began = thread_time()
        runs.append(solve(problem, solver, tolerance, times))
        seconds.append(thread_time() - began)
        if seconds[-1] > _COST_LONG:
            break
    return runs[-1], min(seconds)


class Data(NamedTuple):
    """The tables of a study, with the columns of `_COLUMNS`, and when and where they were measured."""

    bodies: Frame
    references: Frame
    errors: Frame
    costs: Frame
    timed: Record

    @property
    def done(self) -> set[Task]:
        """The tasks measured so far."""
        return {Task(*row) for row in self.references[TASK_COLUMNS].itertuples(index=False)}


# Columns that name a task.
TASK_COLUMNS = ["kind", "body", "stokes"]
# Columns of a body: what names it, semi-axes, quaternion, angular velocity, and what is known of its path.
_BODY_COLUMNS = (
    *("kind", "body", "a", "b", "c"),
    *("q_w", "q_x", "q_y", "q_z", "omega_1", "omega_2", "omega_3"),
    *("crossing", "kick"),
)
# Columns of each table; `requested` is empty but for `hybrid`, times are in s.
_COLUMNS = {
    "bodies": _BODY_COLUMNS,
    "references": (
        *TASK_COLUMNS,
        "method",
        *columns_up_to("slow"),
        *columns_up_to("turned"),
        "seconds",
        "failure",
    ),
    "errors": (
        *(*TASK_COLUMNS, "form", "requested", *columns_up_to("slow"), *columns_up_to("turned")),
        *(
            *columns_up_to("bound"),
            *columns_up_to("turned_bound"),
            "solver_error",
            "seconds",
            "refused",
        ),
    ),
    "costs": (*TASK_COLUMNS, "solver", "tolerance", "error", "seconds"),
}


def _body_row(body: Record) -> dict[str, Any]:
    """A body's row in its table."""
    numbers = (*body["semi_axes"], *body["quaternion"], *body["spin"])
    cells = (body["kind"], body["body"], *numbers, body["crossing"], body["kick"])
    return dict(zip(_BODY_COLUMNS, cells, strict=True))


def tables_of(records: Iterable[Record], timed: Record, old: Data | None = None) -> Data:
    """Tables of records, added to the tables of an earlier study."""
    frames: dict[str, list[Any]] = {name: [] for name in _DATA_TABLES}
    for record in records:
        frames["bodies"].append(_body_row(record["body"]))
        frames["references"].append(record["reference"])
        frames["errors"] += record["errors"]
        frames["costs"] += record["costs"]
    tables = []
    for name in _DATA_TABLES:
        table = pd.DataFrame(frames[name], columns=[*_COLUMNS[name]])
        earlier = None if old is None else getattr(old, name)
        if earlier is not None and len(earlier):
            # pandas before 3 warns of empty tables.
            table = pd.concat([earlier, table]) if len(table) else earlier
        # Columns that tell the rows of a table apart. If several rows are alike in them, the earliest counts.
        keys = [
            key
            for key in (*TASK_COLUMNS, "form", "requested", "solver", "tolerance")
            if key in table
        ]
        if len(table):
            table = table.drop_duplicates(keys).sort_values(keys, key=_in_order)
        tables.append(table.reset_index(drop=True))
    bodies, references, errors, costs = tables
    return Data(bodies, references, errors, costs, timed)


def _in_order(column: Any) -> Any:
    """Keys by which a column is sorted: the places of kinds in KINDS, and the values of other columns."""
    if column.name != "kind":
        return column
    return column.map({kind: place for place, kind in enumerate(KINDS)})


def write_data(data: Data, folder: Path) -> None:
    """Write the tables and `timed.json` into a folder."""
    for name in _DATA_TABLES:
        table = getattr(data, name)
        write_file(folder / f"{name}.csv", _as_csv(table, exact=name == "bodies"), summed=True)
    write_file(folder / "timed.json", dumps(data.timed) + "\n", summed=True)


def _as_csv(table: Frame, exact: bool) -> str:
    """A table as CSV: measured numbers in `_DIGITS` digits, all of them if `exact`; nothing where there is none."""
    written = table.copy()
    if not exact:
        for name in written.select_dtypes("number").columns:
            if name not in ("body", "stokes"):
                written[name] = [f"{value:.{_DIGITS}g}" for value in written[name]]
                written[name] = written[name].replace("nan", "")
    if "stokes" in written:
        written["stokes"] = [f"{value:g}" for value in written["stokes"]]
    return written.to_csv(index=False, lineterminator="\n")


def read_data(folder: Path) -> Data:
    """Read what `write_data` wrote; raises ValueError where a table is missing or damaged."""
    tables = []
    for name in _DATA_TABLES:
        path = folder / f"{name}.csv"
        try:
            text = read_file(path).decode()
        except OSError as error:
            raise ValueError(f"{path}: {error.strerror}, expected a table of the study") from None
        tables.append(read_csv(StringIO(text)))
    for name in ("method", "failure", "refused"):
        for table in tables:
            if name in table:
                table[name] = table[name].astype(object).fillna("")
    bodies, references, errors, costs = tables
    return Data(bodies, references, errors, costs, loads(read_file(folder / "timed.json").decode()))


def run(
    store: Store,
    todo: Sequence[Task],
    old: Data | None = None,
    *,
    workers: int = 0,
    seconds: float = inf,
    quiet: bool = False,
) -> Data:
    """Measure what neither the store nor old tables hold, and give the tables of all of it.

    Parameters
    ----------
    store : Store
        Takes every finished task, so that an interrupted run goes on.
    todo : sequence of Task
    old : Data, optional
        Tables of an earlier run.
    workers : int
        Processes; 0 for this one alone.
    seconds : float
        No task is begun later than this after the call.
    quiet : bool
        Show no progress.
    """
    done = old.done if old else set()
    stored_keys = store.keys()
    left = [task for task in todo if task not in done and task.key not in stored_keys]
    deadline = perf_counter() + seconds
    with Steps("accuracy", len(left), "references", quiet) as progress:
        for task, record in _measured(left, workers, deadline):
            store.put(task.key, task._asdict(), {**record, **surroundings()})
            progress.advance()
    records = list(store)
    return tables_of(records, timed_of(records, old), old)


def timed_of(records: Sequence[Record], old: Data | None) -> Record:
    """Days, places, commits and code of all measurements, each once, under "errors", "errors 2" and so on."""
    entries = [*old.timed.values()] if old else []
    entries += [{"date": _day(record), **surroundings_of(record)} for record in records]
    # Entries of one day, place, commit and code are one: the last of them counts.
    by_content = {dumps({**entry, "date": _day(entry)}): entry for entry in entries}
    timed = {}
    for number, entry in enumerate(by_content.values(), 1):
        timed["errors" if number == 1 else f"errors {number}"] = entry
    return timed


def _day(entry: Record) -> str:
    """The day of a measurement, as 2026-01-31."""
    return entry["date"][:10]


def first_references(data: Data) -> int | None:
    """How many of the study's references a table holds, if these are its first ones but not all."""
    all_tasks = whole()
    count = len(data.done)
    is_beginning = 0 < count < len(all_tasks) and data.done == set(all_tasks[:count])
    return count if is_beginning else None


def _measured(left: Sequence[Task], workers: int, deadline: float) -> Iterator[tuple[Task, Record]]:
    """Tasks with their records, in the order in which they end; none begins after the deadline."""
    if not workers:
        for several in _groups(left):
            if perf_counter() > deadline:
                return
            yield from zip(several, measure_together(several), strict=True)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        # No tasks wait in the pool: those that waited there would begin after the deadline. A process
        # gets its next tasks before the caller sees the last ones' records.
        queue = _groups(left)
        first_tasks = islice(queue, workers if perf_counter() <= deadline else 0)
        running = {pool.submit(measure_together, several): several for several in first_tasks}
        while running:
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            ended = [(running.pop(future), future) for future in finished]
            if perf_counter() <= deadline:
                more = islice(queue, len(ended))
                running |= {pool.submit(measure_together, several): several for several in more}
            for several, future in ended:
                yield from zip(several, future.result(), strict=True)


def _groups(left: Iterable[Task]) -> Iterator[list[Task]]:
    """Tasks one by one, or in groups of one St that fill a batch; the last groups may be smaller."""
    gathered = dict[float, list[Task]]()
    for task in left:
        if not _in_batches(task):
            yield [task]
            continue
        several = gathered.setdefault(task.stokes, [])
        several.append(task)
        if len(several) == _BATCH:
            yield gathered.pop(task.stokes)
    yield from gathered.values()

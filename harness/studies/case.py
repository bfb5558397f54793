"""A case: one scene, one form, one solver, one tolerance; its measurement is a record.

`attempt` runs a case once, `judge` adds its errors against references, `time_once` times a warm run.
`polhode.harness.studies.runner` calls them in turn, the first and last in a worker process.
"""

from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from math import inf
from time import perf_counter

import numpy as np

from polhode.harness.common.files import digest
from polhode.harness.common.store import Record
from polhode.harness.common.timing import seconds_of, with_processor, within
from polhode.harness.references.errors import Errors, errors, statistics_distance
from polhode.harness.references.extended import ReferenceFailedError
from polhode.harness.references.reference import Reference, reference
from polhode.harness.references.rotations import rotations
from polhode.models.catalogue import form as find_form, reference_form
from polhode.models.files.scene_file import scene_table
from polhode.models.libraries import version_of
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Backend, Jacobian, Status
from polhode.solvers.solve import INVARIANT_FLOOR, INVARIANT_TOLERANCES, Solution, solve

# Changes whenever a record's meaning does, so that no old record is taken for a new one.
_CASE_SCHEMA = 2
# A run of fewer steps than one per this many rotations cannot be right. An estimate: far below the steps
# of any method that follows rotations.
_ROTATIONS_PER_STEP = 20.0
# Below this St a stiff method may well step over rotations that the particle no longer makes by
# itself, as damping stops them at once. The limit is an estimate: at St = 1 damping takes about as long as a
# rotation.
_OSCILLATORY_FROM = 1.0
# Part of a case's time in which a run takes a step or two: nearly all that it takes is compilation. An estimate.
_MOMENT = 1e-9
# Cases that one worker process remembers as compiled: a batch has fewer.
_REMEMBERED_CASES = 100


@dataclass(frozen=True)
class Case:
    """One thing to measure: errors at equispaced samples, and the time of a run.

    `samples` counts the times, start and end included; `max_seconds` is the time limit of the run.
    """

    scene_name: str
    scene: Scene
    form: str
    solver: str
    tolerance: float
    samples: int
    max_seconds: float
    # By default the solver's first back end and first Jacobian.
    backend: Backend | None = None
    jacobian: Jacobian | None = None
    # The three below are neither compared nor in the key: tags of the scene in its study,
    tags: tuple[str, ...] = field(default=(), compare=False)
    # seconds that the reference may take (without a reference there are no errors),
    reference_seconds: float = field(default=inf, compare=False)
    # and whether the first run counts right-hand sides, which is slow.
    counted: bool = field(default=True, compare=False)

    @property
    def content(self) -> Record:
        """The case as plain data, types coerced, with the schema and the versions it depends on."""
        method = find_solver(self.solver)
        packages = ["polhode", method.package]
        # SUNDIALS runs in machine code where its C libraries are found, else by Python's callbacks. The
        # two are different measurements, which the version of llvmlite tells apart.
        chooses = len(method.backends) > 1 and "compiled" in method.backends
        if chooses and self.backend in (None, "compiled") and not method.lacks("compiled"):
            packages.append("llvmlite")
        return {
            "schema": _CASE_SCHEMA,
            "scene": scene_table(self.scene),
            **{
                name: getattr(self, name)
                for name in ("scene_name", "form", "solver", "backend", "jacobian")
            },
            **{name: float(getattr(self, name)) for name in ("tolerance", "max_seconds")},
            "samples": int(self.samples),
            "versions": {name: version_of(name) for name in packages},
        }

    @property
    def key(self) -> str:
        """Hash of the canonical content."""
        return digest(self.content)

    @cached_property
    def problem(self) -> Problem:
        """The scene's initial value problem in the case's form, with the least number of steps of a right run.

        Methods that average over rotations, or step over many periods, have no such number, nor has a
        run below `_OSCILLATORY_FROM`.
        """
        form = find_form(self.form)
        problem = form.problem(self.scene)
        averages = form.averaged or problem.next_segment or find_solver(self.solver).many_periods
        if averages or self.scene.stokes < _OSCILLATORY_FROM:
            return problem
        return replace(
            problem, least_steps=max(1, int(rotations(self.scene) / _ROTATIONS_PER_STEP))
        )

    @cached_property
    def times(self) -> np.ndarray:
        """Sample times in the problem's own time, shape (samples,)."""
        return np.linspace(0.0, self.problem.end, self.samples)

    def solve(self, *, count: bool = False, max_seconds: float | None = None) -> Solution:
        """Run the case once, over its samples, within its own limit or another."""
        return solve(
            self.problem,
            self.solver,
            self.tolerance,
            self.times,
            backend=self.backend,
            jacobian=self.jacobian,
            count=count,
            max_seconds=max_seconds or self.max_seconds,
        )


def attempt(case: Case) -> tuple[Record, np.ndarray]:
    """Compile, and run once: the record so far, and the states, shape (n, d), of the n samples reached.

    A run that other work cut short is repeated (`within`); if that does not help, its record is "disturbed".
    """
    prepare_seconds = prepared(case)
    solution, disturbed = within(
        case.max_seconds,
        lambda limit: case.solve(count=case.counted, max_seconds=limit),
        lambda solution: solution.status == Status.TIME_LIMIT,
    )
    # "inferred" is true of a record that no run of its own made; "reached" is the share of the time
    # that the run came to.
    record = {
        "status": str(solution.status),
        "message": solution.message,
        "inferred": False,
        "prepare_seconds": prepare_seconds,
        "counted_seconds": solution.seconds,
        "reached": float(solution.times[-1] / solution.problem.end),
        "work": asdict(solution.work),
    }
    return record | ({"disturbed": True} if disturbed else {}), solution.states


def judge(case: Case, record: Record, states: np.ndarray) -> Record:
    """Record of an attempt with its errors.

    `slow_error` and `orientation_error` are errors against the exact solution of the full equations,
    `solver_*` against the exact solution of the same form. `model_*` are errors of that exact
    solution against the full one. A full form has no model error. An error that cannot be measured
    is None. In chaotic motion, errors count up to `meaningful_until`, and `statistics_distance`
    compares the distributions over the whole run. `worst_time` is the time of the largest error of L
    and E. `certified_pieces` counts the segments by which the reference was confirmed, and `errors`
    has all fields of `Errors`. A run that did not reach its end
    has `slow_error_so_far` alone.

    Without a reference of the full equations the record gains no more than the reason, `reference_failed`.
    Without one of an averaged form it has that reason besides, and no `solver_*` and `model_*`.
    """
    form = find_form(case.form)
    ellipsoid = case.scene.ellipsoid
    try:
        full = reference(
            case.scene, reference_form(case.scene), case.samples, case.reference_seconds
        )
    except ReferenceFailedError as error:
        return {**record, "reference_failed": str(error)}
    exact = full
    if form.averaged:
        try:
            exact = reference(case.scene, form, case.samples, case.reference_seconds)
        except ReferenceFailedError as error:
            exact = None
            record = {**record, "reference_failed": str(error)}
    observables = form.observe(case.scene, states)
    if record["status"] != Status.REACHED_END:
        so_far = errors(ellipsoid, observables, full.observables[: len(states)])
        return {**record, "slow_error_so_far": so_far.slow}
    # Samples up to which the reference is one, all unless the motion is chaotic.
    n = full.meaningful
    full_observables = full.observables[:n]
    early = observables[:n]
    # The scene is for the energy balance, which needs the samples of the whole run.
    total = errors(ellipsoid, early, full_observables, case.scene if n == case.samples else None)
    distance = (
        None if n == case.samples else statistics_distance(ellipsoid, observables, full.observables)
    )
    return (
        record
        | {
            "slow_error": total.slow,
            "orientation_error": total.orientation,
            "slow_uncertainty": full.slow_uncertainty,
            "orientation_uncertainty": full.orientation_uncertainty,
            "statistics_uncertainty": full.statistics_uncertainty,
            "statistics_distance": distance,
            "meaningful_until": full.meaningful_until,
            "worst_time": float(full.times[total.worst_sample]),
            "certified_pieces": full.certificate.segments,
            "errors": asdict(total),
        }
        | _parted(case, early, full_observables, total, full, exact)
        | ({} if form.averaged else _broken_balance(total, case.tolerance))
    )


def time_once(case: Case) -> tuple[float, float]:
    """Wall time, in seconds, of one warm run of a case, and the part of it without waiting for other work."""
    # Compilation, problem and times are made before the clock starts.
    prepared(case)
    _ = case.times
    # Without a limit: the first run reached its end, and one that a limit cuts short would seem faster.
    seconds, _, had = with_processor(lambda: seconds_of(lambda: case.solve(max_seconds=inf)))
    return seconds, had


def _broken_balance(total: Errors, tolerance: float) -> Record:
    """The status of a run whose energy does not follow from the work of the torque; empty if it does."""
    allowed = max(INVARIANT_FLOOR, INVARIANT_TOLERANCES * tolerance)
    if total.balance is None or total.balance <= allowed:
        return {}
    message = f"the energy balance is broken by {total.balance:.1e}, expected at most {allowed:.1e}"
    return {"status": str(Status.FALSE_SUCCESS), "message": message}


@lru_cache(_REMEMBERED_CASES)
def prepared(case: Case) -> float:
    """Wall time of a run over next to no time, once in a process: compilation, unless others did that before."""
    find_solver(case.solver).load()
    moment = replace(case.problem, end=case.problem.end * _MOMENT, least_steps=0)
    began = perf_counter()
    solve(moment, case.solver, case.tolerance, backend=case.backend, jacobian=case.jacobian)
    return perf_counter() - began


def _parted(
    case: Case,
    observables: Observables,
    full_observables: Observables,
    total: Errors,
    full: Reference,
    exact: Reference | None,
) -> Record:
    """The solver's error and the model's, under their columns' names.

    `full` is the reference of the full equations, `exact` the one of the form. The whole error is the solver's if they
    are the same; both are None if `exact` is.
    """
    names = (
        "solver_slow_error",
        "solver_orientation_error",
        "model_slow_error",
        "model_orientation_error",
    )
    if exact is None:
        return dict.fromkeys(names)
    values = total.slow, total.orientation, 0.0, 0.0
    if exact is not full:
        exact_observables = exact.observables[: len(full_observables.slow)]
        solver_error, model = (
            errors(case.scene.ellipsoid, *pair)
            for pair in ((observables, exact_observables), (exact_observables, full_observables))
        )
        values = solver_error.slow, solver_error.orientation, model.slow, model.orientation
    return dict(zip(names, values, strict=True)) | {
        "solver_slow_uncertainty": exact.slow_uncertainty
    }


def missing(case: Case) -> Record:
    """Record of a case whose library is not installed."""
    return {
        "status": str(Status.ADAPTER_MISSING),
        "message": find_solver(case.solver).why_not,
        "inferred": True,
    }

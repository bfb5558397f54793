"""Cost against accuracy of several solvers on one problem, whatever it describes, and on classical test problems.

`WorkPrecision` is a study of one problem: it makes the reference, runs each solver at each tolerance,
measures errors and times, and has a row for each run. A setup is a solver with its options, or a
user's function in its place (`polhode.harness.studies.setups`). `run_problems` makes such studies of
the classical problems in worker processes and stores their rows.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from itertools import product
from math import inf
from numbers import Real
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from polhode.harness import DEFAULT_ERROR
from polhode.harness.analysis.equal_error import best_of_families
from polhode.harness.analysis.frames import rows_of
from polhode.harness.common.files import digest, dumps, write_file
from polhode.harness.common.machine import surroundings, surroundings_of, versions
from polhode.harness.common.progress import Progress, Steps
from polhode.harness.common.store import Record, Store
from polhode.harness.common.timing import BUDGET, Timing, collector_off, within
from polhode.harness.common.worker import Failure, KilledFromOutsideError, Worker
from polhode.harness.ivp import atol_of, check_positive, check_samples
from polhode.harness.references.any_problem import OwnReference, reference_of
from polhode.harness.references.extended import ReferenceFailedError
from polhode.harness.references.uncertainty import least_known
from polhode.harness.studies.own_problem import check_jacobian, moved_start
from polhode.harness.studies.runner import COMPILATION, how_failed
from polhode.harness.studies.setups import FUNCTION, Setup, as_setups, run_function, users_times
from polhode.models.libraries import need
from polhode.models.own_function import OwnField, in_one_line, place_of
from polhode.models.problem import Problem
from polhode.models.problems.catalogue import PROBLEMS
from polhode.models.problems.classical import Classical
from polhode.models.registry import hint
from polhode.models.spent import SPENT
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.compile import check_field, frozen
from polhode.solvers.contract import SolverNotValidError, Status, Work
from polhode.solvers.solve import solve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Relative tolerances of the classical problems, one a decade: from SciPy's default, 1e-3, to the last one
# above rounding (`polhode.models.problem.ROUNDING`).
_CLASSICAL_TOLERANCES = tuple(10.0**-k for k in range(3, 13))
# Relative tolerances of a first look (`quick`): three of them, far apart. A choice.
QUICK_TOLERANCES = (1e-4, 1e-7, 1e-10)
# Time limit of one run of a classical problem, in seconds, and with `quick`; estimates. A larger limit
# adds slow runs at tight tolerances to the table, and time to the study.
_CLASSICAL_SECONDS = 3.0
_QUICK_CLASSICAL_SECONDS = 0.3
# A study measures this unless it is told otherwise: every second decade of tolerances, 100 equal intervals,
# and seconds for a run. Estimates: each only sets how long a study takes and how much of it is seen.
_DEFAULT_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
_STUDY_SAMPLES = 101
_STUDY_SECONDS = 10.0
# Errors by name: the largest at any sample, the one at the end, the root of the mean square.
_ERRORS = ("max", "final", "L2")
# Status of solvers that do not take a function in plain Python, and what rows of others say then.
_REFUSED = "refused"
_PLAIN_PYTHON = "plain Python"
# An error above this is no accuracy. In the measure of the errors it is not `known`. A deviation above this
# share of the state's size is no success either. An estimate: larger errors hardly follow the tolerance.
_NO_ACCURACY = 0.1
# Uncertainty of a reference, in the measure of the errors, from which on it contradicts no run. It is a tenth
# of `_NO_ACCURACY`, the error that the reference would have to judge.
_UNSURE_REFERENCE = 0.01
# Seconds after which a run stops that is only to be prepared: it stops at its first step.
_NO_SECONDS = 1e-9

Atol = float | Sequence[float] | Callable[[float], float | Sequence[float]] | None


class WorkPrecision:
    """A work-precision study of one problem: `frame` holds the rows, `plot` draws them, `write` makes a page.

    A row is a solver at a relative tolerance. Its main columns, with times in seconds:

    - `seconds`: the fastest warm run, the integration alone, as in `solve(...).seconds`;
    - `spread`: the slowest of the warm runs less the fastest;
    - `compile_seconds`: what preparing the solver took, nothing once that is cached; of a function, what its
      first call took beyond the fastest one;
    - `trace_seconds`: what tracing the function took, once for all rows;
    - `error`: measured against `reference`, whose `uncertainty` is in the same measure;
    - `known`: whether the error is above ten times that uncertainty and not above 0.1;
    - `status`: `false_success` also for a run that is off by more than 0.1 of the state's size, by a
      reference whose uncertainty is below 0.01;
    - `runs_as`: whether the right-hand side was "compiled" or "plain Python". Solvers that take compiled
      ones alone then have one row, of status `refused`, with the reason. Rows of solvers that are functions
      say "function": they may compile it or not.

    Parameters
    ----------
    problem : Problem or callable
        One's own (`Problem.from_function`) or a form's (`form("quaternion").problem(scene)`). With
        `over`, it may be a function of the parameters named there that returns a Problem.
    solvers : sequence or dict, optional
        Catalogue names, solvers of one's own, or functions ``mine(f, t_span, y0, t_eval, rtol,
        atol) -> states`` that return states of shape (len(t_eval), d). Any of these may stand in a
        pair with a dictionary of options: ``("radau", {"max_step": 0.1})``. A dictionary gives them
        labels. By default every solver that accepts the problem.
    tolerances : sequence of float
        Relative tolerances.
    samples : int
        Equispaced times at which the error is measured.
    max_seconds : float
        Time limit in seconds of a run, those of the reference too. A solver stopped by it does not run
        at tighter tolerances; the row stays.
    quiet : bool
        No progress on the terminal.
    classical : Classical, optional
        A test problem: the error is that of the end, `Classical.error`, against the published one,
        whatever `error` and `relative` say. `atol` is by default `Classical.atol`.
    atol : float, sequence of float or callable, optional
        Absolute tolerance of all rows but those of setups with an `atol` of their own: one number or
        one per component; or a function of the relative tolerance, ``lambda rtol: 1e-6 * rtol``. By
        default the relative tolerance times the largest component of the start, or that tolerance
        if the start is 0.
    error : {"max", "final", "L2"}
        The largest deviation of any component at any sample; the largest at the end; the root mean
        square over samples and components.
    relative : bool
        Whether a component's deviation is divided by that component's largest magnitude.
    reference : callable, ndarray or solution, optional
        One's own: a function of the user's time that returns the state, states of shape (samples,
        d), or a solution with `sol`. Taken as exact. With `over`, the function may take all these
        parameters by name, too.
    over : dict, optional
        A parameter of the function by name, and its values: the study is made for all of them, and
        `frame` has a column for the parameter. Several parameters are combined in all ways.

    Raises
    ------
    ValueError
        In one line, what is wrong with an argument, and what was expected; solvers and reference are
        looked at when `frame` is first read.
    """

    def __init__(
        self,
        problem: Problem | Callable[..., Problem],
        solvers: Any = None,
        tolerances: Sequence[float] = _DEFAULT_TOLERANCES,
        samples: int = _STUDY_SAMPLES,
        max_seconds: float = _STUDY_SECONDS,
        quiet: bool = False,
        classical: Classical | None = None,
        *,
        atol: Atol = None,
        error: str = "max",
        relative: bool = True,
        reference: Any = None,
        over: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        if not (isinstance(problem, Problem) or (over and callable(problem))):
            expected = "expected a Problem: Problem.from_function(f, y0, t_end), or a form's"
            # Messages show the first 60 characters of what was given.
            raise ValueError(f"problem: got {problem!r:.60}, {expected}")
        check_samples(samples)
        values = [*tolerances] if np.iterable(tolerances) else []
        if not (values and all(isinstance(value, Real) and value > 0 for value in values)):
            raise ValueError(f"tolerances: got {tolerances!r}, expected positive numbers")
        if error not in _ERRORS:
            raise ValueError(
                f"error: got {error!r}{hint(str(error), _ERRORS)}, expected one of {', '.join(_ERRORS)}"
            )
        check_positive("max_seconds", max_seconds)
        self.over: dict[str, list[float]] = {}
        for name, numbers in (over or {}).items():
            is_text = isinstance(numbers, str)
            # Read once: an iterator has its values no second time.
            self.over[name] = [*numbers] if np.iterable(numbers) and not is_text else []
            if not self.over[name]:
                expected = f"values of {name!r} in a sequence, at least one"
                raise ValueError(f"over: got {in_one_line(numbers)}, expected {expected}")
        self.solvers = solvers
        self.tolerances = tuple(values)
        self.samples = samples
        self.max_seconds = max_seconds
        self.quiet = quiet
        self.classical = classical
        self.atol = atol
        self.error = error
        self.relative = relative
        if classical and atol is None:
            self.atol = classical.atol
        self.own_reference = reference
        began = perf_counter()
        # Traces a user's function once, for all runs.
        self.problem = frozen(problem) if isinstance(problem, Problem) else problem
        self.trace_seconds = perf_counter() - began

    @property
    def name(self) -> str:
        """The problem's name."""
        return str(getattr(self.problem, "name", getattr(self.problem, "__name__", "problem")))

    @property
    def one(self) -> Problem:
        """The problem; ValueError in a study over a parameter, which has one for each of its `studies`."""
        if self.over or not isinstance(self.problem, Problem):
            raise ValueError(
                f"over: got {', '.join(self.over)}, expected `studies`: one for each value"
            )
        return self.problem

    @cached_property
    def studies(self) -> list[tuple[dict[str, float], "WorkPrecision"]]:
        """The studies that this one consists of, each with its values of the parameters in `over`, by name."""
        points = [
            dict(zip(self.over, values, strict=True)) for values in product(*self.over.values())
        ]
        if not self.over:
            return [({}, self)]
        return [(point, self._at(point)) for point in points]

    def _at(self, point: dict[str, float]) -> "WorkPrecision":
        """The study at one point: a value for each parameter in `over`, by name."""
        base = self.problem
        is_problem = isinstance(base, Problem)
        problem = _with_parameters(base, point) if is_problem else base(**point)
        reference = self.own_reference
        if callable(reference) and not hasattr(reference, "sol"):
            reference = _at_point(reference, point)
        words = ", ".join(f"{name} = {value:g}" for name, value in point.items())
        return WorkPrecision(
            replace(problem, name=f"{problem.name}, {words}"),
            solvers=self.solvers,
            tolerances=self.tolerances,
            samples=self.samples,
            max_seconds=self.max_seconds,
            quiet=self.quiet,
            atol=self.atol,
            error=self.error,
            relative=self.relative,
            reference=reference,
        )

    @cached_property
    def reference(self) -> tuple[np.ndarray, float]:
        """States, shape (samples, d), and their uncertainty in the same measure as the errors.

        A classical problem has the states at start and end alone, shape (2, d).
        """
        return self._reference.states, self._reference.uncertainty

    @property
    def source(self) -> str:
        """The source of the reference, in words."""
        return self._reference.source

    @cached_property
    def _reference(self) -> OwnReference:
        """The published end of a classical problem, the reference that was given, or a computed one."""
        problem = self.one
        if self.classical:
            # The published state at the end is part of the test problem; it counts as exact.
            ends = np.array([problem.start, self.classical.reference])
            return OwnReference(ends, 0.0, self.classical.source)
        if self.own_reference is not None:
            return OwnReference(self._given(self.own_reference), 0.0, "given")
        return reference_of(problem, self.times, self.error_of, self.max_seconds)

    def _given(self, reference: Any) -> np.ndarray:
        """States of a reference of one's own, shape (samples, d)."""
        problem = self.one
        times = self.times
        states: np.ndarray
        if hasattr(reference, "sol") and callable(reference.sol):
            # The harness's own solutions count time as the problem does, SciPy's as the user does.
            in_problem_time = isinstance(getattr(reference, "problem", None), Problem)
            states = np.asarray(
                reference.sol(times if in_problem_time else users_times(problem, times))
            ).T
        elif callable(reference):
            own_times = users_times(problem, times).tolist()
            try:
                rows = [reference(t) for t in own_times]
                states = np.array(rows, dtype=float).reshape(len(times), -1)
            except Exception as error:
                failure = f"{type(error).__name__}: {error}{place_of(error, __file__)}"
                raise ValueError(f"reference: got {failure}, expected states") from error
        else:
            states = np.asarray(reference)
        dimensions = (self._components, self.one.dimension)
        if states.ndim != 2 or len(states) != len(times) or states.shape[1] not in dimensions:
            expected = f"states of shape {(len(times), self._components)}"
            raise ValueError(f"reference: got shape {states.shape}, expected {expected}")
        if not np.isfinite(states.astype(float)).all():
            raise ValueError("reference: got numbers that are not finite, expected finite ones")
        return states

    @property
    def _components(self) -> int:
        """Components of the user's state: all of the problem's but for a time."""
        return self.one.dimension - self.one.timed

    @property
    def times(self) -> np.ndarray:
        """Sample times in the problem's own time, shape (samples,)."""
        return np.linspace(0.0, self.one.end, self.samples)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """One row per solver and tolerance, and per value of the parameters in `over`."""
        if self.over:
            return pd.concat(
                [study.frame.assign(**point) for point, study in self.studies], ignore_index=True
            )
        rows = []
        setups = as_setups(self.solvers, self.one)
        if any(setup.solver for setup in setups):
            check_field(self.one)
            check_jacobian(self.one)
        with Progress(self.quiet) as progress:
            loosest = max(self.tolerances)
            # Before the reference, which may use a solver that is timed here, and would compile for it.
            compile_seconds = [
                _prepared(one, self.one, loosest, self._atol_of(one, loosest)) for one in setups
            ]
            progress.begin(f"{self.name}: reference")
            exact = None
            uncertainty = None
            no_reference = ""
            try:
                exact, uncertainty = self.reference
            except ReferenceFailedError as error:
                no_reference = str(error)
            for i, setup in enumerate(setups):
                progress.begin(f"{self.name}: {setup.label}, {i + 1} of {len(setups)} solvers")
                if reason := self._refusal(setup):
                    rows.append(self._refused_row(setup, loosest, reason))
                    continue
                for tolerance in sorted(self.tolerances, reverse=True):
                    row = self._measure(setup, tolerance, exact, uncertainty)
                    if tolerance == loosest and compile_seconds[i] is not None:
                        row["compile_seconds"] = compile_seconds[i]
                    rows.append({**row, "message": row["message"] or no_reference})
                    if row["status"] == Status.TIME_LIMIT:
                        break
        return pd.DataFrame(rows)

    def _refusal(self, setup: Setup) -> str:
        """Why a solver does not take a function in plain Python, or a function no singular mass matrix; else empty.

        A solver that does not take a compiled function raises its error when it runs.
        """
        if setup.solver is None:
            if self.one.parameters is None:
                return "the mass matrix is singular, and a function gets f alone"
            return ""
        if not self.one.plain:
            return ""
        try:
            setup.solver.check(self.one)
        except SolverNotValidError as error:
            return error.reason
        return ""

    def _refused_row(self, setup: Setup, tolerance: float, reason: str) -> dict[str, Any]:
        """The one row of a solver that does not take the problem."""
        not_measured = ("atol", "error", "seconds", "spread", "compile_seconds", "uncertainty")
        return {
            "solver": setup.label,
            "tolerance": tolerance,
            "status": _REFUSED,
            "message": reason,
            **dict.fromkeys(not_measured),
            "trace_seconds": self.trace_seconds,
            "family": setup.family,
            "implicit": setup.implicit,
            "runs_as": None,
            **vars(Work()),
            "known": False,
        }

    def plot(self, axes: "Axes", *, best: bool = False, reach: float | None = None) -> "Axes":
        """Draw wall time against error, titled with problem and tolerances, with a label for each solver.

        The axes are returned. Errors that the reference does not resolve are grey. With `best`, the
        solvers of `best` alone. A study over a parameter is drawn as the time that each solver takes to
        `reach` an error, by default `DEFAULT_ERROR`, against the parameter; ValueError over several.
        """
        need("plot", "matplotlib")
        from polhode.harness.pages import own_problem

        frame = self.best() if best else self.frame
        if self.over:
            return own_problem.draw_over(axes, frame, self, reach or DEFAULT_ERROR)
        return own_problem.draw(axes, frame, self)

    def best(self) -> pd.DataFrame:
        """The rows of one solver of each family: the fastest at the most errors (`best_of_families`)."""
        return best_of_families(self.frame)

    def to_csv(self, path: str | Path) -> Path:
        """Write `frame` as CSV."""
        return write_file(Path(path), self.frame.to_csv(index=False))

    def to_json(self, path: str | Path) -> Path:
        """Write the study's settings and its rows as JSON."""
        rows = rows_of(self.frame)
        return write_file(Path(path), dumps({**self.settings(), "rows": rows}) + "\n")

    def settings(self) -> dict[str, Any]:
        """The requested settings, the source of the reference in words, and `surroundings`."""
        sources = [_source(study) for _, study in self.studies]
        return {
            "problem": self.name,
            "tolerances": list(self.tolerances),
            "atol": self._atol_in_words(),
            "error": f"{'relative' if self.relative else 'absolute'}, {self.error}",
            "samples": self.samples,
            "max_seconds": self.max_seconds,
            "over": {name: [*values] for name, values in self.over.items()},
            "reference": sources if self.over else sources[0],
            **surroundings(),
        }

    def write(self, folder: str | Path, command: str = "") -> Path:
        """Write page, figure, `runs.csv` and `runs.json` into a folder; return the page's path."""
        need("write", "matplotlib")
        from polhode.harness.pages import own_problem

        return own_problem.write_page(self, Path(folder), command)

    def error_of(self, states: np.ndarray, exact: np.ndarray) -> float:
        """The error of states against exact ones, both of shape (samples, d), as `error` and `relative` say."""
        if self.classical:
            return self.classical.error(states[-1])
        components = self._components
        exact = exact[:, :components]
        off = np.abs(states[:, :components] - exact)
        if self.relative:
            size = np.max(np.abs(exact), axis=0)
            off = off / np.where(size > 0, size, 1)
        if self.error == "L2":
            return float(np.sqrt(np.mean(off**2)))
        return float(np.max(off[-1] if self.error == "final" else off))

    def _atol_in_words(self) -> Any:
        """The absolute tolerance as `settings` write it: by relative tolerance if it is a function."""
        if callable(self.atol):
            return {f"{tolerance:g}": self.atol(tolerance) for tolerance in self.tolerances}
        return "rtol × largest component of the start" if self.atol is None else self.atol

    def _atol_of(self, setup: Setup, tolerance: float) -> Any:
        """The absolute tolerance of a run: the setup's option, else the study's, else the default.

        It is None for a solver that takes none, unless one is given.
        """
        if "atol" in setup.options:
            return setup.options["atol"]
        if not setup.has_atol and self.atol is None:
            return None
        if callable(self.atol):
            try:
                return self.atol(tolerance)
            except Exception as error:
                failure = f"{type(error).__name__}: {error}{place_of(error, __file__)}"
                raise ValueError(f"atol: got {failure}, expected a number") from error
        if self.atol is not None:
            return self.atol
        return atol_of(tolerance, self.one.start[: self._components])[0]

    def runner(self, setup: Setup, tolerance: float) -> Callable[..., Any]:
        """One run as ``run(max_seconds, count=, doubt=)``, by a solver or by a function in its place.

        With `count` right-hand sides are counted; with `doubt` a claimed success is looked at, which takes time.
        Neither is for runs that are timed. A function has no time limit, and `doubt` changes nothing.
        """
        problem = self.one
        times = self.times
        atol = self._atol_of(setup, tolerance)
        options = {name: value for name, value in setup.options.items() if name != "atol"}

        def run(limit: float = inf, *, count: bool = False, doubt: bool = False) -> Any:
            if setup.solver is None:
                return run_function(setup, problem, times, tolerance, atol, count=count)
            how = {"count": count, "max_seconds": limit, "doubt": doubt, **options}
            return solve(problem, setup.solver, tolerance, times, atol=atol, **how)

        return run

    def _measure(
        self, setup: Setup, tolerance: float, exact: np.ndarray | None, uncertainty: float | None
    ) -> dict[str, Any]:
        """The row of a setup at a tolerance.

        `exact` and `uncertainty` are `reference`; both are None if there is none.
        The first run counts right-hand sides, and gives status and error. Times come from further
        runs, which count nothing; a run that failed or was too slow has none.
        """
        atol = self._atol_of(setup, tolerance)
        run = self.runner(setup, tolerance)
        compile_seconds = _prepared(setup, self.one, tolerance, atol)
        first, _ = within(
            self.max_seconds,
            partial(run, count=True, doubt=True),
            lambda one: one.status is Status.TIME_LIMIT,
        )
        status = first.status
        message = first.message
        error = self.error_of(first.states, exact) if first.success and exact is not None else None
        if error is not None and exact is not None:
            # A run far off a reference that is known well enough has no error to be shown.
            apart = self._apart(first.states, exact)
            if apart > _NO_ACCURACY and uncertainty is not None and uncertainty < _UNSURE_REFERENCE:
                status = Status.FALSE_SUCCESS
                error = None
                message = f"off by {apart:.2g} of the state's size"
        if status.success and setup.solver is not None:
            allowed = tolerance * np.max(np.abs(self.one.start)) if atol is None else atol
            message = message or moved_start(self.one, first.states, tolerance, allowed)
        timing = None
        if status.success and first.seconds <= self.max_seconds:
            timing = _timed(run)
        if setup.solver is None and timing:
            # Time of the first call beyond the others: a library's own compilation.
            compile_seconds = max(0.0, first.seconds - timing.seconds)
        least = least_known(uncertainty)
        return {
            "solver": setup.label,
            "tolerance": tolerance,
            "atol": atol if atol is None or np.ndim(atol) == 0 else tuple(atol),
            "status": str(status),
            "message": message,
            "error": error,
            "seconds": timing.seconds if timing else None,
            "spread": timing.spread if timing else None,
            "compile_seconds": compile_seconds,
            "trace_seconds": self.trace_seconds,
            "family": setup.family,
            "implicit": setup.implicit,
            "runs_as": _runs_as(first),
            **vars(first.work),
            "uncertainty": uncertainty,
            "known": error is not None and bool(least < error <= _NO_ACCURACY),
        }

    def _apart(self, states: np.ndarray, exact: np.ndarray) -> float:
        """The largest deviation of any component over the largest component of the exact states.

        For a classical problem, `exact` has the start and the end alone.
        """
        components = self._components
        exact = exact[:, :components]
        off = (states[[0, -1]] if self.classical else states)[:, :components] - exact
        size = float(np.max(np.abs(exact))) or 1.0
        return float(np.max(np.abs(off))) / size


def _runs_as(run: Any) -> str:
    """Whether a run's right-hand side was machine code, Python, or a function's own affair."""
    settings = getattr(run, "settings", None)
    if settings is None:
        # It may compile the right-hand side or not.
        return FUNCTION
    return _PLAIN_PYTHON if settings.backend == "python" else "compiled"


def _timed(run: Callable[[], Any]) -> Timing:
    """Times of repeated runs, of the integration alone."""
    timing = None
    while timing is None or timing.wants_more:
        with collector_off():
            seconds = run().seconds
        timing = Timing((*(timing.runs if timing else ()), seconds))
    return timing


def _prepared(setup: Setup, problem: Problem, tolerance: float, atol: Any) -> float | None:
    """Seconds that preparing a solver takes, imports left out; None of a plain function or a missing library.

    Errors are left to the runs that are measured, whose rows tell them.
    """
    if setup.solver is None or not setup.solver.available:
        return None
    # `SPENT` sums this process's seconds by kind of work.
    before = SPENT.seconds["compilation"]
    with suppress(Exception):
        # A run that ends at its first step. These limits stand above options of the same name.
        limits = {"max_steps": 1, "max_seconds": _NO_SECONDS, "doubt": False}
        solve(problem, setup.solver, tolerance, **{**setup.options, "atol": atol, **limits})
    return SPENT.seconds["compilation"] - before


def _source(study: WorkPrecision) -> str:
    """The source of a study's reference in words, or why there is none."""
    try:
        return study.source
    except ReferenceFailedError as error:
        return str(error)


def _at_point(reference: Callable[..., Any], point: dict[str, float]) -> Callable[[float], Any]:
    """A reference as a function of time alone; the parameters are bound if it takes them by name."""
    names = inspect.signature(reference).parameters
    if not all(name in names for name in point):
        return reference
    return lambda t: reference(t, **point)


def _with_parameters(problem: Problem, point: dict[str, float]) -> Problem:
    """A problem of one's own function with some parameters changed; ValueError if it has none of that name."""
    if not isinstance(problem.field, OwnField):
        expected = "a Problem.from_function, or a function of the parameters that returns a Problem"
        raise ValueError(f"over: got {', '.join(point)} of {problem.name!r}, expected {expected}")
    count = len(problem.field_parameters)
    # The function's first two arguments are t and y.
    names = [*inspect.signature(problem.field.function).parameters][2 : 2 + count]
    parameters = list(problem.field_parameters)
    for name, value in point.items():
        if name not in names:
            expected = f"one of {', '.join(names)}" if names else "a function with parameters"
            raise ValueError(f"over: got {name!r}{hint(name, names)}, expected {expected}")
        parameters[names.index(name)] = float(value)
    if problem.parameters is None:
        # The mass matrix is singular: there is no explicit form.
        assert problem.mass_form
        mass_form = replace(problem.mass_form, parameters=tuple(parameters))
        return replace(problem, mass_form=mass_form)
    return replace(problem, parameters=tuple(parameters))


def side_by_side(studies: Sequence[WorkPrecision], *, best: bool = False) -> "Figure":
    """A figure with one panel for each study, and one legend; `best` as in `WorkPrecision.plot`."""
    need("side_by_side", "matplotlib")
    from polhode.harness.pages import own_problem

    return own_problem.panels_of(
        [(own_problem.title(study), study.best() if best else study.frame) for study in studies]
    )


def measured(
    name: str, solver: str, tolerances: Sequence[float], max_seconds: float
) -> list[Record]:
    """Rows of one classical problem by one solver; `run_problems` calls this in a worker process."""
    one = PROBLEMS[name]
    study = WorkPrecision(
        one.problem,
        [solver],
        tolerances,
        # Start and end: the error is taken at the end.
        samples=2,
        max_seconds=max_seconds,
        quiet=True,
        classical=one,
    )
    return rows_of(study.frame)


def run_problems(
    store: Store,
    names: Sequence[str] = (),
    solvers: Sequence[str] = (),
    *,
    quick: bool = False,
    quiet: bool = False,
) -> list[Record]:
    """Measure what the store lacks; return the rows of all, each with problem, machine, versions and date.

    Problems and solvers are named as `pairs_of` takes them. `quick` takes `QUICK_TOLERANCES` and a shorter
    time limit, and `quiet` shows no progress. Raises KilledFromOutsideError if something
    else, such as a system without memory, kills the worker process again and again.
    """
    settings = {
        "tolerances": QUICK_TOLERANCES if quick else _CLASSICAL_TOLERANCES,
        "max_seconds": _QUICK_CLASSICAL_SECONDS if quick else _CLASSICAL_SECONDS,
    }
    pairs = pairs_of(names, solvers)
    cases = (
        {"problem": name, "solver": solver, **settings, "versions": versions()}
        for name, solver in pairs
    )
    cases_by_key = {digest(case): case for case in cases}
    stored_keys = store.keys()
    all_rows = []
    # Seconds of a case: compilation, and for each tolerance the first run and those that are timed. The last of
    # these may begin just before their budget is spent: hence twice the budget, an estimate. The worker is
    # killed at twice the sum (`Worker.run`).
    limit = COMPILATION + len(settings["tolerances"]) * (settings["max_seconds"] + 2 * BUDGET)
    progress = Steps("problems", len(cases_by_key), "cases", quiet)
    with Worker() as worker, progress:
        for key, case in cases_by_key.items():
            if key in stored_keys:
                progress.advance()
                continue
            progress.detail(f"{case['problem']} {case['solver']}")
            reply = worker.run(
                measured,
                case["problem"],
                case["solver"],
                settings["tolerances"],
                settings["max_seconds"],
                limit=limit,
            )
            if reply.failure is Failure.LOST:
                raise KilledFromOutsideError(
                    f"{case['problem']} by {case['solver']}: {reply.message}"
                )
            # A failed process tells nothing of single tolerances: one row stands for all.
            failed_row = {"solver": case["solver"], "tolerance": None}
            rows = (
                [failed_row | how_failed(reply.failure, reply.message)]
                if reply.failure
                else reply.value
            )
            store.put(
                key,
                {"problem": case["problem"]},
                {"rows": rows, **surroundings()},
            )
            progress.advance()
    for record in store:
        if record["key"] in cases_by_key:
            common = {name: record.get(name) for name in ("problem", "date")}
            common |= surroundings_of(record)
            all_rows += [{**row, **common} for row in record["rows"]]
    return all_rows


def pairs_of(names: Sequence[str], solvers: Sequence[str]) -> list[tuple[str, str]]:
    """Pairs of a problem and a solver that takes it; all problems and all solvers unless they are named.

    Raises ValueError if a name is no problem's, or none of the solvers takes any of the problems.
    """
    for name in names:
        if name not in PROBLEMS:
            raise ValueError(
                f"scene: got {name!r}{hint(name, PROBLEMS)}, expected one of {', '.join(PROBLEMS)}"
            )

    def takes(solver: str, one: Classical) -> bool:
        """Whether a solver is installed, takes a problem, and is not known to take for ever on it."""
        method = find_solver(solver)
        return method.available and solver not in one.hopeless and method.takes(one.problem)

    problem_names = names or PROBLEMS
    methods = solvers or SOLVERS
    pairs = []
    for name in problem_names:
        pairs += [(name, method) for method in methods if takes(method, PROBLEMS[name])]
    if pairs:
        return pairs
    raise ValueError(
        f"solver: got {', '.join(methods)}, expected one that takes {' or '.join(problem_names)}"
    )

"""`solve`: one problem, one solver, one tolerance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from polhode.models.former import Former
from polhode.models.own_function import MAX_EXACT_JACOBIAN, OwnField, in_one_line
from polhode.models.problem import Problem
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import as_it_stands, as_plain
from polhode.solvers.contract import (
    OWN,
    UNLIMITED,
    Backend,
    Jacobian,
    Outcome,
    Record,
    Settings,
    Solver,
    SolverNotValidError,
    Status,
    Work,
)
from polhode.solvers.dense_output import LikeSolveIvp, states_at, times_within
from polhode.solvers.event_search import EventFailedError, EventSearch, SoughtEvent, looks
from polhode.solvers.segments import Run, SolvedSegment, wrapped, wrapped_start
from polhode.solvers.singularity import jumped

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# A success whose invariant drifts by more than a limit counts as false. The numbers are estimates, so
# wide that runs that are only inaccurate pass: what the limit catches has left the solutions altogether.
# The limit is this many tolerances,
INVARIANT_TOLERANCES = 1e6
# but at least this drift, for rounding in long runs,
INVARIANT_FLOOR = 1e-6
# and at most this drift, as of a squared norm of 1.5 in place of 1,
_INVARIANT_CEILING = 0.5
# or this many tolerances per step, if that is more: norms of quaternions, which fields divide out,
# drift by 0.6 in 5000 good steps at 1e-4,
_INVARIANT_PER_STEP = 3.0
# but never more than this drift, as of a squared norm of 3 in place of 1.
_INVARIANT_LIMIT = 2.0


@dataclass(frozen=True)
class Solution(LikeSolveIvp):
    """Result of a run, finished or not; called with times it gives the solution there.

    Parameters
    ----------
    problem : Problem
    method : Solver
    settings : Settings
    times : ndarray, shape (n,)
        Times reached, in the problem's own time: all requested ones if the status is `reached_end`.
        If an event ended the run, its time is the last one. With `every_step` they are those of the
        solver's steps.
    states : ndarray, shape (n, d)
    status : Status
    message : str
        Why it failed, in the library's own words; empty after success.
    work : Work
    seconds : float
        Wall time of the integrator alone, compilation left out.
    segments : tuple of SolvedSegment
        The segments of a run of several, in the run's time; else empty.
    """

    problem: Problem
    method: Solver
    settings: Settings
    times: np.ndarray
    states: np.ndarray
    status: Status
    message: str
    work: Work
    seconds: float
    segments: tuple[SolvedSegment, ...] = ()

    stages = Former("segments")

    @property
    def solver(self) -> str:
        """The solver's name."""
        return self.method.name

    def __call__(self, t: "ArrayLike") -> "Solution":
        """The solution at other times of the run, a number or an array: `polhode.solvers.dense_output.states_at`."""
        times = times_within(self, t)
        return replace(self, times=times, states=states_at(self, times, solve))

    def __repr__(self) -> str:
        """One fact a line, without the arrays."""
        problem = (
            f"{self.problem.name}, {self.problem.dimension} components, to t = {self.problem.end:g}"
        )
        return described(
            self, problem, f"tolerance {self.settings.tolerance:g}, {self.settings.backend}"
        )


def described(solution: Any, problem: str, setting: str) -> str:
    """A solution in words, one fact a line; counts that the library does not report are left out."""
    work = ", ".join(
        f"{count} {name}" for name, count in vars(solution.work).items() if count is not None
    )
    status = str(solution.status)
    if solution.message:
        status = f"{status}: {solution.message}"
    times = solution.times
    rows = str(len(times))
    if len(times):
        rows = f"{rows}, t = {float(times[0]):g} to {float(times[-1]):g}"
    facts = {
        "problem": problem,
        "solver": f"{solution.solver} at {setting}",
        "status": status,
        "rows": rows,
        "work": work or "not reported",
        "seconds": f"{solution.seconds:.3g}",
    }
    lines = [f"  {name}: {fact}" for name, fact in facts.items()]
    return "\n".join([type(solution).__name__, *lines])


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a run; `solution` holds the finished part."""

    def __init__(self, solution: Solution) -> None:
        super().__init__("interrupted")
        self.solution = solution


def solve(
    problem: Problem,
    solver: str | Solver,
    tolerance: float | Sequence[float],
    times: np.ndarray | None = None,
    *,
    atol: float | Sequence[float] | None = None,
    max_step: float = inf,
    first_step: float | None = None,
    backend: Backend | None = None,
    jacobian: Jacobian | None = None,
    count: bool = False,
    max_seconds: float = inf,
    max_steps: int = UNLIMITED,
    watch: Callable[[Record], None] | None = None,
    doubt: bool = True,
    events: Sequence[SoughtEvent] = (),
    every_step: bool = False,
) -> Solution:
    """Solve a problem.

    Parameters
    ----------
    problem : Problem
    solver : str or Solver
        Catalogue name, or a solver of one's own.
    tolerance : float or sequence of float
        The relative tolerance, and the absolute one too unless `atol` is given; positive. Its
        meaning for each library stands in the docstring of the solver or of its module. One number
        per component where the library takes that.
    times : ndarray, shape (n,), optional
        Requested times, increasing from 0; by default the start and the end.
    atol : float or sequence of float, optional
        The absolute tolerance, one number or one per component; refused by solvers that have one
        tolerance.
    max_step, first_step : float, optional
        In the problem's time; refused by solvers whose library has no such limit.
    backend, jacobian : str, optional
        See `Settings`; by default the first one that the solver offers.
    count : bool
        Count right-hand sides, which costs time.
    max_seconds, max_steps : float and int
        Limits of wall time and of steps.
    watch : callable, optional
        Called with the record of each segment of the run before it begins; a thread may read how far
        it has come from `record.reached`.
    doubt : bool
        Look whether a run of one's own function that claims success has stepped over the end of its
        solution (`polhode.solvers.singularity`).
    events : sequence of SoughtEvent
        Looked for at every step; if the solver's `seeks_events` is false, between the rows after the
        run. They hold the times and states at which they happened. A terminal one ends the run,
        successfully, and is its last row.
    every_step : bool
        Rows are the solver's own steps, whatever `times` lie between its first and its last one;
        of SciPy's methods alone.

    Returns
    -------
    Solution
        Failure is a status, never an exception.

    Raises
    ------
    ValueError
        If an argument is out of range, the solver does not accept the problem, or an event's
        function fails.
    Interrupted
        On Ctrl-C, with the finished part.
    """
    method = find_solver(solver)
    problem = wrapped_start(as_it_stands(problem))
    problem = _for_method(problem, method, backend)
    if problem.plain:
        backend, jacobian = _plain_choices(problem, method, backend, jacobian)
    rtol, absolute = _per_component(problem, tolerance, atol, "atol" in method.tolerances)
    settings = method.settings(
        rtol, backend, jacobian, count, atol=absolute, max_step=max_step, first_step=first_step
    )
    if problem.parameter_table is not None and first_step is not None:
        raise SolverNotValidError(
            f"first_step: got {first_step!r}, expected none, as {problem.name!r} changes on the way"
        )
    times = _requested_times(problem, times)
    run = Run(problem, method, settings, times)
    search = EventSearch(events) if events else None
    run.events = search
    run.every_step = every_step
    # A run whose status is a failure already takes no step.
    run.status, run.message = _before_start(problem, method, settings)
    try:
        if search:
            search.begin(0.0, np.array(problem.start))
        run.through(problem.next_segment or wrapped(problem, times), max_seconds, max_steps, watch)
        if search and not method.seeks_events:
            _look_through(search, _solution_so_far(run, search))
    except KeyboardInterrupt:
        run.status = Status.INTERRUPTED
        run.message = ""
        raise Interrupted(_examined(_solution_so_far(run, search), times)) from None
    except EventFailedError as error:
        raise ValueError(str(error)) from error
    solution = _solution_so_far(run, search)
    ended_by_event = search is not None and search.ended is not None
    solution = _examined(solution, solution.times if ended_by_event else run.times)
    if doubt and solution.success and (reason := jumped(solution, solve, shrunk=run.shrunk)):
        return replace(solution, status=Status.FALSE_SUCCESS, message=reason)
    return solution


def _before_start(problem: Problem, method: Solver, settings: Settings) -> Outcome:
    """Status and message of a run that is to begin: a failure if it cannot; raises if the solver refuses it."""
    if not method.available:
        return Status.ADAPTER_MISSING, str(method.why_not)
    method.check(problem)
    if unweighted := _unweighted(problem, method, settings):
        return Status.TOLERANCE_UNATTAINABLE, unweighted
    return Status.REACHED_END, ""


def _solution_so_far(run: Run, search: EventSearch | None) -> Solution:
    """The finished part of a run, up to the event that ended it if one did."""
    seconds = perf_counter() - run.began
    times = run.times[: run.done]
    states = run.rows[: run.done]
    if search and search.ended is not None:
        times, states = _until(search.ended, search.end_state, times, states)
    return Solution(
        problem=run.problem,
        method=run.method,
        settings=run.settings,
        times=times,
        states=states,
        status=run.status,
        message=run.message,
        work=run.work,
        seconds=seconds,
        segments=tuple(run.segments) if run.problem.next_segment else (),
    )


def prepared(problem: Problem, method: Solver) -> Problem:
    """A problem just made of a user's function, as a run by a method takes it.

    The function is frozen: runs do not trace it again.
    """
    problem = _for_method(problem, method, None)
    field = problem.field
    if not isinstance(field, OwnField) or field.plain:
        return problem
    return replace(problem, field=replace(field, frozen=True))


def _for_method(problem: Problem, method: Solver, backend: Backend | None) -> Problem:
    """A user's function as plain Python where that is better, and the method can call it."""
    field = problem.field
    if not isinstance(field, OwnField) or backend is not None or "python" not in method.backends:
        return problem
    many = problem.dimension > MAX_EXACT_JACOBIAN
    return as_plain(problem) if many or (field.better_plain and method.implicit) else problem


def _plain_choices(
    problem: Problem, method: Solver, backend: Backend | None, jacobian: Jacobian | None
) -> tuple[Backend | None, Jacobian | None]:
    """Back end and Jacobian of a function in plain Python, which has but one of each."""
    method.check(problem)
    if backend not in (None, "python"):
        reason = getattr(problem.field, "plain_reason", "")
        raise SolverNotValidError(f"backend: got {backend!r}, expected 'python': {reason}")
    if jacobian == "exact":
        raise SolverNotValidError(
            "jacobian: got 'exact', expected 'difference': the function is plain Python"
        )
    return "python", "difference" if method.jacobians else None


def _until(
    end: float, end_state: np.ndarray, times: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rows up to the event that ended a run, which is the last one."""
    before = int(np.searchsorted(times, end))
    return np.append(times[:before], end), np.vstack([rows[:before], end_state])


def _look_through(search: EventSearch, solution: Solution) -> None:
    """Look for events in the rows of a run whose solver does not look for them."""
    times = looks(solution.times) if len(solution.times) > 1 else np.empty(0)
    search.through(times.tolist(), solution(times).states, lambda time: solution(time).states[0])


def _per_component(
    problem: Problem, rtol: Any, atol: Any, apart: bool
) -> tuple[float | Sequence[float], float | Sequence[float] | None]:
    """Tolerances of the whole state: a time in it is known exactly, and has no say in the size of steps.

    The time is the last component, if the problem is `timed`. `apart` says whether the solver takes
    an absolute tolerance of each component: then the time's is the largest time, and its relative
    tolerance is 1.
    """
    # NumPy would take a microsecond to say so.
    if not problem.timed and isinstance(rtol, float) and (atol is None or isinstance(atol, float)):
        return rtol, atol
    components = problem.dimension - problem.timed
    given: Any
    for name, given in (("rtol", rtol), ("atol", atol)):
        if np.ndim(given) and np.shape(given) != (components,):
            expected = f"one number or {components}, one per component"
            raise ValueError(f"{name}: got {given!r:.60}, expected {expected}")
    if not (problem.timed and apart):
        return rtol, atol
    absolute = np.broadcast_to(rtol if atol is None else atol, components).tolist()
    largest_time = max(problem.end, problem.start[-1])
    relative = [*np.ravel(rtol).tolist(), 1.0] if np.ndim(rtol) else rtol
    return relative, [*absolute, max(1.0, largest_time)]


def _unweighted(problem: Problem, method: Solver, settings: Settings) -> str:
    """Why no step can be accepted from the start: a component of 0 with an absolute tolerance of 0; else empty."""
    # A library divides errors by atol + rtol |y|, and some of SciPy's methods never end. A solver of
    # one's own may measure the error otherwise.
    positive = isinstance(settings.atol, float) and settings.atol > 0
    if positive or problem.next_segment or method.family == OWN:
        return ""
    atols = np.broadcast_to(settings.atols(), problem.dimension)
    without_weight = np.flatnonzero((atols == 0) & (np.array(problem.start) == 0))
    if not len(without_weight):
        return ""
    return f"atol: got 0, expected a positive number, as y[{without_weight[0]}] is 0 at the start"


def _requested_times(problem: Problem, times: np.ndarray | None) -> np.ndarray:
    """The requested times, checked."""
    times = np.array([0.0, problem.end] if times is None else times, dtype=float)
    if (
        times.ndim != 1
        or len(times) < 2
        or times[0] != 0
        or not _all_true(times[1:] > times[:-1])
        or times[-1] == inf
    ):
        raise ValueError(
            f"times: got {in_one_line(times)}, expected at least two increasing finite numbers from 0 on"
        )
    if problem.next_segment and times[-1] > problem.end:
        raise ValueError(
            f"times: got {float(times[-1])!r}, expected none beyond the run's end, {problem.end}"
        )
    return times


def _all_true(truths: np.ndarray) -> bool:
    """Whether all are true: NumPy's ``all`` takes 0.8 µs, a count 0.3."""
    return np.count_nonzero(truths) == truths.size


def _examined(solution: Solution, times: np.ndarray) -> Solution:
    """The solution, its claimed success doubted; of one that is not finite, the rows before."""
    finite = np.isfinite(solution.states)
    if not _all_true(finite):
        # The first row that is not finite, by the first False.
        first = int(np.argmin(finite.all(axis=1)))
        cut = replace(solution, times=solution.times[:first], states=solution.states[:first])
        if not solution.success:
            return cut
        return replace(
            cut,
            status=Status.NON_FINITE,
            message=f"a state is not finite at t = {float(times[first])!r}",
        )
    doubt = _doubt(solution, times) if solution.success else None
    return replace(solution, status=Status.FALSE_SUCCESS, message=doubt) if doubt else solution


def _doubt(solution: Solution, times: np.ndarray) -> str | None:
    """Why a claimed success is none, if it is none."""
    if len(solution.times) != len(times):
        return f"the library stopped at t = {float(solution.times[-1])!r}, expected {float(times[-1])!r}"
    steps = solution.work.steps
    least = solution.problem.least_steps
    if steps is not None and steps < least:
        return f"the library claims success after {steps} steps, expected at least {least}"
    invariant = solution.problem.invariant
    if invariant is not None:
        drift = float(np.abs(invariant(solution.states)).max())
        allowed = _allowed_drift(solution.settings.tolerance, steps or 0)
        # NaN is more than is allowed.
        if not drift <= allowed:
            return f"the invariant is broken by {drift:.1e}, expected at most {allowed:.1e}"
    return None


def _allowed_drift(tolerance: float, steps: int) -> float:
    """Largest drift of an invariant of a successful run."""
    by_steps = _INVARIANT_PER_STEP * tolerance * steps
    ceiling = min(_INVARIANT_LIMIT, max(_INVARIANT_CEILING, by_steps))
    return min(ceiling, max(INVARIANT_FLOOR, INVARIANT_TOLERANCES * tolerance))

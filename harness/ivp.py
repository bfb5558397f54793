"""`solve_ivp` as SciPy has it, with every solver of the catalogue as a method.

A `Problem` runs from time 0 on: the user's time is t_start + t, or t_start - t in a run backwards. If
a compiled `fun` reads the time, that is one more component of its state, the last one; so `d` is the
length of the user's y0.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from math import inf, isfinite
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.common.text import in_full
from polhode.harness.events import Event, as_events
from polhode.harness.studies.own_problem import check_jacobian, moved_start
from polhode.harness.studies.setups import users_times
from polhode.models.libraries import IMPORTS
from polhode.models.own_function import INTO_A_CLOSURE, OwnField, in_one_line
from polhode.models.problem import Problem
from polhode.models.shape import require_numbers
from polhode.solvers.catalogue import available_like, first_available, solver as find_solver
from polhode.solvers.contract import UNLIMITED, Solver
from polhode.solvers.event_search import SoughtEvent
from polhode.solvers.solve import Solution, prepared, solve
from polhode.solvers.structure import bands_of

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

# Components up to which Python finds the largest in less time than NumPy. An estimate: either takes
# some microseconds here.
_FEW_COMPONENTS = 20
# Most rows of an output. An estimate: a row of a scene has 15 doubles, so that these rows take 1.2 GB.
_MAX_SAMPLES = 10_000_000
# Characters of a wrong value that a message shows. An estimate: they tell which value it is.
_SHOWN_CHARACTERS = 60
# Rounding of a time that is counted from another start and back, in eps of the larger one. An estimate: each of two
# operations rounds by half an eps of its result.
_SLACK_IN_EPS = 4.0
# Relative tolerance where none is given. A convention: SciPy's is 1e-3, which is loose for a solver of
# order 8 as the one by default.
_DEFAULT_RTOL = 1e-6
# The catalogue's names of SciPy's methods, by SciPy's own.
_SCIPYS_NAMES = {name: name.lower() for name in ("RK45", "DOP853", "Radau", "BDF", "LSODA")}


def solve_ivp(
    fun: Callable[..., Any],
    t_span: tuple[float, float],
    y0: Sequence[float],
    method: str | Solver | None = None,
    t_eval: Sequence[float] | np.ndarray | None = None,
    *,
    events: Sequence[Callable[..., float]] | Callable[..., float] | None = None,
    args: Sequence[float] | None = None,
    rtol: float | Sequence[float] = _DEFAULT_RTOL,
    atol: float | Sequence[float] | None = None,
    max_step: float = inf,
    first_step: float | None = None,
    max_steps: int = UNLIMITED,
    max_seconds: float = inf,
    jacobian: Any = None,
    jac: Any = None,
    jac_sparsity: Any = None,
    lband: int | None = None,
    uband: int | None = None,
    mass: Any = None,
    dense_output: bool = True,
    **options: Any,
) -> "OptimizeResult":
    """Solve ``y' = fun(t, y, *args)`` by a solver of the catalogue or of one's own.

    Parameters
    ----------
    fun : callable
        ``fun(t, y, *args)`` of a state y of shape (d,), as `Problem.from_function` takes it: compiled
        where it can be, else called as it is.
    t_span : pair of float
        Start and end; the end may lie before the start.
    y0 : sequence of float, length d
        The state at the start.
    args : sequence of float, optional
        Further arguments of `fun`, of events and of the Jacobian.
    method : str or Solver
        A catalogue name (`polhode solvers`), SciPy's of the same method (``"RK45"``),
        ``"module:class"``, or a solver. By default
        `cyrk-dop853`; `dop853` of a function that runs as plain Python; where anything is known of
        the Jacobian `bdf`, or `cvode-bdf` if it has few diagonals; `ida` where equations are
        algebraic.
    t_eval : sequence of float, optional
        Times of the output, shape (n,), from start to end. By default 201 equispaced ones; of a
        function in plain Python by SciPy's methods the solver's own steps.
    events : callable or sequence of callables, optional
        ``event(t, y, *args)``, a number or a condition, with SciPy's attributes `direction` and
        `terminal` if need be.
    rtol : float or sequence of float
        Relative tolerance: one number, or one per component where the solver takes that.
    atol : float or sequence of float, optional
        Absolute tolerance, one number or one per component. By default rtol times the largest
        component of `y0`, or rtol if all of them are 0, of which `message` then tells.
    max_step, first_step : float, optional
        Largest and first step; refused by solvers whose library has no such limit.
    max_steps : int
        Steps after which the run ends as `step_limit`; by default 10^9, as good as no limit.
    max_seconds : float
        Wall time in seconds after which it ends as `time_limit`.
    jacobian : callable or matrix, optional
        ``jacobian(t, y, *args)``, shape (d, d), an array or a sparse matrix; `jac` is the same.
    jac_sparsity : array or sparse matrix, optional
        Pattern of the Jacobian.
    lband, uband : int, optional
        Diagonals of the Jacobian below and above the main one.
    mass : array or sparse matrix, optional
        M in ``M y' = fun(t, y)``, its diagonal or a matrix; where it is singular, by `ida` alone.
    dense_output : bool
        For SciPy's sake: `sol` is always there.
    options
        Any other of SciPy's options is refused.

    Returns
    -------
    scipy.optimize.OptimizeResult
        With the fields of SciPy's result: t, shape (n,), y, shape (d, n), sol (always there),
        t_events, y_events, nfev, njev, status, message, success. An event that happened k times has
        states of shape (k, d) in `y_events`; SciPy's status is 0 at the end, 1 after a terminal event,
        -1 after a failure. The message says if the function ran as plain Python, if
        algebraic equations moved the start, and if rtol allows errors as large as the solution.

    Raises
    ------
    ValueError
        In one line, what is wrong with an argument, and what was expected.
    """
    with IMPORTS:
        from scipy.optimize import OptimizeResult

    if options:
        taken = (
            "t_eval, events, args, rtol, atol, max_step, first_step, jac, jac_sparsity, lband, "
            "uband, dense_output"
        )
        raise ValueError(
            f"solve_ivp: got {', '.join(options)}, expected no options of SciPy's but {taken}"
        )
    require_numbers("t_span", t_span, 2)
    check_tolerance("rtol", rtol)
    check_positive("max_seconds", max_seconds)
    if not isinstance(max_steps, Integral):
        raise ValueError(f"max_steps: got {in_one_line(max_steps)}, expected a whole number")
    if t_span[0] == t_span[1] or not all(map(isfinite, t_span)):
        raise ValueError(f"t_span: got {t_span!r}, expected a start and another, finite end")
    began, end = map(float, t_span)
    if not isfinite(end - began):
        raise ValueError(f"t_span: got {t_span!r}, expected a finite duration")
    args = () if args is None else _numbers_of(args)
    structure = {"jac_sparsity": jac_sparsity, "lband": lband, "uband": uband, "mass": mass}
    problem = Problem.from_function(
        fun,
        y0,
        end,
        args,
        t_start=began,
        jacobian=jac if jacobian is None else jacobian,
        **structure,
    )
    check_jacobian(problem)
    if isinstance(method, str):
        method = _SCIPYS_NAMES.get(method, method)
    solver = find_solver(_default_method(problem) if method is None else method)
    # `from_function` has recorded the operations of `fun` to compile it: the run need not do so again.
    problem = prepared(problem, solver)
    direction = 1.0 if end > began else -1.0
    every_step = t_eval is None and problem.plain and solver.shows_steps
    requested = _requested_times(
        t_eval, began, end, problem.end, count=2 if every_step else DEFAULT_SAMPLES
    )
    # A run has its start and its end besides; they are cut off again below.
    start_added = bool(requested[0] > 0)
    end_added = bool(requested[-1] < problem.end)
    times = requested
    if start_added or end_added:
        times = np.concatenate([[0.0] * start_added, requested, [problem.end] * end_added])
    notes = [_on_rtol(rtol)]
    if atol is None and "atol" in solver.tolerances:
        atol, note = atol_of(rtol, y0)
        notes.append(note)
    limits = {"max_steps": max_steps, "max_seconds": max_seconds}
    steps = {"max_step": max_step, "first_step": first_step}
    d = len(y0)
    sought = _sought(events, partial(_value, began, direction, d, tuple(args)))
    # A count of calls is asked for where the function is compiled; plain Python counts them anyhow.
    how = {"count": not problem.plain, "events": sought, "every_step": every_step}
    run = solve(problem, solver, rtol, times, atol=atol, **how, **limits, **steps)
    # `terminal` is the number of times that an event may happen; 0 ends no run.
    ended = any(event.terminal and len(event.times) >= event.terminal for event in sought)
    last_is_extra = end_added and len(run.times) == len(times)
    if ended:
        # By default the event is the last row, as in SciPy.
        last_is_extra = t_eval is not None and run.times[-1] not in requested
    shown = slice(int(start_added), -1 if last_is_extra else None)
    notes.append(moved_start(problem, run.states, rtol, 0.0 if atol is None else atol))
    message = "a terminal event happened" if ended else _words(run)
    message = "; ".join(filter(None, [message, *notes]))
    if run.problem.plain:
        message += "; plain Python"
    scipy_status = 0 if run.success else -1
    return OptimizeResult(
        t=users_times(problem, run.times[shown]),
        y=run.y[:d, shown],
        sol=partial(_sol, run, began, direction, d),
        t_events=[began + direction * np.array(event.times) for event in sought],
        y_events=[_states_of(event, d) for event in sought],
        nfev=run.nfev,
        njev=run.njev,
        status=1 if ended else scipy_status,
        message=message,
        success=run.success,
    )


def _numbers_of(args: Any) -> tuple[float, ...]:
    """The arguments of `solve_ivp`; ValueError, which says what to do instead, if one is no number."""
    numbers = args if np.iterable(args) and not isinstance(args, str | dict) else [args]
    for number in numbers:
        if not isinstance(number, Real):
            raise ValueError(f"args: got {in_one_line(number)}, expected numbers; {INTO_A_CLOSURE}")
    return tuple(numbers)


def _default_method(problem: Problem) -> str:
    """The solver where none is named, or one of its kind where its library is missing."""
    field = problem.field
    # The mass matrix is singular: some equations are algebraic.
    if problem.parameters is None:
        return "ida"
    if isinstance(field, OwnField) and field.structure is not None:
        return first_available("cvode-bdf", "bdf") if bands_of(problem) else "bdf"
    return "dop853" if problem.plain else available_like("cyrk-dop853")


def _requested_times(
    t_eval: Any, began: float, end: float, duration: float, *, count: int
) -> np.ndarray:
    """Requested times of a run, which begins at 0, increasing; `count` equispaced ones by default."""
    if t_eval is None:
        times = np.linspace(0.0, duration, count) if count > 2 else np.array([0.0, duration])
        if not _rise(times):
            expected = f"a duration that holds {count} different times"
            raise ValueError(f"t_span: got {(began, end)!r}, expected {expected}")
        return times
    if end > began:
        times = increasing("t_eval", t_eval, began, end) - began
    else:
        times = began - decreasing("t_eval", t_eval, began, end)
    if not _rise(times):
        expected = f"times that still differ when counted from the start, {in_full(began)}"
        raise ValueError(f"t_eval: got {in_one_line(t_eval)}, expected {expected}")
    return times


def _sought(events: Any, value: Callable[..., Any]) -> list[SoughtEvent]:
    """The events of `solve_ivp` as a run seeks them; `value` is `_value` but for its last three arguments."""
    functions = () if events is None else events
    if not isinstance(functions, Iterable):
        functions = [functions]
    sought = []
    for function in functions:
        if not (callable(function) or isinstance(function, Event)):
            got = in_one_line(function)
            raise ValueError(f"events: got {got}, expected a function event(t, y)")
        # One by one, so that their names may be the same.
        event = as_events([function])[0]
        of_run = partial(value, event.function)
        sought.append(SoughtEvent(event.name, of_run, event.direction, int(event.terminal)))
    return sought


def _value(
    began: float,
    direction: float,
    d: int,
    args: Sequence[float],
    event: Callable[..., Any],
    t: float,
    y: np.ndarray,
) -> Any:
    """The value of a user's event at the time t and the state y of a run."""
    return event(began + direction * t, y[:d], *args)


def _states_of(event: SoughtEvent, d: int) -> np.ndarray:
    """States at which an event happened, shape (k, d)."""
    return np.array(event.states)[:, :d] if event.states else np.empty((0, d))


def _sol(run: Solution, began: float, direction: float, d: int, t: Any) -> np.ndarray:
    """SciPy's `sol`: states at the user's times t, shape (d,) for a number and (d, k) for k of them."""
    times = direction * (np.asarray(t) - began)
    # The last of the user's times, as the solution shows it, may lie beyond the last row by rounding.
    last = run.times[-1]
    slack = _SLACK_IN_EPS * np.finfo(float).eps * max(abs(began), abs(last))
    return run.sol(np.where((times > last) & (times <= last + slack), last, times))[:d]


def _words(run: Solution) -> str:
    """How a run ended, in words."""
    reason = f" ({run.message})" if run.message else ""
    return run.status.meaning + reason


def _on_rtol(rtol: float | Sequence[float]) -> str:
    """The warning about a relative tolerance that allows errors as large as the solution; else empty."""
    largest = float(np.max(rtol))
    return f"rtol = {largest:g} allows errors as large as the solution" if largest >= 1 else ""


def atol_of(rtol: float | Sequence[float], y0: Sequence[float]) -> tuple[float, str]:
    """The absolute tolerance where none is given, and what is to be said of it.

    It is the least relative tolerance times the largest component of the start, or that tolerance itself
    if the start is 0.
    """
    size = max(map(abs, y0)) if len(y0) < _FEW_COMPONENTS else np.max(np.abs(y0))
    size = float(size)
    least = float(np.min(rtol))
    if size > 0:
        return least * size, ""
    return least, f"atol = rtol = {least:g}, as y0 is 0; give atol if the solution is small"


def check_positive(name: str, value: Any) -> None:
    """Raise ValueError unless it is a positive number."""
    if not (isinstance(value, Real) and float(value) > 0):
        raise ValueError(f"{name}: got {in_one_line(value)}, expected a positive number")


def check_tolerance(name: str, value: Any) -> None:
    """Raise ValueError unless it is a finite positive number or several."""
    # The usual case, without the microseconds of an array.
    if isinstance(value, float) and 0 < value < inf:
        return
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    good = numbers.ndim < 2 and numbers.size and (np.isfinite(numbers) & (numbers > 0)).all()
    if not good or isinstance(value, str | bool):
        got = f"{value!r:.{_SHOWN_CHARACTERS}}"
        raise ValueError(f"{name}: got {got}, expected a finite positive number")


def check_samples(samples: int) -> None:
    """Raise ValueError unless `samples` is a number of output times, start and end included."""
    if not (isinstance(samples, Integral) and 2 <= samples <= _MAX_SAMPLES):
        raise ValueError(
            f"samples: got {samples!r}, expected a whole number from 2 to {_MAX_SAMPLES}"
        )


def increasing(name: str, values: Any, begin: float, end: float) -> np.ndarray:
    """Times as an array, shape (n,); ValueError unless they increase and lie within a run from `begin` to `end`."""
    times = _times(values)
    if not (_rise(times) and begin <= times[0] and times[-1] <= end):
        got = f"{values!r:.{_SHOWN_CHARACTERS}}"
        expected = f"increasing numbers from {in_full(begin)} to {in_full(end)}"
        raise ValueError(f"{name}: got {got}, expected {expected}")
    return times


def decreasing(name: str, values: Any, begin: float, end: float) -> np.ndarray:
    """Times as an array, shape (n,); ValueError unless they decrease and lie within a run backwards.

    It goes from `begin`, the larger number, to `end`.
    """
    times = _times(values)
    if not (_rise(-times) and end <= times[-1] and times[0] <= begin):
        got = f"{values!r:.{_SHOWN_CHARACTERS}}"
        expected = f"decreasing numbers from {in_full(begin)} to {in_full(end)}"
        raise ValueError(f"{name}: got {got}, expected {expected}")
    return times


def _times(values: Any) -> np.ndarray:
    """Times as an array, empty if they are no numbers."""
    try:
        array = np.array(values)
        # Booleans, whole and real numbers, and objects that may be numbers; no text and no complex numbers.
        return array.astype(float) if array.dtype.kind in "biufO" else np.empty(0)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def _rise(times: np.ndarray) -> bool:
    """Whether times are a sequence in which each is later than the one before."""
    return bool(times.ndim == 1 and times.size and (np.diff(times) > 0).all())

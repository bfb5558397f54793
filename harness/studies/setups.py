"""Setups of a work-precision study: solvers, of the catalogue or one's own, and plain functions, with options.

`polhode.WorkPrecision` takes them. The times of a problem run from 0 on. The user's own time may begin
elsewhere and run backwards: a plain function gets times as the user counts them.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from polhode.models.operations import FLOAT
from polhode.models.own_function import OwnField, place_of
from polhode.models.problem import Problem
from polhode.models.recording import Recording
from polhode.models.registry import hint
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Solver, Status, Work

# Letters of an error's message that a row keeps: an estimate of what is still read.
_MESSAGE_LETTERS = 300
# Arguments of a solver that is a plain function.
ARGUMENTS = "f, t_span, y0, t_eval, rtol, atol"
# Options that `solve` takes, which a setup may give.
OPTIONS = ("atol", "backend", "jacobian", "max_step", "first_step", "max_steps")
# Family of plain functions in tables.
FUNCTION = "function"

Rates = Callable[[float, Any], Any]


@dataclass(frozen=True)
class Setup:
    """A solver, or a plain function in its place, with its options and the label that its rows carry."""

    label: str
    solver: Solver | None
    function: Callable[..., Any] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def family(self) -> str:
        """The library it belongs to."""
        return self.solver.family if self.solver else FUNCTION

    @property
    def implicit(self) -> bool | None:
        """Whether its method is; None if that is not known."""
        return self.solver.implicit if self.solver else None

    @property
    def has_atol(self) -> bool:
        """Whether an absolute tolerance may differ from the relative one."""
        return self.solver is None or "atol" in self.solver.tolerances


@dataclass(frozen=True)
class FunctionRun:
    """The run of a solver that is a plain function, with the names of a `Solution`."""

    states: np.ndarray  # shape (n, d), of the user's d components; (0, d) after a failure
    status: Status
    message: str
    work: Work
    seconds: float  # wall time of the whole call

    @property
    def success(self) -> bool:
        """Whether it reached the end."""
        return self.status.success


def as_setups(solvers: Any, problem: Problem) -> list[Setup]:
    """Setups of a sequence or of a dictionary by labels; by default every solver that accepts the problem.

    Solvers that take compiled functions alone are among them, even if the problem's runs as plain Python.

    An entry is a name, a `Solver`, a function of `ARGUMENTS`, or a pair of one of these and a
    dictionary of options. A ValueError says what is wrong with one, in one line.
    """
    if solvers is None:
        compiled = _as_if_compiled(problem)
        names = (find_solver(name) for name in SOLVERS)
        return [Setup(one.name, one) for one in names if one.available and one.takes(compiled)]
    if isinstance(solvers, Mapping):
        setups = [_setup(entry, str(label)) for label, entry in solvers.items()]
    elif isinstance(solvers, str) or not isinstance(solvers, Sequence):
        raise ValueError(
            f"solvers: got {solvers!r}, expected a sequence: [{solvers or 'taylor'!r}]"
        )
    else:
        setups = [_setup(entry, "") for entry in solvers]
    if not setups:
        raise ValueError(f"solvers: got {solvers!r}, expected a sequence: ['taylor']")
    labels = [setup.label for setup in setups]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise ValueError(
            f"solvers: got {twice!r} twice, expected labels: {{'first': …, 'second': …}}"
        )
    return setups


def _as_if_compiled(problem: Problem) -> Problem:
    """The problem as if its function were compiled; not to be run."""
    field = problem.field
    if not isinstance(field, OwnField) or not field.plain:
        return problem
    # A field with a recording, here an empty one, counts as compiled.
    return replace(problem, field=replace(field, recording=Recording((), ())))


def _setup(entry: Any, label: str) -> Setup:
    """The setup of an entry as `as_setups` takes them; an empty label stands for its name and options."""
    options: Mapping[str, Any] = {}
    if isinstance(entry, tuple | list) and len(entry) == 2 and isinstance(entry[1], Mapping):
        entry, options = entry
    if inspect.isfunction(entry) or inspect.ismethod(entry):
        _check_arguments(entry, options)
        return Setup(label or entry.__name__, None, entry, options)
    named: Any = entry
    solver = find_solver(named)
    unknown = next((name for name in options if name not in OPTIONS), None)
    if unknown is not None:
        got = f"solver {solver.name!r}: got the option {unknown!r}{hint(unknown, OPTIONS)}"
        raise ValueError(f"{got}, expected one of {', '.join(OPTIONS)}")
    words = ", ".join([solver.name, *(f"{name} {value}" for name, value in options.items())])
    return Setup(label or words, solver, None, options)


def _check_arguments(function: Callable[..., Any], options: Mapping[str, Any]) -> None:
    """ValueError unless a function can be called with `ARGUMENTS` and its options."""
    signature = inspect.signature(function)
    try:
        signature.bind(*ARGUMENTS.split(", "), **options)
    except TypeError:
        got = f"{getattr(function, '__name__', 'function')}{signature}"
        raise ValueError(f"solver: got {got}, expected mine({ARGUMENTS}) -> states") from None


def rates_of(problem: Problem) -> Rates:
    """The right-hand side ``f(t, y)`` in plain Python, of the user's own time and components.

    Not for a scene along a track, whose parameters change on the way (`Problem.parameter_table`).
    """
    parameters = problem.field_parameters
    if isinstance(problem.field, OwnField):
        function = problem.field.function
        return lambda t, y: function(t, y, *parameters)
    rates = problem.field(FLOAT)
    return lambda t, y: np.array(rates(y, parameters))


def users_times(problem: Problem, times: np.ndarray) -> np.ndarray:
    """Times of a run as the user counts them, decreasing where the user's time goes backwards."""
    return problem.field.time_at(times) if isinstance(problem.field, OwnField) else times


def run_function(
    setup: Setup, problem: Problem, times: np.ndarray, rtol: float, atol: Any, *, count: bool
) -> FunctionRun:
    """Run a solver that is a plain function, at the run's times, shape (n,); what it raises is the run's message.

    With `count` the calls of the right-hand side are counted.
    """
    assert setup.function is not None
    # The last component of a timed problem is the time, which the user's states do not have.
    components = problem.dimension - problem.timed
    rates = rates_of(problem)
    calls = 0

    def counted(t: float, y: Any) -> Any:
        nonlocal calls
        calls += 1
        return rates(t, y)

    t_eval = users_times(problem, times)
    span = float(t_eval[0]), float(t_eval[-1])
    start = np.array(problem.start[:components])
    arguments = counted if count else rates, span, start, t_eval, rtol, atol
    began = perf_counter()
    status = Status.REACHED_END
    message = ""
    states = np.empty((0, components))
    try:
        states = np.asarray(setup.function(*arguments, **setup.options), dtype=float)
    except Exception as error:
        words = " ".join(str(error).split())
        reason = f"{type(error).__name__}: {words[:_MESSAGE_LETTERS]}"
        message = f"{setup.label} raised {reason}{place_of(error, __file__)}"
        status = Status.CRASHED
    seconds = perf_counter() - began
    if status.success and states.shape != (len(times), components):
        expected = (len(times), components)
        status = Status.CRASHED
        message = (
            f"{setup.label} returned shape {states.shape}, expected states of shape {expected}"
        )
    elif status.success and not np.isfinite(states).all():
        status = Status.NON_FINITE
        message = "a state is not finite"
    work = Work(rhs_calls=calls if count and calls else None)
    return FunctionRun(states, status, message, work, seconds)

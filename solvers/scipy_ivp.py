"""SciPy's `solve_ivp` methods, stepped one by one, so that every finished row is kept and deadlines are met.

Tolerance: `rtol` and `atol`, one number for both unless told otherwise, for the error of a step in
the root-mean-square norm; `atol` may have one number per component. SciPy raises `rtol` to 100 eps
where it is smaller. Rows come from each method's own dense output.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from math import inf
from threading import RLock
from typing import Any, ClassVar

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.models.spent import spent_on
from polhode.solvers.catalogue import methods
from polhode.solvers.compile import array_callback, exact_jacobian, parameter_array, plain_rates
from polhode.solvers.contract import (
    NO_RATES,
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    Status,
    change,
)
from polhode.solvers.structure import bands_of, dense, jacobian_of, packed, pattern_of
from polhode.solvers.unwarned import UNWARNED

Callback = Callable[[float, np.ndarray], np.ndarray]

# Right-hand sides before the first attempted step of an explicit method: its constructor takes one,
_START_CALLS = 1
# and `select_initial_step` one more, a trial step later, unless the caller gives the first step.
_FIRST_STEP_CALLS = 1
# Steps in a row that do not advance the time, after which a run has stalled. An estimate: LSODA takes
# such steps without end, and calls that no error.
_STALLED = 1000
# Steps after which the run is asked whether it crawls (`Record.crawls`). An estimate: a second or less.
_LOOK = 5000

_lsoda_lock = RLock()


def _lock_of(method: str) -> AbstractContextManager[Any]:
    """A lock for methods whose runs share memory: LSODA's Fortran, before SciPy 1.17, is not reentrant."""
    if method != "LSODA":
        return nullcontext()
    with IMPORTS:
        from scipy.integrate import _ode

    # The attribute by which SciPy itself notices that a second run has begun.
    return _lsoda_lock if hasattr(_ode.lsoda, "active_global_handle") else nullcontext()


@once()
@spent_on("import")
def load_methods() -> Any:
    """SciPy's module of methods."""
    with IMPORTS:
        import scipy.integrate

    return scipy.integrate


class ScipySolver(Solver):
    """One of SciPy's `OdeSolver` classes."""

    accepts = "every form with an explicit vector field"
    library = "scipy"
    package = "scipy"
    family = "SciPy"
    tolerances = ("atol", "atol 0")
    limits = ("max_step", "first_step")
    seeks_events = True
    takes_parameter_table = True
    shows_steps = True
    method: ClassVar[str]  # SciPy's name of its class
    # Right-hand sides per attempted step of an explicit method, None of others; and those per step
    # that is interpolated. Values of these three stand in `methods.toml`, which `methods` reads.
    attempt: ClassVar[int | None] = None
    interpolation: ClassVar[int] = 0

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        method = getattr(load_methods(), self.method)
        fun, options, parameter_lists = self.bind(problem, settings)
        counting = settings.count or problem.plain
        # Explicit methods and LSODA count all right-hand sides, others not those for Jacobians.
        counts_all = self.attempt is not None or self.method == "LSODA"
        # SciPy's `nfev` serves where the user's function is plain Python and SciPy counts all calls;
        # elsewhere `counted` counts.
        counts_here = counting and not (problem.plain and counts_all)

        def integrate(record: Record) -> Outcome:
            calls = 0
            for parameters in parameter_lists:
                change(parameters, len(parameters), record)

            def counted(t: float, y: np.ndarray) -> np.ndarray:
                nonlocal calls
                calls += 1
                return fun(t, y)

            function = counted if counts_here else fun
            start = record.start.copy()
            with UNWARNED, _lock_of(self.method):
                stepper = method(function, record.times[0], start, record.times[-1], **options)
                outcome, interpolated = _step_through(stepper, record)
            work = record.work
            if counting:
                work.rhs_calls = calls if counts_here else stepper.nfev
            if self.implicit:
                work.jacobians = int(stepper.njev)
                work.factorizations = int(stepper.nlu)
            if self.attempt and work.steps:
                beside_attempts = _START_CALLS + self.interpolation * interpolated
                if settings.first_step is None:
                    beside_attempts += _FIRST_STEP_CALLS
                attempts = (stepper.nfev - beside_attempts) // self.attempt
                work.rejected = attempts - work.steps
            return outcome

        return integrate

    def bind(
        self, problem: Problem, settings: Settings
    ) -> tuple[Callback, dict[str, Any], list[Any]]:
        """The field as ``fun(t, y)``, options of SciPy's class, and arrays of parameters.

        The field reads one of these arrays, the Jacobian the other. Parameters that change on the way
        are changed in both.
        """
        options: dict[str, Any] = {
            "rtol": settings.rtol,
            "atol": settings.atols(),
            "max_step": settings.max_step,
            "first_step": settings.first_step,
        }
        if problem.plain:
            if self.implicit:
                options |= self._jacobian_options(problem)
            return plain_rates(problem), options, []
        values = parameter_array(problem)
        callback, parameters = array_callback(problem, settings.backend, values)
        dimension = problem.dimension

        def fun(t: float, y: np.ndarray) -> np.ndarray:
            out = np.empty(dimension)
            # SciPy's finite differences pass columns of a matrix.
            callback(np.ascontiguousarray(y), parameters, out)
            return out

        if self.implicit and settings.jacobian == "exact":
            jacobian = exact_jacobian(problem.field, dimension, len(values))
            options["jac"] = lambda t, y: jacobian(y, values)
        return fun, options, [values, parameters]

    def _jacobian_options(self, problem: Problem) -> dict[str, Any]:
        """The user's Jacobian, pattern or bands, as SciPy's classes take them."""
        jacobian = jacobian_of(problem)
        options = {}
        if self.method == "LSODA":
            bands = bands_of(problem)
            if bands:
                options |= {"lband": bands[0], "uband": bands[1]}
            if jacobian is not None:
                options["jac"] = _for_lsoda(jacobian, bands)
        elif jacobian is not None:
            options["jac"] = jacobian
        else:
            options["jac_sparsity"] = pattern_of(problem)
        return options

    def bare_call(
        self, problem: Problem, settings: Settings, times: np.ndarray
    ) -> Callable[[], object] | None:
        with IMPORTS:
            from scipy.integrate import solve_ivp

        fun, options, _ = self.bind(problem, settings)
        start = np.array(problem.start)
        span = (times[0], times[-1])
        return lambda: solve_ivp(fun, span, start, self.method, times, **options)


def _for_lsoda(jacobian: Any, bands: tuple[int, int] | None) -> Callback:
    """A Jacobian as LSODA takes it: a function of dense matrices, or of their bands.

    Before SciPy 1.16 as many rows as there are lower bands follow the bands: Fortran works in them.
    """
    further = 0
    if bands:
        with IMPORTS:
            from scipy import __version__ as version
        release = tuple(map(int, version.split(".")[:2]))
        further = bands[0] if release < (1, 16) else 0

    def of_state(t: float, y: np.ndarray) -> np.ndarray:
        matrix = jacobian(t, y) if callable(jacobian) else jacobian
        if bands:
            diagonals = matrix if hasattr(matrix, "diagonal") else dense(matrix)
            return packed(diagonals, *bands, further)
        return dense(matrix)

    return of_state


class _Step:
    """States within a stepper's last step, (d,) at a time and (k, d) at k times, by its own interpolation."""

    def __init__(self, stepper: Any) -> None:
        self.stepper = stepper
        self.interpolant = None

    def __call__(self, times: Any) -> np.ndarray:
        if self.interpolant is None:
            self.interpolant = self.stepper.dense_output()
        return self.interpolant(times).T


def _failure_of(error: ArithmeticError | ValueError) -> Outcome:
    """How a step failed that raised an error; raises a field's own ones again."""
    known = isinstance(error, (ArithmeticError, np.linalg.LinAlgError))
    # The message of SciPy's linear algebra with `check_finite`.
    if not known and "infs or NaNs" not in str(error):
        raise error
    return Status.NON_FINITE, str(error)


def _failed(stepper: Any, message: str | None) -> Outcome:
    """How a step failed that the stepper says has failed."""
    status = Status.STEP_UNDERFLOW if np.isfinite(stepper.y).all() else Status.NON_FINITE
    return status, message or ""


def _step_through(stepper: Any, record: Record) -> tuple[Outcome, int]:
    """Step to the end and fill rows; the outcome, and how many steps were interpolated.

    Each step costs some microseconds here besides the method's own time: what a step asks for is
    looked up before.
    """
    times = record.times
    work = record.work
    events = record.events
    taken = record.taken
    work.steps = 0
    interpolated = 0
    stalled = 0
    filled = record.filled
    count = len(times)
    # The time of the next row to be filled.
    next_row = float(times[filled]) if filled < count else inf
    rates = getattr(stepper, "f", None)
    if rates is not None and not np.isfinite(rates).all():
        # An explicit method would look for a first step without end.
        return NO_RATES, 0
    steps = 0
    before = stepper.t
    running = stepper.status == "running"
    while running:
        try:
            message = stepper.step()
        except (ArithmeticError, ValueError) as error:
            return _failure_of(error), interpolated
        running = stepper.status == "running"
        if not running and stepper.status == "failed":
            return _failed(stepper, message), interpolated
        steps += 1
        work.steps = steps
        reached = record.now = stepper.t
        # LSODA takes steps too small to advance the time for no error.
        stalled = stalled + 1 if reached == before else 0
        if stalled > _STALLED:
            return (Status.STEP_UNDERFLOW, f"stalled at t = {reached!r}"), interpolated
        before = reached
        if taken is not None:
            # The caller wants the solver's own steps: collect them. Besides the start only the end
            # is a row.
            taken.append((reached, stepper.y))
            if next_row <= reached:
                record.put(stepper.y[None])
                next_row = inf
        ended = False
        if events is not None or next_row <= reached:
            step = _Step(stepper)
            if events is not None:
                ended = record.looked_through((reached,), (stepper.y,), step)
            if next_row <= reached:
                last = int(np.searchsorted(times, reached, side="right"))
                record.put(step(times[filled : min(last, record.last_requested)]))
                filled = record.filled
                next_row = float(times[filled]) if filled < count else inf
            interpolated += step.interpolant is not None
        if ended:
            return (Status.REACHED_END, ""), interpolated
        if running:
            if steps % _LOOK == 0 and (crawling := record.crawls(steps, reached)):
                return crawling, interpolated
            if steps >= record.max_steps or record.expired:
                return record.stopped or (Status.TIME_LIMIT, ""), interpolated
    return (Status.REACHED_END, ""), interpolated


Dop853, Rk45, Radau, Bdf, Lsoda = methods(ScipySolver)

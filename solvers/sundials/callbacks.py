"""CVODE and IDA through scikit-sundae: Python calls the field, the Jacobian and every row, over the very same steps.

An exception in a callback, Ctrl-C too, ends a run and leaves its rows. A step too small to
advance the time is no error to the library: it "will continue anyway". Here it is.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from threading import Lock, get_ident
from typing import Any

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import array_callback, exact_jacobian, plain_rates
from polhode.solvers.contract import UNLIMITED, Outcome, Record, Settings, Status, change
from polhode.solvers.sundials.consistent import consistent, full, times
from polhode.solvers.sundials.jacobians import jacobian_options
from polhode.solvers.sundials.library import FAILURES, posed
from polhode.solvers.unwarned import UNWARNED

Rates = Callable[[float, np.ndarray, np.ndarray], None]

# Right-hand sides between two looks at the time reached; one and the same time twice is a stall. A step
# takes as many only for the differences of a Jacobian, which take one for each component. So a look
# waits for the larger of 1000, and 3 for each component. Both are estimates.
_LOOK = 1000
_LOOK_PER_COMPONENT = 3

# Threads that are within `quiet`, and the lock for entering and leaving it.
_quiet_threads: list[int] = []
_lock = Lock()


class _OthersAlone:
    """A stream that takes what threads write that are not within `quiet`, and drops the rest."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        """Write a text, or drop it."""
        if self.stream is None or get_ident() in _quiet_threads:
            return len(text)
        return self.stream.write(text)


@contextmanager
def quiet() -> Iterator[None]:
    """Discard what this thread prints; other threads print as ever."""
    with _lock:
        if not isinstance(sys.stdout, _OthersAlone):
            sys.stdout = _OthersAlone(sys.stdout)
        _quiet_threads.append(get_ident())
    try:
        yield
    finally:
        with _lock:
            _quiet_threads.remove(get_ident())
            if not _quiet_threads and isinstance(sys.stdout, _OthersAlone):
                sys.stdout = sys.stdout.stream


class _StoppedError(Exception):
    """A run that is to end; its arguments are the run's outcome, a status and a message."""


def rates_of(problem: Problem, settings: Settings, values: Any) -> Rates:
    """The field as ``rates(t, y, out)``."""
    if problem.plain:
        function = plain_rates(problem)

        def plain(t: float, y: np.ndarray, out: np.ndarray) -> None:
            out[:] = function(t, y)

        return plain
    callback, parameters = array_callback(problem, settings.backend, values)
    return lambda t, y, out: callback(y, parameters, out)


class Callbacks:
    """A problem bound to one of scikit-sundae's classes, ``CVODE`` or ``IDA``.

    IDA solves ``0 = residual(t, y, y')``, here the mass times y' less the field. The library calls
    the field, the residual and the Jacobian, and each of them fills the array `out`.
    """

    def __init__(self, library: type, problem: Problem, settings: Settings, **options: Any) -> None:
        self.implicit = library.__name__ == "IDA"
        self.calls = 0  # of the field in this run
        self.look = max(_LOOK, _LOOK_PER_COMPONENT * problem.dimension)
        self.last_seen = -np.inf  # the time at the latest look
        self.may_end = True  # whether a limit may end the run now (`_first_seen`)
        self.record: Record | None = None
        self.mass, values = posed(problem, self.implicit)
        # Plain Python reads a list. Both are changed in place where parameters change on the way.
        read = values.tolist() if settings.backend == "python" else values
        self.parameters = [values, read]
        self.rates = rates_of(problem, settings, read)
        field = self._counted(self.rates)
        if problem.plain:
            mass = self.mass if self.implicit else None
            options |= jacobian_options(problem, settings, field, mass)
        self.sparse = options.get("linsolver") == "sparse"
        if self.sparse:
            options["jacfn"] = self._first_seen(options["jacfn"])
        elif settings.jacobian == "exact":
            options["jacfn"] = self._exact_jacobian(problem, values)
        algebraic = np.flatnonzero(self.mass == 0)
        if self.mass.ndim == 1 and len(algebraic):
            # The library corrects the algebraic components, and the derivatives of the others.
            options |= {"algebraic_idx": algebraic.tolist(), "calc_initcond": "yp0"}
        options |= {
            "rtol": settings.tolerance,
            "atol": settings.atol if isinstance(settings.atol, float) else settings.atols(),
            # To the library 0 means that there is no limit, or that it chooses itself.
            "max_step": settings.max_step if settings.max_step < np.inf else 0.0,
            "first_step": settings.first_step or 0.0,
            "max_num_steps": UNLIMITED,
        }
        # It warns that a pattern's own differences give way to the function of a Jacobian.
        with UNWARNED:
            self.library = library(self._residual(field) if self.implicit else field, **options)

    # The library calls an inner function, which is made once: to look methods up by way of the
    # object at each call costs a short run a hundredth of its time or two.
    def _counted(self, rates: Rates) -> Rates:
        """The rates, counted, which end the run from within where a limit is reached."""

        def field(t: float, y: np.ndarray, out: np.ndarray) -> None:
            self.calls += 1
            record = self.record
            if record and self.may_end:
                # At every call, as one call may take seconds; to look at the clock takes 0.1 µs.
                if record.expired:
                    raise _StoppedError(Status.TIME_LIMIT, f"stopped at t = {t!r}")
                if self.calls % self.look == 0:
                    self._look(record, t)
            rates(t, y, out)

        return field

    def _first_seen(self, jacobian: Callable[..., None]) -> Callable[..., None]:
        """The Jacobian's function, which notes that there was a Jacobian.

        A run by the sparse linear solver that ends before its first factorization crashes the process:
        the library frees a factorization that it has not made. The first one follows the first Jacobian
        at once.
        """

        # The library reads the number of arguments.
        @wraps(jacobian)
        def noted(*arguments: Any) -> None:
            jacobian(*arguments)
            self.may_end = True

        return noted

    def _residual(self, field: Rates) -> Callable[..., None]:
        """The residual of the equations at a state and its slope, ``mass * slope - rates``."""

        def residual(t: float, y: np.ndarray, slope: np.ndarray, out: np.ndarray) -> None:
            field(t, y, out)
            np.subtract(times(self.mass, slope), out, out=out)

        return residual

    def _exact_jacobian(self, problem: Problem, values: np.ndarray) -> Callable[..., None]:
        """The function of the Jacobian by automatic differentiation, with the library's arguments."""
        jacobian = exact_jacobian(problem.field, problem.dimension, len(values))
        mass = full(self.mass)

        def of_field(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
            out[:] = jacobian(y, values)

        # d residual / dy + cj d residual / dy'.
        def of_residual(
            t: float, y: np.ndarray, slope: np.ndarray, residual: Any, cj: float, out: np.ndarray
        ) -> None:
            out[:] = cj * mass - jacobian(y, values)

        return of_residual if self.implicit else of_field

    def start(self, record: Record) -> tuple[np.ndarray, ...]:
        """The start of a run: the state, and for IDA the slope besides."""
        if not self.implicit:
            return (record.start,)
        time = float(record.times[0])
        if self.mass.ndim == 2:
            return consistent(self.rates, self.mass, time, record.start)
        rates = np.empty(len(record.start))
        self.rates(time, record.start, rates)
        # The slope of an algebraic component is found by the library.
        slope = np.zeros(len(rates))
        np.divide(rates, self.mass, out=slope, where=self.mass > 0)
        return record.start, slope

    def run(self, record: Record, every: bool) -> Outcome:
        """Fill the record's rows, row by row or by every step, which costs more and counts them."""
        self.record = record
        self.calls = 0
        self.last_seen = -np.inf
        self.may_end = not self.sparse
        record.now = float(record.times[0])
        for parameters in self.parameters:
            change(parameters, len(parameters), record)
        # The wrapper prints the library's errors, NumPy warns of what becomes infinite.
        with quiet(), np.errstate(all="ignore"):
            try:
                record.rows[0] = self.library.init_step(record.times[0], *self.start(record)).y
            except _StoppedError as stopped:
                return stopped.args
            except RuntimeError as error:
                return Status.STEP_UNDERFLOW, f"no consistent initial values: {error}"
            try:
                if every:
                    return self._by_steps(record)
                self._rows(record, len(record.times))
                return Status.REACHED_END, ""
            except _StoppedError as stopped:
                return stopped.args
            except ArithmeticError as error:
                return Status.NON_FINITE, str(error)

    def _look(self, record: Record, time: float) -> None:
        """End a run from within its right-hand side where the time stands still or hardly moves."""
        record.now = time
        if time == self.last_seen:
            raise _StoppedError(Status.STEP_UNDERFLOW, f"stalled at t = {time!r}")
        self.last_seen = time
        if crawling := record.crawls(self.calls, time):
            raise _StoppedError(*crawling)

    def _to(self, time: float, record: Record, method: str = "normal") -> Any:
        """The library's own result of going on to a time, or with "onestep" by one step towards it."""
        result = self.library.step(time, method=method, tstop=float(record.times[-1]))
        record.work.jacobians = result.njev
        if not result.success:
            # Any failure that has no name is what a field that is not finite leads to.
            status, _ = FAILURES.get(result.status, (Status.NON_FINITE, ""))
            raise _StoppedError(status, result.message)
        return result

    def _between(self, time: float) -> np.ndarray:
        """The state within the last step, shape (d,)."""
        assert self.record is not None, "a run is under way"
        return self._to(time, self.record).y

    def _rows(self, record: Record, last: int) -> None:
        """Fill rows up to one, that one left out."""
        for time in record.times[record.filled : last].tolist():
            record.put(self._to(time, record).y[None])

    def _by_steps(self, record: Record) -> Outcome:
        """Fill all rows step by step, look for events at each step, and mind the limit of steps."""
        times = record.times
        work = record.work
        end = float(record.times[-1])
        steps = 0
        reached = float(times[0])
        while True:
            # The first step is guessed from the first requested time.
            result = self._to(end if steps else times[1], record, "onestep")
            # After an interpolation the library first hands back the step it has.
            advanced = result.t > reached
            steps = steps + advanced
            reached = result.t
            work.steps = steps
            ended = advanced and record.looked_through((reached,), (result.y,), self._between)
            last = int(np.searchsorted(times, reached, side="right"))
            self._rows(record, min(last, record.last_requested))
            if ended or result.t >= end:
                return Status.REACHED_END, ""
            if steps >= record.max_steps:
                return Status.STEP_LIMIT, f"{steps} steps"

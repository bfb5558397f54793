"""Runs in extended precision, from the problem's own doubles."""

from math import inf

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.contract import Record
from polhode.solvers.taylor import Bound, Precision

Run = tuple[Precision, float]

# Runs that show what rounding of a start makes of a reference, and runs back over it.
ROUNDING_RUN: Run = ("long double", 1e-17)
# Steps after which a run is given up, of equations in slow time and of all others: minutes of work.
MOST_SLOW_STEPS, MOST_STEPS = 200_000, 50_000_000


class ReferenceFailedError(RuntimeError):
    """There is no reference; `status` is that of the run that failed, empty if none did."""

    def __init__(self, message: str, status: str = "") -> None:
        super().__init__(message)
        self.status = status


def extended_run(
    problem: Problem,
    times: np.ndarray,
    precision: Precision,
    tolerance: float,
    deadline: float = inf,
    *,
    units: np.ndarray | None = None,
    max_step: float = inf,
) -> np.ndarray:
    """States in long double, shape (n, d), of a Taylor run in a precision that holds at least as much."""
    # Given up at a deadline, as `time.perf_counter` reads.
    bound = Bound(problem, tolerance, precision, units, max_step)
    number = bound.integrator.state.dtype
    rows = np.empty((len(times), problem.dimension), dtype=number)
    rows[0] = np.array(problem.start).astype(number)
    most = MOST_STEPS if problem.time_unit == 1 else MOST_SLOW_STEPS
    status, message = bound.propagate(Record(times, rows, deadline, most))
    if not status.success:
        raise ReferenceFailedError(
            f"the reference of form {problem.name!r} ended with {status}: {message}", status
        )
    if rows.dtype == np.longdouble:
        return rows
    # NumPy knows no cast from quadruple: it goes by two doubles.
    high = rows.astype(float)
    return high.astype(np.longdouble) + (rows - high.astype(rows.dtype)).astype(float)

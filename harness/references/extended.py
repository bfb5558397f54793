"""Runs in extended precision, from the problem's own doubles; without heyoka unlike runs in double precision."""

from math import inf
from time import perf_counter

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.catalogue import first_available, solver as find_solver
from polhode.solvers.contract import Record
from polhode.solvers.parameter_table import with_parameter_table
from polhode.solvers.solve import solve
from polhode.solvers.taylor import Bound, Precision, extends_precision

# A run of a reference: its precision and its tolerance.
Run = tuple[Precision, float]

# Runs that show what rounding of a start makes of a reference, and runs back over it: a tolerance far below an
# ulp of double precision, 2.2e-16.
ROUNDING_RUN: Run = ("long double", 1e-17)
# Steps after which a run is given up, of equations in slow time t₂ = t/St and of all others: minutes of work.
# Both are estimates.
_MAX_SLOW_STEPS = 200_000
_MAX_STEPS = 50_000_000
# Without heyoka two unlike methods stand for the runs in extended precision. The kinds are tried in this order
# until two reach the end: Runge-Kutta pairs, Adams' multistep formulas, collocation, backward differences.
_UNLIKE = (
    ("cyrk-vern8", "dop853"),
    ("cvode-adams", "cyrk-lsoda", "lsoda"),
    ("radau", "cyrk-radau"),
    ("cvode-bdf", "cyrk-bdf", "bdf"),
)
# Their tolerances, by solver, and of all other solvers. They are estimates near rounding: tighter ones cost
# steps without accuracy, looser ones make the uncertainty larger.
_UNLIKE_TOLERANCES = {"cyrk-vern8": 1e-14, "radau": 1e-12, "cyrk-radau": 1e-12}
_UNLIKE_TOLERANCE = 1e-13
# Steps after which an unlike run is given up; an estimate.
_MAX_UNLIKE_STEPS = 10_000_000


class ReferenceFailedError(RuntimeError):
    """There is no reference; `status` is the status of the failed run, empty if none failed."""

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
    """States in long double, shape (n, d), of a Taylor run in a precision that holds at least as much.

    Parameters
    ----------
    problem : Problem
    times : numpy.ndarray
        Shape (n,); the run starts at the first of them, and may go backwards.
    precision, tolerance
        Of the run, as `polhode.solvers.taylor.Bound` takes them.
    deadline : float
        When the run is given up, as `time.perf_counter` reads.
    units : numpy.ndarray, optional
        Sizes of the components, shape (d,), as `polhode.solvers.taylor.Bound` takes them.
    max_step : float
        Largest step, in the problem's own time.

    Raises
    ------
    ReferenceFailedError
        If the run does not reach the last time.
    """
    bound = Bound(problem, tolerance, precision, units, max_step)
    dtype = bound.integrator.state.dtype
    rows = np.empty((len(times), problem.dimension), dtype=dtype)
    rows[0] = np.array(problem.start).astype(dtype)
    # Slow time has the unit St.
    max_steps = _MAX_STEPS if problem.time_unit == 1 else _MAX_SLOW_STEPS
    integrate = bound.propagate
    if problem.parameter_table is not None:
        # The run stops where parameters change, and goes on with the new ones.
        integrate = with_parameter_table(integrate, problem)
    status, message = integrate(Record(times, rows, deadline, max_steps))
    if not status.success:
        raise ReferenceFailedError(
            f"the reference of form {problem.name!r} ended with {status}: {message}", status
        )
    if rows.dtype == np.longdouble:
        return rows
    # NumPy knows no cast from quadruple to long double: it goes by the sum of two doubles.
    high = rows.astype(float)
    low = (rows - high.astype(dtype)).astype(float)
    return high.astype(np.longdouble) + low


def unlike_runs(
    problem: Problem, times: np.ndarray, deadline: float = inf
) -> dict[str, np.ndarray]:
    """States, shape (n, d), by two unlike methods in double precision, each under its solver's name.

    `times`, shape (n,), begin at 0. `deadline` is as `time.perf_counter` reads. Raises
    ReferenceFailedError if fewer than two of the available methods reach the end before it.
    """
    runs: dict[str, np.ndarray] = {}
    failures: list[str] = []
    for kind in _UNLIKE:
        name = first_available(*kind)
        method = find_solver(name)
        if not (method.available and method.takes(problem)):
            continue
        tolerance = _UNLIKE_TOLERANCES.get(name, _UNLIKE_TOLERANCE)
        seconds_left = deadline - perf_counter()
        if seconds_left <= 0:
            break
        solution = solve(
            problem, name, tolerance, times, max_seconds=seconds_left, max_steps=_MAX_UNLIKE_STEPS
        )
        if not solution.success:
            failures.append(f"{name} ended with {solution.status}")
            continue
        runs[name] = solution.states
        if len(runs) == 2:
            return runs
    reasons = "; ".join(failures) or "no others are installed"
    raise ReferenceFailedError(
        f"there is no extended precision here, and {len(runs)} of two unlike methods solve {problem.name!r}: {reasons}"
    )


def reference_runs(
    problem: Problem, times: np.ndarray, runs: tuple[Run, Run]
) -> tuple[np.ndarray, np.ndarray]:
    """States of a tight and of a loose run, shape (n, d) each, from whose difference the uncertainty follows.

    Taylor runs in extended precision, or without heyoka the runs of `unlike_runs`.
    """
    if extends_precision():
        tight, loose = (extended_run(problem, times, *run) for run in runs)
    else:
        tight, loose = unlike_runs(problem, times).values()
    return tight, loose

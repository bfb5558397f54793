"""A solution between its rows, and what `scipy.integrate.solve_ivp` calls the parts of one."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import as_it_stands, frozen

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Methods that fill in between rows of solvers that choose steps over many periods; the first
# available one serves.
_BETWEEN = ("cyrk-dop853", "dop853")


class LikeSolveIvp:
    """The names of `solve_ivp`'s result.

    Counts that the library does not report, or that were not requested, are None.
    """

    t = property(attrgetter("times"), doc="Times, shape (n,).")
    y = property(attrgetter("states.T"), doc="States, shape (d, n).")
    success = property(attrgetter("status.success"), doc="Whether the run reached its end.")
    nfev = property(attrgetter("work.rhs_calls"), doc="Evaluations of the right-hand side.")
    njev = property(attrgetter("work.jacobians"), doc="Evaluations of the Jacobian.")

    def sol(self: Any, t: "ArrayLike") -> np.ndarray:
        """States at t, shape (d,) of a number and (d, k) of k times."""
        y = self(t).y
        return y if np.ndim(t) else y[:, 0]


def times_within(solution: Any, t: "ArrayLike") -> np.ndarray:
    """Requested times of a solution as an array, shape (k,).

    ValueError unless they are numbers within it; the message quotes 60 characters of them.
    `solution` is a `polhode.solvers.solve.Solution` here and below.
    """
    rows = solution.times
    times = np.empty((0, 0))
    with suppress(TypeError, ValueError):
        times = np.atleast_1d(np.asarray(t, dtype=float))
    if times.ndim > 1:
        raise ValueError(f"t: got {t!r:.60}, expected a number or an array of one dimension")
    if not len(rows):
        raise ValueError(
            f"t: got {times!r:.60}, expected a solution with rows, not one that is {solution.status}"
        )
    outside = times[~((times >= rows[0]) & (times <= rows[-1]))]
    if len(outside):
        raise ValueError(
            f"t: got {float(outside[0])!r}, expected times from {rows[0]:g} to {rows[-1]:g}"
        )
    return times


def _of_components(tolerance: Any, problem: Any) -> Any:
    """A tolerance as a user gives it, without the entry of a time in the state."""
    return tolerance[: problem.dimension - problem.timed] if np.ndim(tolerance) else tolerance


def states_at(solution: Any, times: np.ndarray, run: Callable[..., Any]) -> np.ndarray:
    """States at any times of a run, shape (k, d).

    The run's own solver and tolerance lead from the last row before each time. Such states lie on
    the solver's own interpolation within its own steps, and have one step's error more than the
    row. If a run has segments with problems of their own, the exact problem serves; solvers that
    choose their step over many periods leave this to an explicit Runge-Kutta method of order 8.
    ValueError if the solver fails between two rows, or if a function of one's own computes
    something else by now. `run` is `polhode.solvers.solve.solve`, whose module imports this one.
    """
    row_times = solution.times
    settings = solution.settings
    problem = solution.problem
    if as_it_stands(problem).field != problem.field:
        raise ValueError(
            "t: the function names values that have changed since the run, expected those of the run"
        )
    if solution.method.closed_form and problem.closed_form:
        return problem.closed_form(times)
    # Nor is it traced again for every row.
    problem = frozen(problem)
    method = solution.method
    options: dict[str, Any] = {"atol": _of_components(settings.atol, problem)}
    if method.many_periods:
        method = find_solver(next(name for name in _BETWEEN if find_solver(name).available))
    else:
        options["backend"] = settings.backend
    if "max_step" in method.limits:
        options["max_step"] = settings.max_step
    if method.jacobians:
        options["jacobian"] = settings.jacobian
    rtol = _of_components(settings.rtol, problem)
    # The last row before each time; its state stands where the time is the row's.
    rows = np.searchsorted(row_times, times, side="right") - 1
    states = solution.states[rows]
    for row in np.unique(rows[times > row_times[rows]]).tolist():
        within = (rows == row) & (times > row_times[row])
        # Times since the row, increasing and each once; `order` leads back to those requested.
        since, order = np.unique(times[within] - row_times[row], return_inverse=True)
        start = tuple(solution.states[row].tolist())
        segment = problem.continued(float(row_times[row]), start, float(since[-1]))
        segment = replace(segment, least_steps=0, invariant=None, next_segment=None)
        continued = run(
            segment, method, rtol, np.concatenate([[0.0], since]), doubt=False, **options
        )
        if not continued.success:
            raise ValueError(
                f"t: no solution after t = {row_times[row]:g}: "
                f"{continued.status}. {continued.message}".strip()
            )
        states[within] = continued.states[1:][order]
    return states

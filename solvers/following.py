"""A solution with rows where the steps of its solver lie: the path of a run, beforehand."""

from contextlib import suppress

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.problem import Problem
from polhode.solvers import cyrk
from polhode.solvers.catalogue import solver
from polhode.solvers.compile import array_callback, parameter_array
from polhode.solvers.contract import installed

# Steps after which SciPy's path ends, as `_MOST_STEPS` in `cyrk` for CyRK's: both change together. An estimate:
# averaged equations take far fewer, and where they do not, averaging breaks down.
_MAX_STEPS = 2000


def followed(problem: Problem, tolerance: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """About `points` times of a solution, and the states there, shapes (n,) and (n, d).

    Times are dense where the solver's steps are, as `cyrk.spread_over` says. They end where the
    solution does, or after `_MAX_STEPS` steps. The start alone is given if the solution cannot begin, or
    if CyRK's second run, at the chosen times, fails. `tolerance` is relative and absolute, of a step. The
    solver is CyRK's method of order 7, or SciPy's of order 8 where CyRK or llvmlite is missing.
    """
    if solver("cyrk-vern7").available:
        return cyrk.followed(problem, tolerance, points)
    return _followed_by_scipy(problem, tolerance, points)


def _followed_by_scipy(
    problem: Problem, tolerance: float, points: int
) -> tuple[np.ndarray, np.ndarray]:
    with IMPORTS:
        from scipy.integrate import DOP853, OdeSolution

    # "numba" is machine code that Python calls; llvmlite makes it.
    backend = "numba" if installed("llvmlite") else "python"
    callback, values = array_callback(problem, backend, parameter_array(problem))

    def rates(time: float, state: np.ndarray) -> np.ndarray:
        out = np.empty_like(state)
        callback(state, values, out)
        return out

    start = np.array(problem.start)
    times = [0.0]
    interpolants = []
    # A rate that overflows or has no value ends the path; NumPy need not say so.
    with np.errstate(all="ignore"), suppress(ArithmeticError):
        if np.isfinite(rates(0.0, start)).all():
            stepper = DOP853(rates, 0.0, start, problem.end, rtol=tolerance, atol=tolerance)
            while stepper.status == "running" and len(interpolants) < _MAX_STEPS:
                stepper.step()
                if stepper.status == "failed" or not np.isfinite(stepper.y).all():
                    break
                # The step's interpolant takes further rates, which may fail.
                interpolants.append(stepper.dense_output())
                times.append(float(stepper.t))
    if not interpolants:
        # The start is the only row.
        return np.zeros(1), start[None]
    with np.errstate(all="ignore"):
        steps = np.array(times)
        sampled = cyrk.spread_over(steps, points)
        return sampled, OdeSolution(steps, interpolants)(sampled).T

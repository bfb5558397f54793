"""Particles one after another by a solver of the catalogue, where no library runs many at once.

That is so along tracks, too.
"""

from dataclasses import replace

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.catalogue import available_like
from polhode.solvers.contract import Status
from polhode.solvers.solve import solve

# Steps after which a particle is given up. An estimate: ten seconds or more of compiled code, far more of Python.
_MAX_STEPS = 10_000_000


def run_one_by_one(
    problem: Problem, starts: np.ndarray, times: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Solve a problem from starts, shape (n, d): states, shape (m, n, d), and statuses.

    Times ascend from 0, shape (m,). States are NaN behind the last time that a particle reached; of a particle
    whose status is `false_success` they are all given. Errors raised are those of `solve`.

    The tolerance is relative and absolute, of a step of Verner's method of order 8 or what is installed in its
    place.
    """
    method = available_like("cyrk-vern8")
    states = np.full((len(times), *starts.shape), np.nan)
    statuses = np.array([str(Status.REACHED_END)], dtype=object).repeat(len(starts))
    for i, start in enumerate(starts.tolist()):
        run = solve(
            replace(problem, start=tuple(start)), method, tolerance, times, max_steps=_MAX_STEPS
        )
        states[: len(run.states), i] = run.states
        statuses[i] = str(run.status)
    return states, statuses

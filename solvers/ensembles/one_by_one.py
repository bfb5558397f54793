"""Particles one after another by any solver: for problems whose runs differ from particle to particle."""

from dataclasses import replace

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.solve import solve


def run_one_by_one(
    problem: Problem, starts: np.ndarray, times: np.ndarray, solver: str, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Solve from many starts, shape (n, d): states, shape (m, n, d), NaN where one failed, and statuses."""
    states = np.full((len(times), *starts.shape), np.nan)
    statuses = np.empty(len(starts), dtype=object)
    for i, start in enumerate(starts.tolist()):
        found = solve(replace(problem, start=tuple(start)), solver, tolerance, times)
        statuses[i] = str(found.status)
        if found.status.success:
            states[:, i] = found.states
    return states, statuses

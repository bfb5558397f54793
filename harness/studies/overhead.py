"""What `solve` costs over the bare library call: both run in turns, each with everything ready.

The bare call, `Solver.bare_call`, is the shortest that a user of the library would write for the same rows with the
same callbacks: `propagate_grid`, `solve_ivp(…, t_eval=…)`, ``CVODE(…).solve(times, …)``, CyRK's C entry.
"""

from dataclasses import dataclass
from math import inf
from time import perf_counter

import numpy as np

from polhode.harness.common.timing import seconds_of
from polhode.models.catalogue import form
from polhode.models.problem import Problem
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.solve import solve

# What is allowed: a share of the bare call or a time in seconds, whichever is more.
ALLOWED_SHARE = 0.05
ALLOWED_SECONDS = 50e-6


@dataclass(frozen=True)
class Overhead:
    """Minima, in seconds, of a bare library call and of `solve` for the same rows."""

    solver: str
    bare: float
    solve: float

    @property
    def seconds(self) -> float:
        """What `solve` costs on top."""
        return self.solve - self.bare

    @property
    def allowed(self) -> bool:
        """Whether that is at most 5 % or 50 µs."""
        return self.seconds <= max(ALLOWED_SHARE * self.bare, ALLOWED_SECONDS)


def paper_problem() -> Problem:
    """The paper's ellipsoid at St = 1e3, 500 units of time, quaternion form."""
    return form("quaternion").problem(named_scene("paper"))


def measure(
    problem: Problem,
    tolerance: float = 1e-8,
    solvers: tuple[str, ...] = tuple(name for name in SOLVERS if name != "exact"),
    samples: int = 201,
    seconds: float = 1.0,
) -> list[Overhead]:
    """Measure the overhead of solvers, about `seconds` for each: bare call and `solve` in turns, the minimum of each.

    Solvers that are not installed, or whose bare call is not known, are left out.
    """
    times = np.linspace(0.0, problem.end, samples)
    table = []
    for name in solvers:
        method = find_solver(name)
        bare = method.bare_call(problem, method.settings(tolerance), times) if method.available else None
        if bare is None:
            continue
        best, calls = [inf, inf], (bare, lambda name=name: solve(problem, name, tolerance, times))
        for call in calls:
            call()
        end = perf_counter() + seconds
        while perf_counter() < end or best[1] == inf:
            best = [min(before, seconds_of(call)) for before, call in zip(best, calls, strict=True)]
        table.append(Overhead(name, *best))
    return table

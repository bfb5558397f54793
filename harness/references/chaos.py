"""Chaos: how fast neighbouring solutions part, from the variational equations, and what that leaves to compare.

The tangent v is the small difference of two neighbouring solutions y: v̇ = (∂f/∂y) v along ẏ = f. |v| grows
like a power of time if the motion is regular, and exponentially if it is chaotic.
"""

from dataclasses import dataclass, replace
from math import inf, log
from typing import Any

import numpy as np

from polhode.models.libraries import installed
from polhode.models.once import OncePerThread
from polhode.models.problem import Factory, Problem
from polhode.solvers.catalogue import first_available
from polhode.solvers.compile import load_heyoka, parameter_array, tangent_system
from polhode.solvers.solve import solve

# Tolerance of the tangent's integrator, and of the runs of two neighbours. Both are estimates: growth by
# factors needs few digits, but the distance of neighbours is small beside their states.
_TIGHT_TOLERANCE = 1e-12
_NEIGHBOUR_TOLERANCE = _TIGHT_TOLERANCE / 100
# Intervals of a run. After each of them the tangent is brought back to unit length, and its growth written
# down. An estimate: the time at which errors become meaningless is known to one interval.
_INTERVALS = 400
# In the second half of a run algebraic growth, as a phase error has it, makes at most a few factors of two.
# Growth beyond this natural logarithm, a factor of 150, is exponential. An estimate.
_EXPONENTIAL = 5.0
# Trajectories are meaningless once an error has grown to this, in rad. An estimate: growth is exponential, so
# that with half of it the time is hardly shorter.
_MEANINGLESS = 1e-2
# Half the distance of neighbouring numbers of size 1: no run in double precision errs by less.
_HALF_ULP = 1e-16
# Distance of two neighbouring solutions: their growth follows the linear equations to 1e-7, rounding errs by 1e-8.
_NEIGHBOUR = 1e-7


@dataclass(frozen=True)
class Growth:
    """Growth of a small difference v along a solution."""

    times: np.ndarray  # from 0 on, in the problem's own time, shape (n,)
    logarithm: np.ndarray  # ln |v(t)|/|v(0)|, shape (n,)

    @property
    def exponent(self) -> float:
        """Lyapunov exponent over the second half of the run, by least squares, per unit of the problem's time."""
        half = len(self.times) // 2
        return float(np.polyfit(self.times[half:], self.logarithm[half:], 1)[0])

    @property
    def chaotic(self) -> bool:
        """Whether the growth over the second half of the run is more than algebraic."""
        return self.exponent * (self.times[-1] - self.times[len(self.times) // 2]) > _EXPONENTIAL

    def meaningful_until(self, error: float = _HALF_ULP) -> float:
        """Time at which an error, made at the worst moment, has grown to `_MEANINGLESS`; inf if never."""
        amplified = self.logarithm - np.minimum.accumulate(self.logarithm)
        beyond = np.flatnonzero(amplified > log(_MEANINGLESS / error))
        return float(self.times[beyond[0]]) if len(beyond) else inf


def growth(problem: Problem, intervals: int = _INTERVALS) -> Growth:
    """Growth along a solution, by the variational equations ẏ = f, v̇ = (∂f/∂y) v, in equal intervals.

    v starts in a generic direction, cos 1, cos 2, …, of which no component vanishes, and is renormalised
    after each interval (Benettin et al., Meccanica 15 (1980) 9). Raises ValueError if an integration fails.
    """
    if not installed("heyoka") or problem.parameter_table is not None:
        return _growth_of_neighbours(problem, intervals)
    times = np.linspace(0.0, problem.end, intervals + 1)
    parameters = parameter_array(problem)
    direction = np.cos(np.arange(1.0, problem.dimension + 1))
    integrator = tangent_integrator(problem.field, problem.dimension, len(parameters))
    integrator.time = 0.0
    integrator.state[:] = [*problem.start, *(direction / np.linalg.norm(direction))]
    integrator.pars[:] = parameters
    logarithm = np.zeros(intervals + 1)
    for i, time in enumerate(times[1:], 1):
        outcome = integrator.propagate_until(time)[0]
        if outcome != load_heyoka().taylor_outcome.time_limit:
            raise ValueError(
                f"form {problem.name!r}: the variational equations ended with {outcome} at t = {time:g}"
            )
        tangent = integrator.state[problem.dimension :]
        length = float(np.linalg.norm(tangent))
        tangent /= length
        logarithm[i] = logarithm[i - 1] + log(length)
    return Growth(times, logarithm)


def _growth_of_neighbours(problem: Problem, intervals: int) -> Growth:
    """Growth of the distance of two neighbouring solutions, brought back to `_NEIGHBOUR` after each interval.

    It stands in where heyoka is missing, or where the flow changes along a track.
    """
    times = np.linspace(0.0, problem.end, intervals + 1)
    method = first_available("cyrk-vern8", "dop853")
    state = np.array(problem.start)
    direction = np.cos(np.arange(1.0, problem.dimension + 1))
    if problem.timed:
        # Neighbours have the same time.
        direction[-1] = 0.0
    direction /= np.linalg.norm(direction)
    logarithm = np.zeros(intervals + 1)
    for i in range(intervals):
        duration = float(times[i + 1] - times[i])
        ends = []
        for start in (state, state + _NEIGHBOUR * direction):
            segment = replace(problem, start=tuple(start.tolist()), end=duration)
            run = solve(segment, method, _NEIGHBOUR_TOLERANCE)
            if not run.success:
                raise ValueError(
                    f"form {problem.name!r}: a neighbour's run ended with {run.status} after t = {times[i]:g}"
                )
            ends.append(run.states[-1])
        state, neighbour = ends
        difference = (neighbour - state) / _NEIGHBOUR
        length = float(np.linalg.norm(difference))
        direction = difference / length
        logarithm[i + 1] = logarithm[i] + log(length)
    return Growth(times, logarithm)


@OncePerThread
def tangent_integrator(factory: Factory, dimension: int, parameters: int) -> Any:
    """Integrator of a field, with these numbers of variables and parameters, and of a tangent."""
    system = tangent_system(factory, dimension, parameters)
    return load_heyoka().taylor_adaptive(
        system, [0.0] * len(system), tol=_TIGHT_TOLERANCE, compact_mode=True
    )

"""Chaos: how fast neighbouring solutions part, and until when trajectories mean anything.

The tangent v is the small difference of two neighbouring solutions y. It obeys the variational
equations v̇ = (∂f/∂y) v along ẏ = f. |v| grows like a power of time if the motion is regular, and
exponentially if it is chaotic.
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
# factors needs few digits. The second one is 1e-7 of the neighbours' distance (`_NEIGHBOUR`).
_TIGHT_TOLERANCE = 1e-12
_NEIGHBOUR_TOLERANCE = _TIGHT_TOLERANCE / 100
# Intervals of a run. After each of them the tangent is brought back to unit length, and its growth written
# down. An estimate: the time at which errors become meaningless is known to one interval.
_INTERVALS = 400
# Largest ln of the growth over the second half of a run that counts as regular: a factor of 150. Algebraic
# growth, as a phase error has it, makes a few factors of two there. An estimate between the two.
_EXPONENTIAL = 5.0
# Trajectories are meaningless once an error has grown to this, in rad or in the state's own units. An
# estimate. Growth is exponential: for half of this number the time is hardly shorter.
_MEANINGLESS = 1e-2
# Half the distance of neighbouring numbers of size 1: no run in double precision errs by less.
_HALF_ULP = 1e-16
# Distance of two neighbouring solutions, in the state's units. Their growth follows the linear equations to
# 1e-7, as the terms left out have its square. Rounding, over this distance, errs by about 1e-8.
_NEIGHBOUR = 1e-7


@dataclass(frozen=True)
class Growth:
    """Growth of the tangent v along a solution, in the Euclidean norm of all components."""

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
        """Time at which an error, made at the worst moment, has grown to `_MEANINGLESS`; inf if never.

        `error` has the units of `_MEANINGLESS`.
        """
        # Growth since the earlier time from which it is largest.
        amplified = self.logarithm - np.minimum.accumulate(self.logarithm)
        beyond = np.flatnonzero(amplified > log(_MEANINGLESS / error))
        return float(self.times[beyond[0]]) if len(beyond) else inf


def growth(problem: Problem, intervals: int = _INTERVALS) -> Growth:
    """Growth along a solution in equal intervals, by the variational equations.

    Without heyoka, or where the flow changes along a track, two neighbouring solutions stand in for them.
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
        # "time_limit" is heyoka's word for a run that reached its end.
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
    """Growth of the distance of two neighbouring solutions, brought back to `_NEIGHBOUR` after each interval."""
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
    """heyoka's integrator of a field and a tangent, with these numbers of variables and parameters.

    Its state has the variables, then the tangent: length 2 `dimension`.
    """
    # Compact mode compiles in less time, and the code is a little slower.
    system = tangent_system(factory, dimension, parameters)
    return load_heyoka().taylor_adaptive(
        system, [0.0] * len(system), tol=_TIGHT_TOLERANCE, compact_mode=True
    )

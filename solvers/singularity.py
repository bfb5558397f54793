"""Whether a run that claims success has stepped over the end of its solution.

A step can land beyond the place of an infinite rate: a multistep method then goes on with states of
1e20, an explicit one chatters about the place. Three signs cost next to nothing to look for: a
denominator of the field changes its sign between two rows, a state grows a hundredfold between two
rows, or steps shrink while a run is under way. They are no proof: a quotient may have a limit. So
that segment is run again by Radau IIA, which finds no step there, and by an explicit method.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from polhode.models.own_function import MAX_EXACT_JACOBIAN, OwnField
from polhode.models.problem import Problem
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import denominators, frozen
from polhode.solvers.contract import Status

# The estimates here decide which runs are examined, and how long that takes. A run is called false
# only if all witnesses fail.
#
# Segments between two rows that are run again, at most; by estimate.
_MAX_SEGMENTS = 3
# Growth of the largest component from one row to the next that is looked into; by estimate.
_GROWTH = 100.0
# Radau IIA of CyRK, or of SciPy where that is not installed.
_RADAU = ("cyrk-radau", "radau")
# Witnesses that run a segment again: the first of the names that takes the problem, and the factor
# of its tolerance. All must fail: the implicit ones by a status of `_ENDED`, the explicit one by
# any. The factor is an estimate.
_WITNESSES = ((_RADAU, 1.0), (_RADAU, 1e-3), (("cyrk-dop853", "dop853"), 1e-3))
# Range of the witnesses' tolerances, to which the run's own is clipped before the factor applies; by
# estimate.
_TOLERANCES = (1e-8, 1e-4)
# Steps of a witness, by estimate. An implicit one that takes more says nothing: the run stands.
_MAX_STEPS = 20_000
# A witness may take this long, in seconds, or as long as the run itself if that is longer; by estimate. An
# implicit one that takes longer says nothing.
_LEAST_SECONDS = 0.5
# Statuses of a witness that finds no solution.
_ENDED = (Status.STEP_UNDERFLOW, Status.NON_FINITE)


def jumped(solution: Any, run: Callable[..., Any], *, shrunk: bool) -> str | None:
    """In words, how a run of a user's function stepped over the end of its solution; else None.

    `solution` and `run` are `Solution` and `solve` of `polhode.solvers.solve`, which imports this
    module; `shrunk` says that steps became much shorter on the way.
    """
    problem = solution.problem
    if not isinstance(problem.field, OwnField) or len(solution.times) < 2:
        return None
    if problem.dimension > MAX_EXACT_JACOBIAN:
        # The witness's Jacobian is a full matrix.
        return None
    rows = _suspects(problem, solution.states)
    if not rows and shrunk:
        rows = [0]
    for row in rows[:_MAX_SEGMENTS]:
        last = len(solution.times) - 1 if shrunk else row + 1
        if ended := _ended(solution, row, last, run):
            return f"{ended} between t = {solution.times[row]:g} and {solution.times[last]:g}"
    return None


def _suspects(problem: Problem, states: np.ndarray) -> list[int]:
    """The rows behind which a denominator changes its sign, or the state grows suddenly."""
    suspects = np.zeros(len(states) - 1, dtype=bool)
    divisors = None
    if not problem.plain:
        divisors = denominators(problem.field, problem.dimension, len(problem.field_parameters))
    if divisors:
        function, count = divisors
        parameters = np.array(problem.field_parameters, dtype=float)
        values = np.empty((len(states), count))
        for state, out in zip(np.ascontiguousarray(states), values, strict=True):
            function(state, parameters, out)
        suspects |= (np.sign(values[1:]) * np.sign(values[:-1]) < 0).any(axis=1)
    components = states[:, : problem.dimension - problem.timed]
    spread = components.max() - components.min()
    if divisors is None and spread <= (_GROWTH - 1) * abs(states[0, 0]):
        # No component can have grown by that factor.
        return []
    size = np.abs(components).max(axis=1)
    # A start of 0 says nothing of the size of what comes.
    suspects |= size[1:] > _GROWTH * np.maximum(size[:-1], size[0] or size[1])
    return np.flatnonzero(suspects).tolist()


def _ended(solution: Any, first: int, last: int, run: Callable[..., Any]) -> str:
    """How the witnesses ended between two rows; empty if one of them does not say that the solution ends."""
    problem = frozen(solution.problem)
    settings = solution.settings
    begin = float(solution.times[first])
    end = float(solution.times[last])
    segment = problem.continued(begin, tuple(solution.states[first].tolist()), end - begin)
    size = float(np.abs(solution.states[: first + 1]).max())
    usual = float(np.clip(settings.tolerance, *_TOLERANCES))
    limits = {"max_seconds": max(_LEAST_SECONDS, solution.seconds), "max_steps": _MAX_STEPS}
    words = ""
    for names, factor in _WITNESSES:
        witness = next((name for name in names if _takes(name, segment)), None)
        if witness is None:
            return ""
        tolerance = factor * usual
        absolute = tolerance * size or tolerance
        repeated = run(segment, witness, tolerance, atol=absolute, doubt=False, **limits)
        implicit = repeated.method.implicit
        # One that an explicit method does not finish may be stiff, or have no solution.
        if repeated.success or (implicit and repeated.status not in _ENDED):
            return ""
        if implicit:
            words = f"the solution ends, by {witness}: {repeated.status}"
    return words


def _takes(name: str, problem: Problem) -> bool:
    solver = find_solver(name)
    return solver.available and solver.takes(problem)

"""The loosest tolerance at which a method meets an error, from few runs of the scene itself.

Runs are compared with the tightest of them: a looser one differs from it by about its own error, if
it takes clearly fewer steps. To plan the next run, errors are taken to follow a power of the tolerance.
"""

from collections.abc import Sequence
from math import log
from typing import NamedTuple

from polhode.harness.answers.confirmed import LOOSER, MAX_STRIDE, sharpens
from polhode.harness.answers.fitted import steps_per_turn
from polhode.harness.answers.pace import steps_in
from polhode.harness.answers.rules import LOOSEST, Method, rounded
from polhode.harness.answers.runs import Run, Runner
from polhode.harness.answers.statement import NO_ERROR, difference
from polhode.solvers.contract import Status

# A factor of two in a number called an estimate makes a search take more runs, or end at a tolerance that is
# tighter than it need be.

# Runs of a search, at most. An estimate: more cost more than the tolerance that they find would spare.
_MAX_RUNS = 6
# The largest ratio of tolerances over which errors are taken to be proportional to them. An estimate: a stride by
# `LOOSER` stays within it, though rounding to one digit makes it up to twice as long.
_FAR = 2 * LOOSER
# The largest error that a run may have by its difference, and by proportion, which plans runs too, as shares
# of the one requested: a difference tells the error to some 20 %, proportion to a factor of two. Estimates.
_MOST_SHARE = 0.8
_PLANNED_SHARE = 0.4
# A run of a smaller share is made again at a looser tolerance: at order 8 that spares a quarter of its
# steps. An estimate.
_LEAST_SHARE = 0.1


class Known(NamedTuple):
    """A run, and its own error, about: of L and E over I_max, or in rad."""

    run: Run
    error: float


class Found(NamedTuple):
    """The tolerance that was looked for, and the tightest of all runs that were made."""

    tolerance: float
    error: float  # of a run at this tolerance, about
    steps: float  # of such a run
    made: bool  # whether it was made, or its error and steps follow from those of two other runs
    tightest: Known


def loosest(
    runner: Runner, method: Method, tolerance: float, error: float, want: str, max_steps: int
) -> Found | None:
    """The loosest tolerance that meets an error, from few runs, or the one that comes nearest to it.

    None where nothing is known of errors: a run failed, or the tolerance does not set the steps.

    Parameters
    ----------
    runner : Runner
        Of the scene.
    method : Method
    tolerance : float
        Of the first run.
    error : float
        Of L and E over I_max, or of the orientation in rad, as `want` says.
    want : {"slow", "orientation"}
    max_steps : int
        That a run may take.
    """
    tried: list[float] = []
    runs: list[Run] = []
    found: Found | None = None
    while len(tried) < _MAX_RUNS and tolerance not in tried:
        tried.append(tolerance)
        run = runner.run(method, tolerance, max_steps)
        if run.solution.status is Status.STEP_LIMIT:
            break
        if not run.success:
            # Too loose to come to its end.
            tolerance = rounded(method, min([tolerance, *map(_tolerance, runs)]) / LOOSER)
            continue
        runs.append(run)
        tightest = min(runs, key=_tolerance)
        looser = _errors(runner, runs, tightest, want)
        between = rounded(method, LOOSER * tightest.tolerance)
        if not looser:
            # There is one run alone, or steps hardly changed: then the next run is far tighter.
            if len(runs) == 1 and between not in tried:
                tolerance = between
            else:
                tolerance = rounded(method, tightest.tolerance / LOOSER ** min(2, len(runs)))
            continue
        nearest = min(looser, key=_error)
        power = _power(nearest.run, tightest)
        expected = nearest.error * (tightest.tolerance / nearest.run.tolerance) ** power
        last = Known(tightest, expected)
        # Proportion is believed over few decades, or where a run between them told nothing.
        believed = nearest.run.tolerance <= _FAR * tightest.tolerance or between in tried
        meeting = [known for known in looser if known.error <= _MOST_SHARE * error]
        chosen = max(meeting, key=lambda known: known.run.tolerance, default=nearest)
        if not meeting and believed and expected <= _PLANNED_SHARE * error:
            chosen = last
        found = _made(chosen, last)
        close = _LEAST_SHARE * error <= chosen.error <= _MOST_SHARE * error
        if close or (chosen.error <= error and chosen.run.tolerance >= LOOSEST):
            break
        tolerance = planned(
            method, nearest.run.tolerance, nearest.error, _PLANNED_SHARE * error, power
        )
        near = nearest.run.tolerance <= _FAR * tightest.tolerance
        if near and tightest.tolerance < tolerance < nearest.run.tolerance:
            # Both ends are known: a run between them would tell little more.
            return _between(nearest, last, tolerance, power)
        if tolerance in tried and not believed:
            tolerance = between
    return found


def _made(known: Known, tightest: Known) -> Found:
    """A run that was made."""
    run = known.run
    return Found(run.tolerance, known.error, steps_in(run.solution), True, tightest)


def _between(looser: Known, tighter: Known, tolerance: float, power: float) -> Found:
    """A run at a tolerance between two runs' tolerances; steps are taken to follow a power of it."""
    error = looser.error * (tolerance / looser.run.tolerance) ** power
    many = steps_in(tighter.run.solution)
    few = steps_in(looser.run.solution)
    share = log(tolerance / tighter.run.tolerance) / log(
        looser.run.tolerance / tighter.run.tolerance
    )
    return Found(tolerance, error, many * (few / many) ** share, False, tighter)


def _tolerance(run: Run) -> float:
    return run.tolerance


def _error(known: Known) -> float:
    return known.error


def _errors(runner: Runner, runs: Sequence[Run], tightest: Run, want: str) -> list[Known]:
    """The errors of the runs that take clearly fewer steps than the tightest one: their differences from it."""
    looser = []
    for run in runs:
        if run is tightest:
            continue
        # A solver whose order follows the tolerance takes as many steps at any.
        if run.method.solver.order_by_tolerance or sharpens(tightest, run):
            apart = difference(runner.scene.ellipsoid, run.observables, tightest.observables)
            looser.append(Known(run, apart.largest[want]))
    return looser


def _power(looser: Run, tighter: Run) -> float:
    """The power of the tolerance that errors are taken to follow: 1, less where steps hardly grow.

    The steps of splitting come in few sizes; its error follows them by the power of its order.
    """
    if not looser.method.solver.many_periods:
        return 1.0
    order = steps_per_turn("splitting").order
    return min(
        1.0, order * log(tighter.steps / looser.steps) / log(looser.tolerance / tighter.tolerance)
    )


def planned(
    method: Method, tolerance: float, error: float, wanted: float, power: float = 1.0
) -> float:
    """The tolerance at which a method is planned to have the error wanted, from a run at another one.

    Errors are taken to follow a power of the tolerance, which changes by `MAX_STRIDE` at most.
    """
    stride = (wanted / max(error, NO_ERROR)) ** (1 / power)
    stride = min(MAX_STRIDE, max(1 / MAX_STRIDE, stride))
    return rounded(method, stride * tolerance)

"""A reference solution of a user's own problem, or of a test problem: `reference_of`.

The reference is a tight run, and a looser run gives its uncertainty. Two runs of one method share
its blindness: both step over a short pulse or a kink of the right-hand side. So an unlike method,
the "witness", begins anew at every sample from the reference's states, with a limit on its step
size. If its states differ, two unlike methods make the reference, and a multiple of their difference
is its uncertainty.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from polhode.harness.references.extended import ReferenceFailedError, extended_run
from polhode.harness.references.reference import LONG_DOUBLE, SAFETY
from polhode.models.problem import Problem
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import plain_field
from polhode.solvers.solve import solve
from polhode.solvers.taylor import Bound, extends_precision

# Least number of steps of a whole run by the method that looks for pulses. A pulse that is shorter than a step
# may be stepped over. An estimate: twice as many find pulses half as long, in twice the time.
_LEAST_STEPS = 10_000
# Steps between two samples, after which an explicit method gives way to an implicit one. An estimate: a
# larger limit wastes time on stiff problems, a smaller one leaves more of them to looser witnesses.
_MAX_STEPS = 50_000


class _Witness(NamedTuple):
    """A method that solves the reference's segments again."""

    solvers: tuple[str, ...]  # The first one that is installed runs.
    tolerance: float  # Relative, and absolute over the largest value of each component.
    # Largest deviation from one sample to the next, over a component's size, that confirms the reference.
    allowed: float


class _Pair(NamedTuple):
    """Two unlike methods whose runs stand in where Taylor's method is no reference."""

    # The first of these solvers that is installed gives the reference and a looser run.
    solvers: tuple[str, ...]
    tight: float  # Relative tolerance of the reference.
    loose: float  # Relative tolerance of the looser run.
    # The first of these ones gives a run to compare with.
    unlike_solvers: tuple[str, ...]
    unlike_tolerance: float


# The first witness counts that takes the problem and gets through: explicit methods first, which have the
# tightest tolerance. The allowed deviation is a thousand or ten thousand times the tolerance, as the
# errors of steps add up. Tolerances and allowed deviations are estimates.
_WITNESSES = (
    _Witness(("cyrk-dop853", "dop853"), 1e-12, allowed=1e-9),
    _Witness(("cyrk-radau", "radau"), 1e-9, allowed=1e-6),
    _Witness(("cvode-bdf", "bdf"), 1e-10, allowed=1e-6),
)
# The explicit pair first. Tolerances are estimates. A loose run has a hundred times the tolerance of the
# tight one.
_PAIRS = (
    _Pair(
        ("cyrk-vern8", "dop853"),
        tight=1e-13,
        loose=1e-11,
        unlike_solvers=("cyrk-dop853", "cvode-adams", "lsoda"),
        unlike_tolerance=1e-12,
    ),
    _Pair(
        ("cyrk-radau", "radau"),
        tight=1e-11,
        loose=1e-9,
        unlike_solvers=("cvode-bdf", "bdf"),
        unlike_tolerance=1e-11,
    ),
)
# Absolute over relative tolerance of the pairs' runs, over the size of the start. An estimate: components down
# to a millionth of the start's size are followed by the relative tolerance.
_SMALL = 1e-6
# Error that double precision leaves in a run of n ≈ 2,000 steps, as a tight one without a limit on the step
# takes: √n ulps, with 2.2e-16 for an ulp. It is in the measure of the errors.
_ROUNDING = 1e-14
# Deviation of two unlike runs, in the measure of the errors, up to which they confirm each other. An
# estimate. The uncertainty of runs that differ by more is ten times their deviation (`SAFETY`). A reference
# whose uncertainty is no larger is good enough: no further pair is tried.
_CONFIRMED = 1e-5

# Two unlike runs may err alike: the uncertainty is at least this multiple of their deviation. An estimate, to
# which the stated uncertainty is proportional.
_ALIKE = 3.0
# Beginnings of the names of compiled solvers. Of a pair only they get a limit on the step: its many steps take
# seconds by solvers in Python. Each of the `_PAIRS` has one of them. The witness has the limit by any solver.
_LIMITED = ("cyrk", "cvode")

# The measure of the errors: how far states of shape (n, d) are from reference states of that shape. It is a
# number, such as the largest error over all rows.
Measure = Callable[[np.ndarray, np.ndarray], float]


@dataclass(frozen=True)
class OwnReference:
    """Reference of a problem that is no scene's."""

    states: np.ndarray  # Shape (n, d).
    uncertainty: float  # In the measure of the errors.
    source: str  # The methods that made it and confirmed it, in words.


def reference_of(
    problem: Problem, times: np.ndarray, measure: Measure, max_seconds: float
) -> OwnReference:
    """The reference of a problem.

    Taylor's run in long double is the reference, if a witness confirms it. Else the `_PAIRS` are tried, until
    one is confirmed. If none is, the least uncertain one is the reference.

    Parameters
    ----------
    problem : Problem
    times : numpy.ndarray
        Shape (n,), increasing from 0, in the problem's own time.
    measure : callable
        ``measure(states, reference) -> error``, the measure of the errors.
    max_seconds : float
        Limit of each run, and of all segments of a witness together.

    Raises
    ------
    ReferenceFailedError
        If no method has a reference, with the reasons.
    """
    reasons = []
    try:
        taylor = _by_taylor(problem, times, measure, max_seconds)
    except (ReferenceFailedError, ValueError) as error:
        reasons.append(f"taylor: {error}")
        taylor = None
    if taylor:
        witness, deviation = _witnessed(problem, times, taylor.states, max_seconds)
        if not witness:
            reasons.append("taylor: no other method gets through")
        elif deviation <= 1:
            return replace(taylor, source=f"{taylor.source}, confirmed by {witness}")
        else:
            reasons.append(f"taylor: {witness} contradicts it")
    best = None
    for pair in _PAIRS:
        candidate = _by_pair(problem, times, measure, max_seconds, pair)
        if isinstance(candidate, str):
            reasons.append(candidate)
            continue
        # Explicit methods get through a stiff problem, but far from its solution.
        if best is None or candidate.uncertainty < best.uncertainty:
            best = candidate
        if best.uncertainty <= _CONFIRMED:
            break
    if best:
        return best
    # Algebraic equations have no explicit form, and no parameters of one.
    if problem.mass_form is not None and problem.parameters is None:
        raise ReferenceFailedError(
            f"{problem.name}: no reference for algebraic equations; give reference="
        )
    raise ReferenceFailedError(f"{problem.name}: no reference: {'; '.join(reasons)}")


def _size(problem: Problem) -> float:
    """The largest component of the start, 1 if all are 0. A time as last component does not count."""
    return float(np.abs(problem.start[: problem.dimension - problem.timed]).max(initial=0.0)) or 1.0


def _by_taylor(
    problem: Problem, times: np.ndarray, measure: Measure, max_seconds: float
) -> OwnReference:
    """The reference by Taylor's method in long double, and its uncertainty by a looser run.

    Raises ReferenceFailedError if a run fails, and ValueError if the method does not take the problem.
    """
    taylor = find_solver("taylor")
    if not taylor.available:
        raise ReferenceFailedError(str(taylor.why_not))
    if not extends_precision():
        raise ReferenceFailedError("long double is not x86's of 80 bits here")
    taylor.check(problem)
    # heyoka's tolerance is absolute below 1: in these units it is absolute below the start's size.
    units = np.full(problem.dimension, _size(problem))
    runs = []
    # `LONG_DOUBLE` has the tight run, then the loose one.
    for precision, tolerance in LONG_DOUBLE:
        # Compilation, which is cached, is not the run's time.
        Bound(problem, tolerance, precision, units)
        deadline = perf_counter() + max_seconds
        runs.append(extended_run(problem, times, precision, tolerance, deadline, units=units))
    tight, loose = runs
    return OwnReference(tight, SAFETY * measure(loose, tight), "Taylor's method in long double")


def _first(names: tuple[str, ...], problem: Problem) -> str | None:
    """The first solver that is installed and takes a problem."""
    for name in names:
        solver = find_solver(name)
        if solver.available and solver.takes(problem):
            return name
    return None


def _witnessed(
    problem: Problem, times: np.ndarray, exact: np.ndarray, max_seconds: float
) -> tuple[str, float]:
    """Name of the witness that got through, and its largest deviation over the allowed one.

    ("", inf) if none got through. `exact` has the reference's states, shape (n, d). Deviations are over the
    largest value of their component, or of all components where that is 0.
    """
    # A state's own time, its last component if it has one, is no part of the comparison.
    components = problem.dimension - problem.timed
    states = exact.astype(float)
    size = np.abs(states[:, :components]).max(axis=0)
    size = np.where(size > 0, size, size.max() or 1.0)
    for witness in _WITNESSES:
        name = _first(witness.solvers, problem)
        if name is None:
            continue
        deviation = _segments_deviation(
            problem, name, witness.tolerance, times, states, size, max_seconds
        )
        if deviation is not None:
            return name, deviation / witness.allowed
    return "", inf


def _segments_deviation(
    problem: Problem,
    name: str,
    tolerance: float,
    times: np.ndarray,
    states: np.ndarray,
    size: np.ndarray,
    max_seconds: float,
) -> float | None:
    """Largest deviation of runs that begin anew at every sample and end at the next.

    None if a run fails. `states` has the reference's states, shape (n, d), at `times`, shape (n,). Deviations
    are over `size`, shape (d,) without the time. All runs together may take `max_seconds`.
    """
    deadline = perf_counter() + max_seconds
    components = len(size)
    worst = 0.0
    limits: dict[str, Any] = {"max_step": float(times[-1]) / _LEAST_STEPS, "max_steps": _MAX_STEPS}
    for row, duration in enumerate(np.diff(times).tolist()):
        segment = problem.continued(float(times[row]), tuple(states[row].tolist()), duration)
        if not problem.plain:
            # A recorded function has its time, if it uses one, in the state. With the very same field its
            # machine code is compiled once and not for every segment.
            segment = replace(segment, field=problem.field)
        left = deadline - perf_counter()
        if left <= 0:
            return None
        run = solve(
            segment,
            name,
            tolerance,
            atol=(tolerance * size).tolist(),
            max_seconds=left,
            # A run that stepped over the end of its solution would deviate: no need to look for that.
            doubt=False,
            **limits,
        )
        if not run.success:
            return None
        deviations = np.abs(run.states[-1, :components] - states[row + 1, :components]) / size
        worst = max(worst, float(deviations.max()))
    return worst


def _by_pair(
    problem: Problem, times: np.ndarray, measure: Measure, max_seconds: float, pair: _Pair
) -> OwnReference | str:
    """The reference by the tight run of a pair, its uncertainty by the other runs; or why there is none."""
    name = _first(pair.solvers, problem)
    unlike_name = _first(pair.unlike_solvers, problem)
    if name is None or unlike_name is None:
        return f"{pair.solvers[0]}, {pair.unlike_solvers[0]}: none takes the problem"
    max_step = float(times[-1]) / _LEAST_STEPS
    runs = []
    steps = 0
    for solver, tolerance in (
        (name, pair.tight),
        (name, pair.loose),
        (unlike_name, pair.unlike_tolerance),
    ):
        # Small components are followed by the relative tolerance.
        atol = _SMALL * tolerance * _size(problem)
        limit: dict[str, Any] = {"max_step": max_step} if solver.startswith(_LIMITED) else {}
        run = solve(problem, solver, tolerance, times, atol=atol, max_seconds=max_seconds, **limit)
        if not run.success:
            return f"{solver}: {run.status}"
        runs.append(run.states)
        # Some libraries do not tell their steps.
        steps = max(steps, run.work.steps or _LEAST_STEPS)
    tight, loose, unlike = runs
    deviation = measure(unlike, tight)
    uncertainty = max(
        SAFETY * measure(loose, tight),
        _ALIKE * deviation,
        measure(_at_shifted_times(problem, times, tight, steps), tight),
        _ROUNDING,
    )
    if not deviation <= _CONFIRMED:
        uncertainty = max(uncertainty, SAFETY * deviation)
    source = f"{name} at {pair.tight:g}, compared with {unlike_name} at {pair.unlike_tolerance:g}"
    return OwnReference(tight, uncertainty, source)


def _at_shifted_times(
    problem: Problem, times: np.ndarray, states: np.ndarray, steps: int
) -> np.ndarray:
    """States, shape (n, d), at times that are off by the rounding of a sum of `steps` steps, to first order.

    Runs whose steps have the same limit share that error, whatever their method and tolerance.
    """
    # Each step rounds the time by an ulp at most. All are taken to round to the same side.
    shifts = steps * float(np.finfo(float).eps) * times[:, None]
    field = plain_field(problem.field)
    parameters = problem.field_parameters
    with np.errstate(all="ignore"):
        rates = np.array([field(row, parameters) for row in states.tolist()], dtype=float)
    return states + shifts * np.where(np.isfinite(rates), rates, 0.0)

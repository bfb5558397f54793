"""Full forms for many particles at once by equal steps in SIMD lanes.

Method and step are chosen on a sample. Every particle then runs twice, by those steps and by steps
twice as wide. The right runs of the sample bound the difference of the two; a particle beyond that
bound runs anew by smaller steps, and at last by Taylor's method, whose steps adapt.
"""

from dataclasses import dataclass

import numpy as np

from polhode.models.operations import ARRAYS
from polhode.models.problem import Problem
from polhode.solvers.compile import parameter_array
from polhode.solvers.contract import Status
from polhode.solvers.ensembles.methods import RUNGE_KUTTA, Array, Method, method, names
from polhode.solvers.ensembles.taylor_batch import run_batches
from polhode.solvers.machine_code.lanes import by_particle

# Numbers that are called estimates here are no results of a recorded measurement. They change what an
# ensemble costs, and how many particles run anew; errors are measured, on the sample and by a check of
# each particle.
#
# Least number of segments of a run. The two runs of a particle are compared after every other segment,
# or at about this many times if there are more segments. An estimate.
MIN_SEGMENTS = 16

# Share of the sample whose error stays below the one that the chosen steps are to meet; an estimate.
_BOUNDED_SHARE = 0.98
# Error for which steps are chosen, over the tolerance: particles outside the sample may err more. An
# estimate.
_AIM = 0.5
# Largest error of a reference over the tolerance, by comparison with half as many steps: a twentieth
# leaves the errors of methods as they are.
_SURE = 0.05
# Most runs for a reference, each with twice as many steps as the one before; an estimate. The last one
# has 128 times the first guess.
_DOUBLINGS = 8
# Order by which the number of steps follows from an error: DOP853's, and an estimate for splittings. The
# next trial corrects what is wrong with it.
_ORDER = 8
# Trials of a number of steps, per method; an estimate.
_ROUNDS = 6
# Bounds of the factor by which one trial changes the number of steps; estimates.
_MIN_CHANGE = 0.4
_MAX_CHANGE = 2.5
# Factor by which more steps than the fewest are tried too: they leave fewer particles in doubt. An
# estimate.
_MORE_STEPS = 1.15
# Most times that a doubtful particle's number of steps is doubled; then Taylor's method runs it. An
# estimate.
_HALVINGS = 4
# Tolerance of Taylor's method over the requested one: its tolerance is of a step, the requested one
# of the whole run. An estimate.
TAYLOR = 1e-3
# First guess of a step, which a sample then corrects: it turns the body by about this angle, in rad,
_ANGLE = 1.0
# at rates of at least this, in shear rates: the shear turns all bodies about as fast,
_LEAST_RATE = 0.5
# and at most this multiple of a relaxation time.
_RELAXATION = 2.0
# Cost of a particle's run with its check, over the cost of the run alone: the check has half as
# many steps.
_WITH_CHECK = 1.5
# Estimated cost of running a particle anew, over the cost of its run: twice as many steps, and for
# some four times as many.
_ANEW = 3.0


@dataclass(frozen=True)
class Plan:
    """How the particles of an ensemble are to be run."""

    method: str  # of `polhode.solvers.ensembles.methods`
    steps: int  # from one time to the next, or of each segment where there are few times
    # Largest difference from a run by steps twice as wide that is no reason for doubt.
    apart: float
    # Bound of most errors of the sample (`_BOUNDED_SHARE`), before particles in doubt are run anew.
    error: float
    # Cost of these steps of a particle, check and runs anew included; one unit is a slow and a fast flow of a
    # splitting.
    cost: float


def plan(problem: Problem, sample: Array, times: Array, tolerance: float) -> Plan | None:
    """The cheapest method and step that keep a sample's errors.

    None if none does, as where motion is chaotic.

    The problem has no periodic components; the sample holds starts, shape (n, d); the times are
    equispaced from 0 to the end. The tolerance bounds the error of any component on the way, over
    the largest one at the start, or 1 if that is less.
    """
    times, _ = _in_segments(times)
    steps = _first_steps(problem, sample, times)
    reference = _reference(problem, sample, times, tolerance, steps)
    if reference is None:
        return None
    fittings = [
        _fitting(method(name, problem), sample, times, tolerance, reference, steps)
        for name in names(problem)
    ]
    return min(filter(None, fittings), key=lambda fitting: fitting.cost, default=None)


def unplanned(problem: Problem, starts: Array, times: Array, tolerance: float) -> Plan:
    """Steps that are a fair guess, for too few particles to spend a sample on.

    Parameters as in `plan`.
    """
    by = method(RUNGE_KUTTA, problem)
    times, _ = _in_segments(times)
    # An even number: the check has half as many steps.
    steps = 2 * int(np.ceil(_first_steps(problem, starts, times) * tolerance ** (-1 / _ORDER) / 2))
    return Plan(by.name, steps, tolerance * by.sure, tolerance, _WITH_CHECK * by.cost * steps)


def run(
    problem: Problem, starts: Array, times: Array, tolerance: float, chosen: Plan
) -> tuple[Array, Array]:
    """States, shape (m, n, d), NaN where a particle failed, and statuses, of many starts.

    Parameters as of `plan`.
    """
    by = method(chosen.method, problem)
    steps = chosen.steps
    times, segments = _in_segments(times)
    in_lanes = _march(by, starts, times, steps)
    # NaN is a reason for doubt too.
    doubtful = np.flatnonzero(~(_doubt(by, starts, times, steps, in_lanes) <= chosen.apart))
    states = by_particle(in_lanes[:, ::segments], len(starts)).swapaxes(0, 1)
    group, lane = np.divmod(doubtful, in_lanes.shape[3])
    before = in_lanes[group, :, :, lane]
    for _ in range(_HALVINGS):
        if not len(doubtful):
            break
        steps *= 2
        finer = by_particle(_march(by, starts[doubtful], times, steps), len(doubtful))
        states[:, doubtful] = finer[:, ::segments].swapaxes(0, 1)
        # As if each particle were a group of a single lane.
        apart = _apart(finer[..., None], before[..., None])
        still = ~(apart <= tolerance * by.sure)
        doubtful = doubtful[still]
        before = finer[still]
    statuses = np.array([str(Status.REACHED_END)], dtype=object).repeat(len(starts))
    if len(doubtful):
        rows, outcomes = run_batches(
            problem, starts[doubtful], times[::segments], tolerance * TAYLOR
        )
        states[:, doubtful] = rows
        statuses[doubtful] = outcomes
    return states, statuses


def _march(by: Method, starts: Array, times: Array, steps: int) -> Array:
    """States in lanes by a number of steps from one time to the next."""
    return by.lanes.march(starts, len(times), by.constants(_step(times, steps)), steps)


def _step(times: Array, steps: int) -> float:
    """Length of a step, in the problem's time, with `steps` from one time to the next."""
    return float(times[-1]) / (len(times) - 1) / steps


def _apart(states: Array, reference: Array, stride: int = 1) -> Array:
    """Largest difference of each particle's states over the largest component at the start or 1.

    Both arrays are in lanes, shape (groups, rows, d, width); row i of the reference belongs to row
    ``i stride`` of the states. The result has an entry for each lane, left over ones included.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        apart = states[:, ::stride][:, : reference.shape[1]] - reference
        apart = np.abs(apart, out=apart).reshape(len(states), -1, states.shape[3]).max(axis=1)
        return (apart / np.maximum(1.0, np.abs(states[:, 0]).max(axis=1))).ravel()


def _doubt(by: Method, starts: Array, times: Array, steps: int, states: Array) -> Array:
    """Difference of each particle's states from those by steps twice as wide, shape (n,)."""
    # Rows from one comparison to the next: an even number, so that half as many steps are whole.
    intervals = len(times) - 1
    stride = 2 * -(-intervals // (2 * MIN_SEGMENTS))
    rows = 1 + intervals // stride
    constants = by.constants(2 * _step(times, steps))
    by_wide_steps = by.lanes.march(starts, rows, constants, steps * stride // 2)
    return _apart(states, by_wide_steps, stride)[: len(starts)]


def _in_segments(times: Array) -> tuple[Array, int]:
    """Times with others between them, if there are few, and the number of segments from one given time to the next."""
    intervals = len(times) - 1
    segments = -(-MIN_SEGMENTS // intervals)
    return np.linspace(0.0, times[-1], intervals * segments + 1), segments


def _first_steps(problem: Problem, sample: Array, times: Array) -> int:
    """Number of steps between two times that is a fair guess."""
    rates = problem.field(ARRAYS)(sample.T, parameter_array(problem))
    length = _ANGLE / max(_LEAST_RATE, *(float(np.max(np.abs(rate))) for rate in rates))
    strength = problem.parts.strength(problem.parameters or ()) if problem.parts else 0.0
    if strength > 0:
        length = min(length, _RELAXATION / strength)
    return max(1, int(np.ceil(_step(times, 1) / length)))


@dataclass(frozen=True)
class _Reference:
    """States of the sample with an error far below the tolerance, and a bound of that error."""

    states: Array
    error: float  # that most particles stay below (`_BOUNDED_SHARE`); rounding at least, never 0

    def error_of(self, states: Array) -> float:
        """Bound of most particles' errors: their distance from the reference, and its own error.

        A run by the reference's own method and steps has distance 0, and the reference's error.
        """
        return _bound_of_most(_apart(self.states, states)) + self.error


def _reference(
    problem: Problem, sample: Array, times: Array, tolerance: float, steps: int
) -> _Reference | None:
    """The sample by DOP853, its steps doubled from a first number on until they are sure; None if they never are."""
    by = method(RUNGE_KUTTA, problem)
    before = None
    rounding = float(np.finfo(float).eps)
    for _ in range(_DOUBLINGS):
        states = _march(by, sample, times, steps)
        if before is not None:
            error = _bound_of_most(_apart(states, before)) / by.sure
            if error <= _SURE * tolerance:
                return _Reference(states, max(error, rounding))
        before = states
        steps = 2 * steps
    return None


def _bound_of_most(errors: Array) -> float:
    """Bound of most errors of the sample (`_BOUNDED_SHARE`)."""
    return float(np.quantile(np.nan_to_num(errors, nan=np.inf), _BOUNDED_SHARE, method="higher"))


def _fitting(
    by: Method, sample: Array, times: Array, tolerance: float, reference: _Reference, steps: int
) -> Plan | None:
    """The plan of a method: the fewest steps that keep the sample's errors, or a few more; None if none do."""
    tried: dict[int, Array] = {}
    good: list[int] = []
    for _ in range(_ROUNDS):
        states = tried[steps] = _march(by, sample, times, steps)
        error = reference.error_of(states) / (_AIM * tolerance)
        if error <= 1:
            good.append(steps)
        # The error falls with the order of the method.
        factor = float(np.clip(error ** (1 / _ORDER), _MIN_CHANGE, _MAX_CHANGE))
        steps = int(np.ceil(steps * factor))
        if steps in tried:
            break
    if not good:
        return None
    plans = []
    for count in {min(good), int(np.ceil(_MORE_STEPS * min(good)))}:
        states = tried[count] if count in tried else _march(by, sample, times, count)
        errors = _apart(reference.states, states)[: len(sample)]
        apart = _doubt(by, sample, times, count, states)
        wrong = ~(errors <= _AIM * tolerance)
        # Largest difference without doubt: the bound of most, or less where a particle of the sample
        # with a smaller difference errs too much, or where an error of the tolerance shows less.
        doubt = min(
            float(apart[wrong].min(initial=np.inf)), _bound_of_most(apart), tolerance * by.sure
        )
        again = float(np.mean(~(apart <= doubt)))
        plans.append(
            Plan(
                by.name,
                count,
                doubt,
                _bound_of_most(errors) + reference.error,
                by.cost * count * (_WITH_CHECK + _ANEW * again),
            )
        )
    return min(plans, key=lambda fitting: fitting.cost)

"""Machine code that composes the flows of a problem's parts: no Python per step or row.

`advance` steps and fills rows; `check` runs `advance` twice, by two laws of step size, and compares
the rows. Their numbers lie in arrays, whose places `LawAt`, `ClockAt` and `CheckAt` name.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import inf, pi

import numpy as np

from polhode.models.once import once
from polhode.models.problem import Parts
from polhode.solvers.machine_code.program import (
    WIDEST_REGISTERS,
    Array,
    Program,
    compare,
    compiled,
    splat,
)
from polhode.solvers.machine_code.tracing import OPERATIONS, Number
from polhode.solvers.parts.flows import Flows, SpreadAt, row_scheme_of, stages_of, weights_of

# The estimates here change how many steps a run takes, and how sharp a check sees: `planning` checks the
# steps that follow.
#
# Step length is kept until the rate of the fast angle has changed by 5 %, an estimate: errors cancel
# over a turn only if its steps are equal.
_BAND = 1.05
# Rows in the second half of a step are reached backwards from its end, unless that amplifies what
# relaxes by more than 5 %, an estimate.
_MAX_RELAXED_BACKWARD = 0.05
# Times at which a check compares runs, in either of its two parts; an estimate.
_POINTS = 8
# Rounding alone makes two runs of a check differ by this, in a fast component of size 1, per type of
# number: some 450 roundings, an estimate.
_ROUNDING = {float: 1e-13, np.longdouble: 5e-17}


class Code(IntEnum):
    """How a call of `advance` ends."""

    FINISHED = 0  # all rows are filled
    STEPS_DONE = 1  # the most steps of the call are taken
    PAUSED = 2  # the time at which the caller plans anew is reached
    OUTSIDE = 3  # the rate has left the bounds between which the law holds
    NOT_FINITE = 4  # the rate is infinite or NaN
    NO_STEP = 5  # a step no longer moves the time


# Places are plain integers, by which arrays are indexed four times as fast as by an `IntEnum`.
class LawAt:
    """Places in a law of step size: ``h = min(FACTOR r**-EXPONENT, WIDEST / r)``.

    The rate r, no less than a least one, is the root of the fast angle's squared rate plus FLOOR. A
    step h has the problem's unit of time, r has rad per unit of time.

    `advance` reads FLOOR as half the slow part's largest rate of relaxation too. The two are equal as
    numbers alone: simple shear turns a body by 1/2 rad per unit of time (`splitting._SHEAR`).
    """

    FACTOR = 0  # H of `planning.Plan`; its unit follows from the law above
    EXPONENT = 1  # 2/3 in `planning`
    WIDEST = 2  # the largest angle h r, in rad
    FLOOR = 3  # the square of the least rate that counts
    LOWEST = 4  # the law holds from this rate r
    HIGHEST = 5  # to this one
    SIZE = 6


class ClockAt:
    """Places in a clock: how far a run has come, and the limits of the next call of `advance`.

    Times are in the problem's unit.
    """

    BEGIN = 0  # the time at which the step was last changed
    STEP = 1  # length of a step, a time
    LOW = 2  # the step stays while the rate is at least this,
    HIGH = 3  # and at most this
    SINCE = 4  # steps since BEGIN: the time is BEGIN + SINCE STEP
    FILLED = 5  # rows
    STEPS = 6  # in all
    CODE = 7  # a `Code`
    UNTIL = 8  # limit: a time
    LIMIT = 9  # limit: steps of this call
    ROWS = 10  # number of rows
    SIZE = 11


class CheckAt:
    """Places in the numbers of `check`: two laws, settings, and from SLOW on the results.

    Times are in the problem's unit.
    """

    FIRST_LAW = 0
    SECOND_LAW = LawAt.SIZE
    SPAN = 2 * LawAt.SIZE  # time of either part, at the beginning and at the end of the check
    WHOLE = SPAN + 1  # time of the whole check
    RATE = SPAN + 2  # of the fast angle, in rad per unit of time
    SLOW = SPAN + 3  # largest difference of the two runs in slow quantities
    FAST = SPAN + 4  # the same in fast components, over one and the turns up to there
    CHANGE = SPAN + 5  # of the mean difference of slow quantities, from part to part
    # Largest distance of the first run's fast components from their mean,
    AMPLITUDE_BEGIN = SPAN + 6  # in the first part,
    AMPLITUDE_END = SPAN + 7  # and in the second
    STEPS = SPAN + 8  # of both runs
    CODES = SPAN + 9  # sum of both runs' codes: 0 if both reached the end
    SIZE = SPAN + 10
    RESULTS_SIZE = SIZE - SLOW


sqrt = OPERATIONS.sqrt
where_positive = OPERATIONS.where_positive


@dataclass(frozen=True)
class Kernels:
    """Compiled functions of one problem's parts; all arguments are arrays.

    `parts.flows` shows what a scheme holds.
    """

    # (scheme, law, p, state, clock, times, rests, rows): steps until the rows are filled, or a
    # limit in the clock is met, from which state and clock go on. `rests` is room for a number of
    # each row.
    advance: Callable[..., None]
    # (scheme, p, state, numbers): two runs by one law each, compared at `_POINTS` times at the
    # beginning and as many at the end; `CheckAt` names the numbers and the results among them.
    check: Callable[..., None]


def clock(time: float, number: type = float) -> np.ndarray:
    """The clock of a run that begins."""
    numbers = np.zeros(ClockAt.SIZE, number)
    numbers[ClockAt.BEGIN] = time
    _set_beginning(numbers)
    return numbers


def _set_beginning(numbers: np.ndarray | Array) -> None:
    """Set a clock of zeros and a time to a run's beginning, in NumPy or in machine code."""
    # No rate lies between LOW, 0, and this bound, so that a first step is chosen.
    numbers[ClockAt.HIGH] = -1.0
    # The start is the first row.
    numbers[ClockAt.FILLED] = 1.0
    numbers[ClockAt.UNTIL] = inf


@once()
def kernels(parts: Parts, dimension: int, number: type = float, chains: int = 1) -> Kernels:
    """Compile the kernels of splitting for a problem's parts and a type of numbers, once."""
    flows = Flows(parts, dimension, number, chains)
    advance = _advance(flows)
    programs = flows.prepare, flows.spread, advance, _check(flows, advance, _ROUNDING[number])
    return Kernels(*compiled(*programs, number=number))


def larger(a: Number, b: Number) -> Number:
    """The larger one; b if either is not a number.

    A maximum over points, with b the next point, forgets a NaN at all points but the last. `check`
    relies on its CODES there: a run whose rate is NaN stops with a code other than 0.
    """
    return where_positive(a - b, a, b)


def length(vector: Sequence[Number]) -> Number:
    """Euclidean norm of a vector."""
    return sqrt(sum(component * component for component in vector))


def _advance(flows: Flows) -> Program:
    """`Kernels.advance`.

    A pass of the loop chooses a step if the present one is too long or too short, fills the rows
    that are near, and takes the step. With one chain the last fast flow of a step and the first
    one of the next are one flow, and `_Run.incomplete` says whether the state lacks it. With several
    chains a state is their mean, and complete after each step. The docstring of `flows` shows what
    `scheme` holds.

    A call ends with a complete state. Cutting a run into calls therefore changes rounding
    alone: `_Run.complete` does in two flows what the next step would do in one, and the remainder
    begins at 0.
    """
    program = Program(
        "advance", "scheme law p state clock times rests rows", attribute=WIDEST_REGISTERS
    )
    run = _Run(flows, program)
    # Constants lie on this call's stack: a call that goes on needs them anew. In a run's first call
    # the constants belong to a step 0, until the loop chooses a step.
    run.prepare_constants()
    with program.repeat() as leave:
        leave(compare("oge", run.filled[0], run.clock[ClockAt.ROWS]))
        run.choose_step(leave)
        now = run.time()
        run.fill_rows(now)
        run.leave_at_limits(now, leave)
        run.take_step()
    run.hand_back()
    return program


class _Run:
    """The loop of `advance`: what it keeps on the stack, and a method for each of its parts.

    The methods write machine code; those that are given `leave` write exits from the loop.
    """

    def __init__(self, flows: Flows, program: Program) -> None:
        """Make room, and read state and clock."""
        self.flows = flows
        self.program = program
        # Arguments of `Kernels.advance`.
        (
            self.scheme,
            self.law,
            self.p,
            self.state,
            self.clock,
            self.times,
            self.rests,
            self.rows,
        ) = program.arguments
        self.stages = stages_of(self.scheme)
        # Number of first components that the fast flow leaves alone.
        unmoved = flows.parts.moving[0]
        self.constants = flows.constants(program)
        self.spread_numbers = program.room(SpreadAt.SIZE)
        self.y = program.room(flows.dimension)  # the state on the way
        self.complete_state = program.room(flows.dimension)  # the same, complete, for rows
        self.chain_states = program.room(flows.dimension, flows.chains)
        # Parts of the unmoved components that rounding has left out. Components behind the moving ones
        # have no remainder: their means are taken like the means of the moving ones.
        self.remainder = program.room(unmoved)
        self.remainder.store([0.0] * unmoved)
        self.y.store(self.state.load(flows.dimension))
        # 1 while the state lacks the last fast flow of its step.
        self.incomplete = program.cell(0.0)
        self.code = program.cell(float(Code.FINISHED))
        self.step_limit = self.clock[ClockAt.STEPS] + self.clock[ClockAt.LIMIT]
        # The clock's numbers that change, a cell each.
        self.begin = program.cell(self.clock[ClockAt.BEGIN])
        self.step = program.cell(self.clock[ClockAt.STEP])
        self.low = program.cell(self.clock[ClockAt.LOW])
        self.high = program.cell(self.clock[ClockAt.HIGH])
        self.since = program.cell(self.clock[ClockAt.SINCE])
        self.filled = program.cell(self.clock[ClockAt.FILLED])
        self.steps = program.cell(self.clock[ClockAt.STEPS])

    def prepare_constants(self) -> None:
        """Compute the constants of the flows for the present step."""
        self.program.call(self.flows.prepare, self.scheme, self.p, self.constants, self.step[0])

    def time(self) -> Number:
        """The time of the state."""
        return self.begin[0] + self.since[0] * self.step[0]

    def complete(self, state: Array) -> None:
        """Make up for the last fast flow of a step if the state lacks it."""
        if self.flows.chains == 1:
            with self.program.when(compare("ogt", self.incomplete[0], 0.0)):
                self.flows.fast_flow(state, self.flows.row(self.constants, self.stages))

    def choose_step(self, leave: Callable[[str], None]) -> None:
        """Choose another step by the law if the rate has left its bounds, as it has at the beginning.

        Equal steps cancel errors over a turn: a step stays while the rate hardly changes.
        """
        law = self.law
        rate = self.flows.rate(self.y, self.p)
        speed = sqrt(rate * rate + law[LawAt.FLOOR])
        outside = self.program.cell(1.0)
        with (
            self.program.when(compare("oge", speed, self.low[0])),
            self.program.when(compare("ole", speed, self.high[0])),
        ):
            outside[0] = 0.0
        with self.program.when(compare("ogt", outside[0], 0.0)):
            # The last fast flow of the step before has the constants of that step.
            self.complete(self.y)
            self.incomplete[0] = 0.0
            self.begin[0] = self.time()
            self.since[0] = 0.0
            self.low[0] = speed / _BAND
            self.high[0] = speed * _BAND
            # The angle h r of a step, in rad, by the first term of the law (`LawAt`).
            free_angle = law[LawAt.FACTOR] * speed ** (1.0 - law[LawAt.EXPONENT])
            widest = law[LawAt.WIDEST]
            self.step[0] = where_positive(widest - free_angle, free_angle, widest) / speed
            # The code says why the loop is left, if it is.
            self.code[0] = float(Code.NOT_FINITE)
            leave(compare("uge", speed, inf))
            self.code[0] = float(Code.OUTSIDE)
            leave(compare("olt", speed, law[LawAt.LOWEST]))
            leave(compare("ogt", speed, law[LawAt.HIGHEST]))
            self.code[0] = float(Code.NO_STEP)
            leave(compare("ule", self.begin[0] + self.step[0], self.begin[0]))
            self.prepare_constants()

    def fill_rows(self, now: Number) -> None:
        """Put the state into the rows near it, and the time from it to each row into `rests`.

        `hand_back` moves these rows to their own times.
        """
        # Rows are reached from the nearer end of a step, except back in time where the slow part is
        # strong: FLOOR is half the rate of its relaxation (`LawAt`), so that half a step back relaxes
        # by this.
        relaxed = self.law[LawAt.FLOOR] * self.step[0]
        share_from_here = where_positive(_MAX_RELAXED_BACKWARD - relaxed, 0.5, 1.0)
        row_limit = now + share_from_here * self.step[0]
        filled = self.filled
        dimension = self.flows.dimension
        with self.program.when(compare("ole", self.times[filled[0]], row_limit)):
            self.complete_state.store(self.y.load(dimension))
            self.complete(self.complete_state)
            with self.program.repeat() as leave_rows:
                leave_rows(compare("oge", filled[0], self.clock[ClockAt.ROWS]))
                leave_rows(compare("ogt", self.times[filled[0]], row_limit))
                row = self.rows + filled[0] * float(dimension)
                row.store(self.complete_state.load(dimension))
                self.rests[filled[0]] = self.times[filled[0]] - now
                filled[0] = filled[0] + 1.0

    def leave_at_limits(self, now: Number, leave: Callable[[str], None]) -> None:
        """Leave the loop where all rows are filled or a limit of the clock is met, with its code."""
        for condition, reason in (
            (compare("oge", self.filled[0], self.clock[ClockAt.ROWS]), Code.FINISHED),
            (compare("oge", self.steps[0], self.step_limit), Code.STEPS_DONE),
            (compare("oge", now, self.clock[ClockAt.UNTIL]), Code.PAUSED),
        ):
            self.code[0] = float(reason)
            leave(condition)
        self.code[0] = float(Code.FINISHED)

    def take_step(self) -> None:
        """Advance the state by a step."""
        if self.flows.chains > 1:
            _step_by_mean(
                self.flows,
                self.scheme,
                self.stages,
                self.constants,
                self.y,
                self.chain_states,
                self.remainder,
            )
        else:
            _step_by_one_chain(self.flows, self.stages, self.constants, self.y, self.incomplete)
        self.since[0] = self.since[0] + 1.0
        self.steps[0] = self.steps[0] + 1.0

    def hand_back(self) -> None:
        """Complete the state, move the rows of this call to their times, and write the clock."""
        dimension = self.flows.dimension
        self.complete(self.y)
        self.state.store(self.y.load(dimension))
        # Rows before these are finished by the calls before.
        before = self.clock[ClockAt.FILLED]
        row_scheme = row_scheme_of(self.scheme, self.stages, self.flows.chains)
        self.spread_numbers[SpreadAt.ROWS] = self.filled[0] - before
        self.spread_numbers[SpreadAt.STEPS] = 1.0
        first_row = self.rows + before * float(dimension)
        self.program.call(
            self.flows.spread,
            row_scheme,
            self.p,
            self.spread_numbers,
            self.rests + before,
            first_row,
        )
        # In the order of `ClockAt`, from BEGIN to CODE.
        cells = (
            self.begin,
            self.step,
            self.low,
            self.high,
            self.since,
            self.filled,
            self.steps,
            self.code,
        )
        self.clock.store([cell[0] for cell in cells])


def _step_by_mean(
    flows: Flows,
    scheme: Array,
    stages: Number,
    constants: Array,
    y: Array,
    chain_states: Array,
    remainder: Array,
) -> None:
    """A step of the state `y`: all chains begin where it does, and their weighted mean is its end.

    The first components, which the fast flow leaves alone, are sums of gains. Gains are summed apart;
    what rounding loses is carried into the next step by `remainder` (compensated summation): rounding
    of equal sign in each step would pile up.
    """
    program = y.program
    unmoved = flows.parts.moving[0]
    start = y.load(flows.dimension)
    chain_starts = (*remainder.load(unmoved), *start[unmoved:])
    chain_states.store([splat(component, flows.chains) for component in chain_starts])
    base = [splat(component, flows.chains) for component in start[:unmoved]]
    with program.times(stages) as i:
        row = flows.row(constants, i)
        flows.both_flows(chain_states, row, row, base)
    flows.fast_flow(chain_states, flows.row(constants, stages), base)
    weights = weights_of(scheme, stages, flows.chains)
    means = [(weights * lanes).total() for lanes in chain_states.load(flows.dimension)]
    gains = means[:unmoved]
    before = start[:unmoved]
    ends = [old + gain for old, gain in zip(before, gains, strict=True)]
    remainder.store(
        [gain - (end - old) for old, gain, end in zip(before, gains, ends, strict=True)]
    )
    assert flows.parts.restored is not None
    y.store(flows.parts.restored([*ends, *means[unmoved:]]))


def _step_by_one_chain(
    flows: Flows, stages: Number, constants: Array, y: Array, incomplete: Array
) -> None:
    """A step of the state `y` without its last fast flow.

    Its first fast flow begins with the last one of the step before, if the state lacks that: the
    row of both stands behind all others.
    """
    # Row 0, or the last one, s + 1.
    first_row = incomplete[0] * (stages + 1.0)
    with y.program.times(stages) as i:
        # Row i from the second flow on; i is 0 at the first.
        fast_row = flows.row(constants, where_positive(i, i, first_row))
        flows.both_flows(y, fast_row, flows.row(constants, i))
    incomplete[0] = 1.0


def _check(flows: Flows, advance: Program, rounding: float) -> Program:
    """`Kernels.check`.

    Two runs from one state, by two laws of step size, are compared in two parts: at `_POINTS` times
    at the beginning, and at as many at the end. The rows of the runs, a state each, are::

        run 0: | start | part 0: rows 1 to 8 | part 1: rows 9 to 16 |
        run 1: | start | part 0: rows 1 to 8 | part 1: rows 9 to 16 |
    """
    program = Program("check", "scheme p state numbers")
    scheme, p, state, numbers = program.arguments
    run_length = 2 * _POINTS + 1
    rows = program.room(2 * run_length * flows.dimension)
    y = program.room(flows.dimension)
    times = program.room(run_length)
    rests = program.room(run_length)
    _set_check_times(program, numbers, times)
    (numbers + CheckAt.SLOW).store([0.0] * CheckAt.RESULTS_SIZE)
    with program.times(2.0) as run:
        run_clock = program.room(ClockAt.SIZE)
        run_clock.store([0.0] * ClockAt.SIZE)
        _set_beginning(run_clock)
        run_clock[ClockAt.LIMIT] = inf
        run_clock[ClockAt.ROWS] = float(run_length)
        y.store(state.load(flows.dimension))
        law = numbers + run * float(LawAt.SIZE)
        run_rows = rows + run * run_length * flows.dimension
        program.call(advance, scheme, law, p, y, run_clock, times, rests, run_rows)
        numbers[CheckAt.STEPS] = numbers[CheckAt.STEPS] + run_clock[ClockAt.STEPS]
        numbers[CheckAt.CODES] = numbers[CheckAt.CODES] + run_clock[ClockAt.CODE]
    # Sum of the differences of each slow quantity in the part before.
    size = len(flows.parts.slow_quantities(y))
    change_before = program.room(size)
    with program.times(2.0) as part:
        _compare_part(flows, numbers, times, rows, part, change_before, size, rounding)
    return program


def _set_check_times(program: Program, numbers: Array, times: Array) -> None:
    """Set the times of a check: 0, then times of the first part, then times of the second."""
    points = float(_POINTS)
    # From 0 on: times far from 0 have a rounding larger than the differences that a check seeks.
    span = numbers[CheckAt.SPAN]
    whole = numbers[CheckAt.WHOLE]
    times[0] = 0.0
    with program.times(points) as k:
        after = (k + 1.0) * (span / points)
        times[k + 1.0] = after
        times[k + (points + 1.0)] = whole - span + after


def _compare_part(
    flows: Flows,
    numbers: Array,
    times: Array,
    rows: Array,
    part: Number,
    change_before: Array,
    size: int,
    rounding: float,
) -> None:
    """Compare both runs of a check in one part, 0 or 1, and write the results into `numbers`.

    `size` is the number of slow quantities.
    """
    program = rows.program
    moving = range(*flows.parts.moving)
    points = float(_POINTS)
    run_length = 2 * _POINTS + 1
    rate = numbers[CheckAt.RATE]
    # Sum over the part of the difference of slow quantities; mean of the fast components.
    change = program.room(size)
    middle = program.room(len(moving))
    amplitude = numbers + part + float(CheckAt.AMPLITUDE_BEGIN)
    change.store([0.0] * size)
    middle.store([0.0] * len(moving))

    def row(k: Number, run: int) -> Array:
        """Row k of this part, of run 0 or 1."""
        before = float(run * run_length + 1)
        return rows + (before + part * points + k) * float(flows.dimension)

    with program.times(points) as k:
        first = row(k, 0)
        second = row(k, 1)
        slow_pairs = zip(*map(flows.parts.slow_quantities, (first, second)), strict=True)
        slow = [b - a for a, b in slow_pairs]
        change.store([sum_ + more for sum_, more in zip(change.load(size), slow, strict=True)])
        numbers[CheckAt.SLOW] = larger(numbers[CheckAt.SLOW], length(slow))
        turns = times[part * points + k + 1.0] * rate / (2 * pi)
        # Rounding is subtracted here alone: rounding of slow quantities only enters the second result
        # of `Planner.estimated`.
        fast = length([second[i] - first[i] for i in moving]) - rounding
        numbers[CheckAt.FAST] = larger(numbers[CheckAt.FAST], fast / (1.0 + turns))
        middle.store([middle[j] + first[i] / points for j, i in enumerate(moving)])
    amplitude[0] = 0.0
    with program.times(points) as k:
        first = row(k, 0)
        off_middle = length([first[i] - middle[j] for j, i in enumerate(moving)])
        amplitude[0] = larger(amplitude[0], off_middle)
    # The first part leaves its sum for the second to compare with. In the first part
    # `change_before` is not set yet: the number stored here is overwritten by the second part.
    numbers[CheckAt.CHANGE] = length([(change[i] - change_before[i]) / points for i in range(size)])
    change_before.store(change.load(size))

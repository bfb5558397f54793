"""Machine code that composes the flows of a problem's parts: no Python per step or row."""

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
from polhode.solvers.parts.flows import Flows

# A step follows the rate of the fast angle when that has changed by this factor; in between it
# stays, since what errs to and fro within a turn adds up to nothing only while steps are equal.
_BAND = 1.05
# Rows are reached backwards in time where the slow part relaxes by less than twice this in a step.
_BACKWARD = 0.05
# Numbers in a law.
_LAW = 6
# Times at which a check compares runs, in either part.
_POINTS = 8
# Difference of two runs by rounding, per type of number, relative.
_ROUNDING = {float: 1e-13, np.longdouble: 5e-17}
# How a call of `advance` ends.
Code = IntEnum("Code", "FINISHED STEPS_DONE PAUSED OUTSIDE NOT_FINITE NO_STEP", start=0)
# Places in a clock: the time at which the step was last changed, the step, the rates between which
# it stays, the steps since then, rows filled, steps in all, the code; then the limits of a call: a
# time, steps, and the number of times.
At = IntEnum("At", "BEGIN STEP LOW HIGH SINCE FILLED STEPS CODE UNTIL LIMIT ROWS", start=0)

sqrt = OPERATIONS.sqrt
where_positive = OPERATIONS.where_positive


@dataclass(frozen=True)
class Kernels:
    """Compiled functions of one problem's parts; all arguments are arrays.

    A scheme holds the number of slow flows in a step, the fast and the slow shares of each chain,
    and the chains' weights; then comes the scheme, of one chain, that leads to a row. A law holds
    the factor, the exponent and the widest angle of a step, the square of the least rate that
    counts, and the rates between which it holds.
    """

    # (scheme, law, p, state, clock, times, rests, rows): steps until the rows are filled, or a
    # limit in the clock is met, from which state and clock go on. `rests` is room for a number of
    # each row.
    advance: Callable[..., None]
    # (scheme, p, state, numbers): two runs by one law each, to POINTS times at the beginning and at
    # the end. The numbers: the laws, the length of either part and of the whole, the rate, and the
    # results. These are the largest difference of the two runs in slow quantities, and in fast
    # components per turn; the change of the mean difference of slow quantities; the amplitudes of
    # the fast components in either part; the steps; the codes' sum.
    check: Callable[..., None]


def clock(time: float, number: type = float) -> np.ndarray:
    """The clock of a run that begins.

    No rate lies between its bounds, so that a first step is chosen.
    """
    return np.array([time, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, inf, 0.0, 0.0], number)


@once()
def kernels(parts: Parts, dimension: int, number: type = float, chains: int = 1) -> Kernels:
    """Compile the kernels of splitting for a problem's parts and a type of numbers, once."""
    flows = Flows(parts, dimension, number, chains)
    advance = _advance(flows)
    programs = flows.prepare, flows.spread, advance, _check(flows, advance, _ROUNDING[number])
    return Kernels(*compiled(*programs, number=number))


def larger(a: Number, b: Number) -> Number:
    """The larger one; b if either is not a number."""
    return where_positive(a - b, a, b)


def length(vector: Sequence[Number]) -> Number:
    """Euclidean norm of a vector."""
    return sqrt(sum(component * component for component in vector))


def _advance(flows: Flows) -> Program:
    program = Program(
        "advance", "scheme law p state clock times rests rows", attribute=WIDEST_REGISTERS
    )
    scheme, law, p, state, clock, times, rests, rows = program.arguments
    stages = scheme[0]
    dimension = flows.dimension
    # Number of first components that the fast flow leaves alone.
    unmoved = flows.parts.moving[0]
    constants = flows.constants(program)
    number = program.room(2)
    y = program.room(dimension)
    at = program.room(dimension)
    chain_states = program.room(dimension, flows.chains)
    remainder = program.room(unmoved)
    remainder.store([0.0] * unmoved)
    y.store(state.load(dimension))
    # 1 while the state lacks the last fast flow of its step.
    open_ = program.cell(0.0)
    code = program.cell(float(Code.FINISHED))
    limit = clock[At.STEPS] + clock[At.LIMIT]
    begin, step, low, high, since, filled, steps = (program.cell(clock[i]) for i in range(At.CODE))

    def close(y: Array) -> None:
        if flows.chains == 1:
            with program.when(compare("ogt", open_[0], 0.0)):
                flows.fast_flow(y, flows.row(constants, stages))

    program.call(flows.prepare, scheme, p, constants, step[0])
    with program.repeat() as leave:
        leave(compare("oge", filled[0], clock[At.ROWS]))
        rate = flows.rate(y, p)
        speed = sqrt(rate * rate + law[3])
        outside = program.cell(1.0)
        with (
            program.when(compare("oge", speed, low[0])),
            program.when(compare("ole", speed, high[0])),
        ):
            outside[0] = 0.0
        with program.when(compare("ogt", outside[0], 0.0)):
            close(y)
            open_[0] = 0.0
            begin[0] = begin[0] + since[0] * step[0]
            since[0] = 0.0
            low[0] = speed / _BAND
            high[0] = speed * _BAND
            free = law[0] * speed ** (1.0 - law[1])
            step[0] = where_positive(law[2] - free, free, law[2]) / speed
            code[0] = float(Code.NOT_FINITE)
            leave(compare("uge", speed, inf))
            code[0] = float(Code.OUTSIDE)
            leave(compare("olt", speed, law[4]))
            leave(compare("ogt", speed, law[5]))
            code[0] = float(Code.NO_STEP)
            leave(compare("ule", begin[0] + step[0], begin[0]))
            program.call(flows.prepare, scheme, p, constants, step[0])
        now = begin[0] + since[0] * step[0]
        # Rows are reached from the nearer end of a step, except back in time where the slow part is
        # strong.
        row_limit = now + where_positive(_BACKWARD - law[3] * step[0], 0.5, 1.0) * step[0]
        with program.when(compare("ole", times[filled[0]], row_limit)):
            at.store(y.load(dimension))
            close(at)
            with program.repeat() as done:
                done(compare("oge", filled[0], clock[At.ROWS]))
                done(compare("ogt", times[filled[0]], row_limit))
                (rows + filled[0] * float(dimension)).store(at.load(dimension))
                rests[filled[0]] = times[filled[0]] - now
                filled[0] = filled[0] + 1.0
        for condition, reason in (
            (compare("oge", filled[0], clock[At.ROWS]), Code.FINISHED),
            (compare("oge", steps[0], limit), Code.STEPS_DONE),
            (compare("oge", now, clock[At.UNTIL]), Code.PAUSED),
        ):
            code[0] = float(reason)
            leave(condition)
        code[0] = float(Code.FINISHED)
        if flows.chains > 1:
            # All chains begin where the step does, and their mean, by weight, is where it ends.
            # Gains of components that the fast flow leaves alone are summed apart: rounding of
            # equal sign in each step would pile up.
            start = y.load(dimension)
            chain_states.store(
                [
                    splat(number, flows.chains)
                    for number in (*remainder.load(unmoved), *start[unmoved:])
                ]
            )
            base = [splat(number, flows.chains) for number in start[:unmoved]]
            with program.times(stages) as i:
                flows.both_flows(
                    chain_states, flows.row(constants, i), flows.row(constants, i), base
                )
            flows.fast_flow(chain_states, flows.row(constants, stages), base)
            weights = (scheme + 1).of(flows.chains)[2.0 * stages + 1.0]
            means = [(weights * number).total() for number in chain_states.load(dimension)]
            ends = [before + gain for before, gain in zip(start, means[:unmoved], strict=False)]
            remainder.store(
                [
                    gain - (end - before)
                    for before, gain, end in zip(start, means, ends, strict=False)
                ]
            )
            assert flows.parts.restored is not None
            y.store(flows.parts.restored([*ends, *means[unmoved:]]))
        else:
            first = open_[0] * (stages + 1.0)
            with program.times(stages) as i:
                flows.both_flows(
                    y, flows.row(constants, where_positive(i, i, first)), flows.row(constants, i)
                )
            open_[0] = 1.0
        since[0] = since[0] + 1.0
        steps[0] = steps[0] + 1.0
    close(y)
    state.store(y.load(dimension))
    before = clock[At.FILLED]
    leading = scheme + (1.0 + (2.0 * stages + 2.0) * flows.chains)
    number.store([filled[0] - before, 1.0])
    program.call(flows.spread, leading, p, number, rests + before, rows + before * float(dimension))
    cells = (begin, step, low, high, since, filled, steps, code)
    clock.store([cell[0] for cell in cells])
    return program


def _check(flows: Flows, advance: Program, rounding: float) -> Program:
    program = Program("check", "scheme p state numbers")
    scheme, p, state, laws = program.arguments
    setting = laws + 2 * _LAW
    out = laws + (2 * _LAW + 3)
    dimension = flows.dimension
    moving = range(*flows.parts.moving)
    points = float(_POINTS)
    rows = program.room((4 * _POINTS + 2) * dimension)
    y = program.room(dimension)
    times, rests = (program.room(2 * _POINTS + 1) for _ in range(2))
    # From 0 on: times far from 0 have a rounding larger than the differences that a check seeks.
    span, whole, rate = setting.load(3)
    times[0] = 0.0
    with program.times(points) as k:
        after = (k + 1.0) * (span / points)
        times[k + 1.0] = after
        times[k + (points + 1.0)] = whole - span + after
    out.store([0.0] * 7)
    with program.times(2.0) as run:
        clock = program.room(len(At))
        clock.store([0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, inf, inf, 2 * points + 1])
        y.store(state.load(dimension))
        run_rows = rows + run * (2 * points + 1) * dimension
        program.call(advance, scheme, laws + run * float(_LAW), p, y, clock, times, rests, run_rows)
        steps = out[5] + clock[At.STEPS]
        codes = out[6] + clock[At.CODE]
        out[5] = steps
        out[6] = codes
    size = len(flows.parts.slow_quantities(y))
    before = program.room(size)
    with program.times(2.0) as part:
        change = program.room(size)
        middle = program.room(len(moving))
        most = out + part + 3.0
        change.store([0.0] * size)
        middle.store([0.0] * len(moving))

        def row(k: Number, run: float) -> Array:
            return rows + ((part + 2 * run) * points + (k + 1.0 + run)) * float(dimension)

        with program.times(points) as k:
            first = row(k, 0.0)
            second = row(k, 1.0)
            slow = [
                b - a
                for a, b in zip(*map(flows.parts.slow_quantities, (first, second)), strict=True)
            ]
            change.store([sum_ + more for sum_, more in zip(change.load(size), slow, strict=True)])
            out[0] = larger(out[0], length(slow))
            turns = times[part * points + k + 1.0] * rate / (2 * pi)
            out[1] = larger(
                out[1], (length([second[i] - first[i] for i in moving]) - rounding) / (1.0 + turns)
            )
            middle.store([middle[j] + first[i] / points for j, i in enumerate(moving)])
        most[0] = 0.0
        with program.times(points) as k:
            first = row(k, 0.0)
            most[0] = larger(most[0], length([first[i] - middle[j] for j, i in enumerate(moving)]))
        # The first part leaves its mean for the second to compare with.
        out[2] = length([(change[i] - before[i]) / points for i in range(size)])
        before.store(change.load(size))
    return program

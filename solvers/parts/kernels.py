"""Machine code that composes the flows of a problem's parts: no Python per step, nor per requested time."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from math import inf, pi

import numpy as np

from polhode.models.problem import Parts
from polhode.solvers.machine_code.program import Array, Program, compare, compiled
from polhode.solvers.machine_code.tracing import OPERATIONS, Number
from polhode.solvers.parts.schemes import AVOIDED

# A step follows the rate of the fast angle when that has changed by this factor; in between it stays, since what errs
# to and fro within a turn adds up to nothing only while steps are equal.
BAND = 1.05
# More slow flows than a step of any scheme has.
MOST_STAGES = 16
# Turns of which the averaged field takes differences, at most; stages in a row of a Runge-Kutta table.
MOST_TURNS, TABLE = 3, 16
# How a call of `kernel` ends.
Code = IntEnum("Code", "FINISHED STEPS_DONE PAUSED OUTSIDE NOT_FINITE NO_STEP", start=0)
# Places in a clock: the time at which the step was last changed, the step, the rates between which it stays, the steps
# since then, rows filled, steps in all, the code; then the limits of a call: a time, steps, and the number of times.
At = IntEnum("At", "BEGIN STEP LOW HIGH SINCE FILLED STEPS CODE UNTIL LIMIT ROWS", start=0)

sqrt, where_positive = OPERATIONS.sqrt, OPERATIONS.where_positive


@dataclass(frozen=True)
class StrobeKernels:
    """Those of stroboscopic averaging; a point is a state with its time behind it.

    Parameters
    ----------
    spread : callable
        ``spread(scheme, p, number, times, rows)``: move each row by a time of its own, in so many steps; `number` holds
        the number of rows, then that of steps of each.
    mean : callable
        ``mean(scheme, p, setting, weights, point, out)``: weighted sums, a row of weights each, of differences of the
        map of 1, 2, ... turns of a point: the averaged field, per turn. `setting` holds the steps of a turn, the number
        of turns, and the number of rows.
    macro : callable
        ``macro(scheme, p, setting, weights, point, table, stages, ends)``: stages of a Runge-Kutta step by the averaged
        field; `setting` holds besides the first stage, the one behind the last, and the turns in the step. `ends` is
        the point at which the last one was taken.
    """

    spread: Callable[..., None]
    mean: Callable[..., None]
    macro: Callable[..., None]


def clock(time: float) -> np.ndarray:
    """The clock of a run that begins; no rate lies between its bounds, so that a first step is chosen."""
    return np.array([time, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, inf, 0.0, 0.0])


@cache
def kernel(parts: Parts, dimension: int) -> Callable[..., None]:
    """Compile ``advance(scheme, law, p, state, clock, times, rows)`` for a problem's parts, once in a process.

    It steps until the rows are filled, or a limit in the clock is met. A scheme holds the number of slow flows in a
    step, and the fast and the slow shares; `law` the factor, the exponent and the widest angle of a step, the square of
    the least rate that counts, and the rates between which it holds. State and clock go on from there.
    """
    pieces = _Pieces(parts, dimension)
    return compiled(pieces.prepare, pieces.compose, pieces.step, _advance(pieces))[0]


@cache
def strobe_kernels(parts: Parts, dimension: int) -> StrobeKernels:
    """Compile those of stroboscopic averaging."""
    pieces = _Pieces(parts, dimension)
    turn = _turn(pieces)
    mean = _mean(pieces, turn)
    parts_of_all = pieces.prepare, pieces.compose, pieces.step, turn
    return StrobeKernels(*compiled(*parts_of_all, _spread(pieces), mean, _macro(dimension, mean)))


class _Pieces:
    """What the kernels are made of: `prepare` computes the constants of a step's flows, `compose` makes the step.

    Constants of stage i, a fast flow and a slow one, are row i of an array; then come those of the last fast flow, and
    those of the last one and the first one of the next step together. `compose` leaves the last fast flow out.
    """

    def __init__(self, parts: Parts, dimension: int) -> None:
        self.parts, self.dimension = parts, dimension
        self.fast, self.slow = parts.fast.flow(OPERATIONS), parts.slow.flow(OPERATIONS)
        numbers = (0.5,) * 64, 0.5
        self.sizes = len(parts.fast.constants(*numbers)), len(parts.slow.constants(*numbers))
        self.prepare, self.compose = self._prepare(), self._compose()
        self.step = self._step()

    def constants(self, program: Program) -> Array:
        """Room for the constants of a step."""
        return program.room((MOST_STAGES + 2) * sum(self.sizes))

    def row(self, constants: Array, i: float | Number) -> Array:
        """Constants from row i on."""
        return constants + i * float(sum(self.sizes))

    def rate(self, y: Array, p: Array) -> Number:
        """Rate of the fast angle."""
        return self.parts.rate(OPERATIONS)(y, p)

    def fast_flow(self, y: Array, constants: Array) -> None:
        """Advance a state."""
        y.store(self.fast(y.load(self.dimension), constants.load(self.sizes[0])))

    def slow_flow(self, y: Array, constants: Array) -> None:
        """Advance a state."""
        y.store(self.slow(y.load(self.dimension), constants.load(self.sizes[1])))

    def _prepare(self) -> Program:
        program = Program("prepare", "scheme p constants", "h", "internal", "noinline")
        scheme, p, constants, h = program.arguments
        stages, (fast, slow) = scheme[0], (self.parts.fast, self.parts.slow)
        with program.times(stages + 1.0) as i:
            self.row(constants, i).store(fast.constants(p, scheme[i + 1.0] * h, OPERATIONS))
        self.row(constants, stages + 1.0).store(fast.constants(p, 2 * scheme[1] * h, OPERATIONS))
        with program.times(0.5 * stages) as i:
            made = slow.constants(p, scheme[stages + i + 2.0] * h, OPERATIONS)
            for row in (i, stages - 1.0 - i):
                (self.row(constants, row) + self.sizes[0]).store(made)
        return program

    def _compose(self) -> Program:
        program = Program("compose", "constants y", "first stages", "internal", "alwaysinline")
        constants, y, first, stages = program.arguments
        with program.times(stages) as i:
            self.fast_flow(y, self.row(constants, where_positive(i, i, first)))
            self.slow_flow(y, self.row(constants, i) + self.sizes[0])
        return program

    def _step(self) -> Program:
        """A step by itself."""
        program = Program("step", "constants y", "stages", "internal", "noinline")
        constants, y, stages = program.arguments
        at = program.room(self.dimension)
        at.store(y.load(self.dimension))
        program.call(self.compose, constants, at, 0.0, stages)
        self.fast_flow(at, self.row(constants, stages))
        y.store(at.load(self.dimension))
        return program


def _advance(pieces: _Pieces) -> Program:
    program = Program("advance", "scheme law p state clock times rows")
    scheme, law, p, state, clock, times, rows = program.arguments
    stages, dimension = scheme[0], pieces.dimension
    constants, spare = (pieces.constants(program) for _ in range(2))
    y, at = (program.room(dimension) for _ in range(2))
    y.store(state.load(dimension))
    # 1 while the state lacks the last fast flow of its step.
    open_, code, limit = (
        program.cell(0.0),
        program.cell(float(Code.FINISHED)),
        clock[At.STEPS] + clock[At.LIMIT],
    )
    begin, step, low, high, since, filled, steps = (program.cell(clock[i]) for i in range(At.CODE))
    program.call(pieces.prepare, scheme, p, constants, step[0])
    with program.repeat() as leave:
        leave(compare("oge", filled[0], clock[At.ROWS]))
        for condition, reason in (
            (compare("oge", steps[0], limit), Code.STEPS_DONE),
            (compare("oge", begin[0] + since[0] * step[0], clock[At.UNTIL]), Code.PAUSED),
        ):
            code[0] = float(reason)
            leave(condition)
        rate = pieces.rate(y, p)
        speed = sqrt(rate * rate + law[3])
        outside = program.cell(1.0)
        with program.when(compare("oge", speed, low[0])), program.when(compare("ole", speed, high[0])):
            outside[0] = 0.0
        with program.when(compare("ogt", outside[0], 0.0)):
            with program.when(compare("ogt", open_[0], 0.0)):
                pieces.fast_flow(y, pieces.row(constants, stages))
            open_[0] = 0.0
            begin[0], since[0] = begin[0] + since[0] * step[0], 0.0
            low[0], high[0] = speed / BAND, speed * BAND
            free = law[0] * speed ** (1.0 - law[1])
            wide = where_positive(law[2] - free, free, law[2])
            step[0] = where_positive((wide - AVOIDED[0]) * (AVOIDED[1] - wide), AVOIDED[0], wide) / speed
            code[0] = float(Code.NOT_FINITE)
            leave(compare("uge", speed, inf))
            code[0] = float(Code.OUTSIDE)
            leave(compare("olt", speed, law[4]))
            leave(compare("ogt", speed, law[5]))
            code[0] = float(Code.NO_STEP)
            leave(compare("ule", begin[0] + step[0], begin[0]))
            program.call(pieces.prepare, scheme, p, constants, step[0])
        code[0] = float(Code.FINISHED)
        now, end = begin[0] + since[0] * step[0], begin[0] + (since[0] + 1.0) * step[0]
        with program.when(compare("ole", times[filled[0]], end)):
            at.store(y.load(dimension))
            with program.when(compare("ogt", open_[0], 0.0)):
                pieces.fast_flow(at, pieces.row(constants, stages))
            with program.repeat() as done:
                done(compare("oge", filled[0], clock[At.ROWS]))
                done(compare("ogt", times[filled[0]], end))
                row = rows + filled[0] * float(dimension)
                row.store(at.load(dimension))
                program.call(pieces.prepare, scheme, p, spare, times[filled[0]] - now)
                program.call(pieces.step, spare, row, stages)
                filled[0] = filled[0] + 1.0
        program.call(pieces.compose, constants, y, open_[0] * (stages + 1.0), stages)
        open_[0], since[0], steps[0] = 1.0, since[0] + 1.0, steps[0] + 1.0
    with program.when(compare("ogt", open_[0], 0.0)):
        pieces.fast_flow(y, pieces.row(constants, stages))
    state.store(y.load(dimension))
    clock.store([each[0] for each in (begin, step, low, high, since, filled, steps, code)])
    return program


def _spread(pieces: _Pieces) -> Program:
    program = Program("spread", "scheme p number times rows")
    scheme, p, number, times, rows = program.arguments
    constants = pieces.constants(program)
    with program.times(number[0]) as j:
        steps = number[j + 1.0]
        program.call(pieces.prepare, scheme, p, constants, times[j] / steps)
        with program.times(steps):
            program.call(pieces.step, constants, rows + j * float(pieces.dimension), scheme[0])
    return program


def _turn(pieces: _Pieces) -> Program:
    """One turn of the fast angle, forth or back as the step is, in so many steps and two short ones that close it."""
    program = Program("turn", "scheme p constants point", "steps h", "internal")
    scheme, p, constants, point, steps, h = program.arguments
    fast, slow, dimension = pieces.parts.fast, pieces.parts.slow, pieces.dimension
    y, ends, angle, passed = program.room(dimension), pieces.constants(program), program.cell(0.0), program.cell(0.0)
    y.store(point.load(dimension))

    def fast_flow(row: Array, share: Number) -> None:
        angle[0] = angle[0] + pieces.rate(y, p) * share
        pieces.fast_flow(y, row)

    with program.times(steps):
        with program.times(scheme[0]) as i:
            fast_flow(pieces.row(constants, i), h * scheme[i + 1.0])
            pieces.slow_flow(y, pieces.row(constants, i) + pieces.sizes[0])
        fast_flow(pieces.row(constants, scheme[0]), h * scheme[scheme[0] + 1.0])
    passed[0] = steps * h
    full = where_positive(h, 2 * pi, -2 * pi)
    for _ in range(2):
        rest = (full - angle[0]) / pieces.rate(y, p)
        for part, size, share in ((fast, 0, 0.5), (slow, pieces.sizes[0], 1.0)):
            (ends + size).store(part.constants(p, share * rest, OPERATIONS))
        fast_flow(ends, 0.5 * rest)
        pieces.slow_flow(y, ends + pieces.sizes[0])
        fast_flow(ends, 0.5 * rest)
        passed[0] = passed[0] + rest
    point.store([*y.load(dimension), point[dimension] + passed[0]])
    return program


def _mean(pieces: _Pieces, turn: Program) -> Program:
    program = Program("mean", "scheme p setting weights point out")
    scheme, p, setting, weights, point, out = program.arguments
    constants, dimension = pieces.constants(program), pieces.dimension
    moved, (steps, turns, rows) = program.room(dimension + 1), setting.load(3)
    with program.times(rows * float(dimension + 1)) as i:
        out[i] = 0.0
    with program.times(2.0) as back:
        sign = 1.0 - 2.0 * back
        h = sign * 2 * pi / (pieces.rate(point, p) * steps)
        program.call(pieces.prepare, scheme, p, constants, h)
        moved.store([*point.load(dimension), 0.0])
        with program.times(turns) as k:
            program.call(turn, scheme, p, constants, moved, steps, h)
            with program.times(rows) as row:
                weight, into = sign * weights[row * float(MOST_TURNS) + k], out + row * float(dimension + 1)
                for i in range(dimension + 1):
                    into[i] = into[i] + weight * (moved[i] - (point[i] if i < dimension else 0.0))
    return program


def _macro(dimension: int, mean: Program) -> Program:
    program = Program("macro", "scheme p setting weights point table stages ends")
    scheme, p, setting, weights, point, table, stages, ends = program.arguments
    stage, size = program.cell(setting[3]), float(dimension + 1)
    with program.repeat() as leave:
        s = stage[0]
        leave(compare("oge", s, setting[4]))
        ends.store(point.load(dimension + 1))
        with program.times(s) as j:
            weight = setting[5] * table[s * float(TABLE) + j]
            for i in range(dimension + 1):
                ends[i] = ends[i] + weight * stages[j * size + float(i)]
        program.call(mean, scheme, p, setting, weights, ends, stages + s * size)
        stage[0] = s + 1.0
    return program

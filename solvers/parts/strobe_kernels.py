"""Machine code of stroboscopic averaging: turns, their differences, macro-steps and rows.

`stroboscopic` says what turns, the averaged field and macro-steps are. A *point* is a state with
its time behind it: ``dimension + 1`` numbers. Each kernel takes its few numbers in one array, the
`setting`, whose places `MeanAt`, `MacroAt` and `RowsAt` name.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan, pi
from typing import Any

from polhode.models.once import once
from polhode.models.problem import Parts
from polhode.solvers.machine_code.program import Array, Program, compare, compiled
from polhode.solvers.machine_code.tracing import OPERATIONS, Number
from polhode.solvers.parts.flows import Flows, SpreadAt, fast_share_of, stages_of

# Most turns between a row and the end of a whole turn from which it is reached: half a turn, and a
# hundredth of that since the period there is known by the present rate alone; an estimate.
MAX_TURNS_TO_ROW = 0.505
# Most trials to find that end of a turn, each of which corrects the guess before; then the row is
# NaN. An estimate: a guess that converges at all takes far fewer.
_MAX_TRIALS = 20.0
# Terms of DOP853's interpolant.
TERMS = 7
# Doubles of this size are whole numbers next to each other: adding it rounds a number below 2**51
# to the nearest whole one, and subtracting it again is exact. 1.5 lets that number be negative.
_ROUNDS_TO_WHOLE = 1.5 * 2.0**52
# Turns of the widest central difference, of order 6: columns of `weights`.
_MAX_DIFFERENCE_TURNS = 3
# Columns of SciPy's table A of DOP853, which has a row and a column for each of 16 stages.
_TABLE_COLUMNS = 16


class MeanAt:
    """Places in the setting of `StrobeKernels.mean`."""

    MICRO_STEPS = 0  # steps of splitting in a turn
    TURNS = 1  # turns of the widest difference, 1 to 3
    ROWS = 2  # of weights, and of fields to be computed
    SIZE = 3


class MacroAt:
    """Places in the setting of `StrobeKernels.macro`; it begins with one of `MeanAt`."""

    MICRO_STEPS = MeanAt.MICRO_STEPS
    TURNS = MeanAt.TURNS
    ROWS = MeanAt.ROWS  # 1: a stage has the field of one order
    STAGE = 3  # the first stage to be computed; those before it are given
    STAGES_END = 4  # the stage behind the last one
    MACRO_TURNS = 5  # length of the macro-step in turns
    SIZE = 6


class RowsAt:
    """Places in the setting of `StrobeKernels.rows`."""

    # `flows.Flows.spread` reads the first two.
    ROWS = SpreadAt.ROWS
    MICRO_STEPS = SpreadAt.STEPS  # steps of splitting from the end of a turn to a row
    MACRO_TURNS = 2  # length of the macro-step in turns
    SIZE = 3


@dataclass(frozen=True)
class StrobeKernels:
    """Kernels of stroboscopic averaging; arguments are arrays of float64, or their addresses."""

    # (scheme, p, setting, weights, point, out): averaged fields per turn, one to each row of
    # `weights`, shape (rows, 3). A row of `out`, shape (rows, d + 1), is the sum over k = 1, 2, ...
    # of weight k times what k turns forth and k turns back from the point differ by.
    mean: Callable[..., None]
    # (scheme, p, setting, weights, point, table, stages, ends): stages of a Runge-Kutta step by the
    # averaged field, one a row of `stages`, shape (16, d + 1). `table` is the matrix A of the
    # method, and `ends` keeps the point at which the last stage was taken.
    macro: Callable[..., None]
    # (scheme, p, setting, terms, point, times, rests, rows): states at times within a macro-step
    # from `point` on, shape (rows, d). The interpolant of which `terms`, shape (7, d + 1), are the
    # coefficients gives the points at the ends of whole turns; from the nearest one a part of a
    # turn leads to a row. `rests` is room for that part, a time, of each row.
    rows: Callable[..., None]


@once()
def strobe_kernels(parts: Parts, dimension: int) -> StrobeKernels:
    """Compile the kernels of stroboscopic averaging."""
    flows = Flows(parts, dimension)
    turn = _turn(flows)
    mean = _mean(flows, turn)
    programs = flows.prepare, turn, flows.spread, mean, _macro(dimension, mean), _rows(flows)
    return StrobeKernels(*compiled(*programs))


@dataclass(frozen=True)
class _Side:
    """One of two turns that are taken at once, forth or back.

    Neither waits for the other: a processor computes both in little more than the time of one.
    """

    sign: float  # 1.0 forth, -1.0 back
    point: Array  # where the turn begins, overwritten by where it ends
    state: Array  # on the way
    angle: Array  # cell: the angle turned so far, in rad, negative backwards
    constants: Array  # of the flows in one of the equal steps
    closing: Array  # of the flows in the step that closes the turn


def _turn(flows: Flows) -> Program:
    """One turn of the fast angle, forth from the first of two points and back from the second.

    Each takes `steps` equal steps of the scheme, of time `h` forth and `-h` back, which turn by
    nearly 2π. A short step of the scheme turns the rest of the angle at the rate reached. As the rate
    changes a little on the way, a still shorter step of Strang's splitting turns the angle left then.
    `points` holds the point that goes forth, then the one that goes back. The steps and their times::

        | step | step | ... | step | closing step | half fast, slow, half fast |
          h      h            h      first rest     last rest
    """
    program = Program("turn", "scheme p forth back points", "steps h", "internal")
    scheme, p, forth, back, points, steps, h = program.arguments
    fast = flows.parts.fast
    slow = flows.parts.slow
    dimension = flows.dimension
    sides = []
    for sign, point, constants in ((1.0, points, forth), (-1.0, points + (dimension + 1), back)):
        side = _Side(
            sign=sign,
            point=point,
            state=program.room(dimension),
            angle=program.cell(0.0),
            constants=constants,
            closing=flows.constants(program),
        )
        sides.append(side)
    strang = flows.constants(program)
    for side in sides:
        side.state.store(side.point.load(dimension))

    def fast_flow(side: _Side, constants: Array, time: Number) -> None:
        """Advance by the fast flow, and the angle by its rate, which that flow keeps."""
        side.angle[0] = side.angle[0] + flows.rate(side.state, p) * time
        flows.fast_flow(side.state, constants)

    def step(step_constants: list[Array], step_times: list[Number]) -> None:
        """A step of the scheme on each side, with its own constants and length in time."""
        moves = list(zip(sides, step_constants, step_times, strict=True))
        with program.times(stages_of(scheme)) as i:
            for side, rows, time in moves:
                fast_flow(side, flows.row(rows, i), time * fast_share_of(scheme, i))
            for side, rows, _ in moves:
                flows.slow_flow(side.state, flows.row(rows, i))
        for side, rows, time in moves:
            row = flows.row(rows, stages_of(scheme))
            fast_flow(side, row, time * fast_share_of(scheme, stages_of(scheme)))

    def rest(side: _Side) -> Number:
        """The time that closes the turn at the present rate."""
        return (side.sign * 2 * pi - side.angle[0]) / flows.rate(side.state, p)

    # The equal steps.
    with program.times(steps):
        step([side.constants for side in sides], [h, -1.0 * h])
    # The step that closes the turn at the rate reached.
    first_rests = [rest(side) for side in sides]
    for side, time in zip(sides, first_rests, strict=True):
        program.call(flows.prepare, scheme, p, side.closing, time)
    step([side.closing for side in sides], first_rests)
    passed = [side.sign * steps * h + time for side, time in zip(sides, first_rests, strict=True)]
    # Strang's splitting turns the angle that is left after that.
    last_rests = [rest(side) for side in sides]
    for side, time_passed, time in zip(sides, passed, last_rests, strict=True):
        strang.store(fast.constants(p, 0.5 * time, OPERATIONS))
        flows.slow_constants(strang).store(slow.constants(p, time, OPERATIONS))
        fast_flow(side, strang, 0.5 * time)
        flows.slow_flow(side.state, strang)
        fast_flow(side, strang, 0.5 * time)
        end_time = side.point[dimension] + time_passed + time
        side.point.store([*side.state.load(dimension), end_time])
    return program


def _mean(flows: Flows, turn: Program) -> Program:
    """`StrobeKernels.mean`.

    After k turns forth and back, the difference of the two points is added to each row of `out`
    with that row's weight k::

        weights, a row:  | weight 1 | weight 2 | weight 3 |   one per number of turns k
        out, a row:      | d components of the state | time |  per turn
        moved:           | point k turns forth | point k turns back |
    """
    program = Program("mean", "scheme p setting weights point out")
    scheme, p, setting, weights, point, out = program.arguments
    dimension = flows.dimension
    forth = flows.constants(program)
    back = flows.constants(program)
    size = dimension + 1
    # Two points, moved k turns forth and k turns back, whose time is counted from 0.
    moved = program.room(2 * size)
    steps, turns, rows = setting.load(MeanAt.SIZE)
    with program.times(rows * float(size)) as i:
        out[i] = 0.0
    # Steps turn by 2π together at the rate of the point.
    h = 2 * pi / (flows.rate(point, p) * steps)
    for i, (constants, sign) in enumerate(((forth, 1.0), (back, -1.0))):
        program.call(flows.prepare, scheme, p, constants, sign * h)
        (moved + i * size).store([*point.load(dimension), 0.0])
    with program.times(turns) as k:
        program.call(turn, scheme, p, forth, back, moved, steps, h)
        with program.times(rows) as row:
            weight = weights[row * float(_MAX_DIFFERENCE_TURNS) + k]
            field = out + row * float(size)
            for i in range(size):
                field[i] = field[i] + weight * (moved[i] - moved[size + i])
    return program


def _macro(dimension: int, mean: Program) -> Program:
    """`StrobeKernels.macro`.

    Stage s is the averaged field at the point plus the macro-step times the sum over j < s of
    entry (s, j) of `table` times stage j: an explicit Runge-Kutta method.
    """
    program = Program("macro", "scheme p setting weights point table stages ends")
    scheme, p, setting, weights, point, table, stages, ends = program.arguments
    stage = program.cell(setting[MacroAt.STAGE])
    size = float(dimension + 1)
    with program.repeat() as leave:
        s = stage[0]
        leave(compare("oge", s, setting[MacroAt.STAGES_END]))
        ends.store(point.load(dimension + 1))
        with program.times(s) as j:
            weight = setting[MacroAt.MACRO_TURNS] * table[s * float(_TABLE_COLUMNS) + j]
            for i in range(dimension + 1):
                ends[i] = ends[i] + weight * stages[j * size + float(i)]
        program.call(mean, scheme, p, setting, weights, ends, stages + s * size)
        stage[0] = s + 1.0
    return program


def nearest_whole(x: Number) -> Number:
    """The whole number next to x, for ``|x| < 2**51``."""
    return (x + _ROUNDS_TO_WHOLE) - _ROUNDS_TO_WHOLE


def _interpolated(terms: Array, component: int, size: int, x: Number) -> Number:
    """Gain of a component of the point in the share x of a macro-step, by DOP853's interpolant.

    It is ``x (F0 + (1 - x) (F1 + x (F2 + ...)))``, where row k of `terms` is Fk.
    """
    value: Any = 0.0
    for k in reversed(range(TERMS)):
        value = (value + terms[k * size + component]) * (1.0 - x if k % 2 else x)
    return value


def _rows(flows: Flows) -> Program:
    """`StrobeKernels.rows`.

    For each row: guess the number of whole turns to it and look at which time they end. Correct the
    guess by the turns from there to the row, until these are few enough.
    """
    program = Program("rows", "scheme p setting terms point times rests rows")
    scheme, p, setting, terms, point, times, rests, rows = program.arguments
    dimension = flows.dimension
    macro_turns = setting[RowsAt.MACRO_TURNS]
    # The point at the end of whole turns.
    at = program.room(dimension + 1)
    size = dimension + 1
    # Whole turns from the beginning of the macro-step, turns from there to the row, trials.
    whole_turns = program.cell(0.0)
    turns_off = program.cell(0.0)
    trials = program.cell(0.0)
    with program.times(setting[RowsAt.ROWS]) as j:
        # The first term of the interpolant is the gain over the step, here of time.
        turns_off[0] = macro_turns * (times[j] - point[dimension]) / terms[dimension]
        whole_turns[0] = trials[0] = 0.0
        with program.repeat() as leave:
            whole_turns[0] = whole_turns[0] + nearest_whole(turns_off[0])
            x = whole_turns[0] / macro_turns
            for i in range(size):
                at[i] = point[i] + _interpolated(terms, i, size, x)
            rests[j] = times[j] - at[dimension]
            turns_off[0] = rests[j] * flows.rate(at, p) / (2 * pi)
            trials[0] = trials[0] + 1.0
            leave(compare("ole", turns_off[0] * turns_off[0], MAX_TURNS_TO_ROW**2))
            # It stays so after the last trial: `spread` makes the row NaN.
            rests[j] = nan
            leave(compare("oge", trials[0], _MAX_TRIALS))
        (rows + j * float(dimension)).store(at.load(dimension))
    program.call(flows.spread, scheme, p, setting, rests, rows)
    return program

"""Machine code of stroboscopic averaging: turns, their differences, macro-steps and rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan, pi

from polhode.models.once import once
from polhode.models.problem import Parts
from polhode.solvers.machine_code.program import Array, Program, compare, compiled
from polhode.solvers.machine_code.tracing import OPERATIONS, Number
from polhode.solvers.parts.flows import Flows

# Most turns between a row and the point of whole turns from which it is reached.
MAX_TURNS_TO_ROW = 0.505
# Trials to find that point, after which the row is NaN.
_TRIALS = 20.0
# Terms of DOP853's interpolant.
TERMS = 7
# A number beside which others are rounded to whole ones.
_WHOLE = 1.5 * 2.0**52
# Most turns of which the averaged field takes differences.
_MOST_TURNS = 3
# Stages in a row of a Runge-Kutta table.
_TABLE = 16


@dataclass(frozen=True)
class StrobeKernels:
    """Kernels of stroboscopic averaging; a point is a state with its time behind it."""

    # (scheme, p, setting, weights, point, out): weighted sums, a row of weights each, of
    # differences of the map of 1, 2, ... turns: the averaged field, per turn. `setting` holds the
    # steps of a turn, the turns, the rows.
    mean: Callable[..., None]
    # (scheme, p, setting, weights, point, table, stages, ends): stages of a Runge-Kutta step by the
    # averaged field, the last one taken at `ends`; `setting` holds besides the first stage, the one
    # behind the last, the turns in the step.
    macro: Callable[..., None]
    # (scheme, p, setting, terms, point, times, rests, rows): rows at times within a macro-step from
    # `point` on. An interpolant gives the points at the ends of whole turns; from the nearest one a
    # part of a turn leads to a row. `setting` holds the rows, the steps to each, the turns in the
    # step; `rests` is room for a number of each row.
    rows: Callable[..., None]


@once()
def strobe_kernels(parts: Parts, dimension: int) -> StrobeKernels:
    """Compile the kernels of stroboscopic averaging."""
    flows = Flows(parts, dimension)
    turn = _turn(flows)
    mean = _mean(flows, turn)
    programs = flows.prepare, turn, flows.spread, mean, _macro(dimension, mean), _rows(flows)
    return StrobeKernels(*compiled(*programs))


def _turn(flows: Flows) -> Program:
    """One turn of the fast angle, forth for the first point and back for the second, at once."""
    # Each takes `steps` steps, and two short ones that close it: one of the scheme, and one of
    # Strang for the angle that this leaves.
    program = Program("turn", "scheme p forth back points", "steps h", "internal")
    scheme, p, forth, back, points, steps, h = program.arguments
    fast = flows.parts.fast
    slow = flows.parts.slow
    dimension = flows.dimension
    states = [program.room(dimension) for _ in range(2)]
    points = [points, points + (dimension + 1)]
    angles = [program.cell(0.0) for _ in range(2)]
    closing = [flows.constants(program) for _ in range(2)]
    ends = flows.constants(program)
    for y, point in zip(states, points, strict=True):
        y.store(point.load(dimension))

    def fast_flow(y: Array, angle: Array, row: Array, share: Number) -> None:
        angle[0] = angle[0] + flows.rate(y, p) * share
        flows.fast_flow(y, row)

    def step(side_constants: Sequence[Array], lengths: Sequence[Number]) -> None:
        sides = list(zip(states, angles, side_constants, lengths, strict=True))
        with program.times(scheme[0]) as i:
            for y, angle, constants, length in sides:
                fast_flow(y, angle, flows.row(constants, i), length * scheme[i + 1.0])
            for y, _, constants, _ in sides:
                flows.slow_flow(y, flows.row(constants, i))
        for y, angle, constants, length in sides:
            fast_flow(y, angle, flows.row(constants, scheme[0]), length * scheme[scheme[0] + 1.0])

    def left() -> list[Number]:
        """Times that close the turns at the present rates."""
        return [
            (sign * 2 * pi - angle[0]) / flows.rate(y, p)
            for y, angle, sign in zip(states, angles, (1.0, -1.0), strict=True)
        ]

    with program.times(steps):
        step((forth, back), (h, -1.0 * h))
    first = left()
    for constants, remaining in zip(closing, first, strict=True):
        program.call(flows.prepare, scheme, p, constants, remaining)
    step(closing, first)
    passed = [
        sign * steps * h + remaining for sign, remaining in zip((1.0, -1.0), first, strict=True)
    ]
    for y, angle, point, time, remaining in zip(
        states, angles, points, passed, left(), strict=True
    ):
        for part, shift, share in ((fast, 0, 0.5), (slow, flows.sizes[0], 1.0)):
            (ends + shift).store(part.constants(p, share * remaining, OPERATIONS))
        fast_flow(y, angle, ends, 0.5 * remaining)
        flows.slow_flow(y, ends)
        fast_flow(y, angle, ends, 0.5 * remaining)
        point.store([*y.load(dimension), point[dimension] + time + remaining])
    return program


def _mean(flows: Flows, turn: Program) -> Program:
    program = Program("mean", "scheme p setting weights point out")
    scheme, p, setting, weights, point, out = program.arguments
    dimension = flows.dimension
    sides = [flows.constants(program) for _ in range(2)]
    size = dimension + 1
    moved = program.room(2 * size)
    steps, turns, rows = setting.load(3)
    with program.times(rows * float(size)) as i:
        out[i] = 0.0
    h = 2 * pi / (flows.rate(point, p) * steps)
    for i, (constants, sign) in enumerate(zip(sides, (1.0, -1.0), strict=True)):
        program.call(flows.prepare, scheme, p, constants, sign * h)
        (moved + i * size).store([*point.load(dimension), 0.0])
    with program.times(turns) as k:
        program.call(turn, scheme, p, *sides, moved, steps, h)
        with program.times(rows) as row:
            weight = weights[row * float(_MOST_TURNS) + k]
            into = out + row * float(size)
            for i in range(size):
                into[i] = into[i] + weight * (moved[i] - moved[size + i])
    return program


def _macro(dimension: int, mean: Program) -> Program:
    program = Program("macro", "scheme p setting weights point table stages ends")
    scheme, p, setting, weights, point, table, stages, ends = program.arguments
    stage = program.cell(setting[3])
    size = float(dimension + 1)
    with program.repeat() as leave:
        s = stage[0]
        leave(compare("oge", s, setting[4]))
        ends.store(point.load(dimension + 1))
        with program.times(s) as j:
            weight = setting[5] * table[s * float(_TABLE) + j]
            for i in range(dimension + 1):
                ends[i] = ends[i] + weight * stages[j * size + float(i)]
        program.call(mean, scheme, p, setting, weights, ends, stages + s * size)
        stage[0] = s + 1.0
    return program


def _rows(flows: Flows) -> Program:
    program = Program("rows", "scheme p setting terms point times rests rows")
    scheme, p, setting, terms, point, times, rests, rows = program.arguments
    dimension = flows.dimension
    turns = setting[2]
    at = program.room(flows.dimension + 1)
    size = dimension + 1
    whole = program.cell(0.0)
    off = program.cell(0.0)
    tried = program.cell(0.0)
    with program.times(setting[0]) as j:
        off[0] = turns * (times[j] - point[dimension]) / terms[dimension]
        whole[0] = tried[0] = 0.0
        with program.repeat() as leave:
            whole[0] = whole[0] + ((off[0] + _WHOLE) - _WHOLE)
            x = whole[0] / turns
            for i in range(size):
                value = 0.0
                for k in reversed(range(TERMS)):
                    value = (value + terms[k * size + i]) * (1.0 - x if k % 2 else x)
                at[i] = point[i] + value
            rests[j] = times[j] - at[dimension]
            off[0] = rests[j] * flows.rate(at, p) / (2 * pi)
            tried[0] = tried[0] + 1.0
            leave(compare("ole", off[0] * off[0], MAX_TURNS_TO_ROW**2))
            rests[j] = nan
            leave(compare("oge", tried[0], _TRIALS))
        (rows + j * float(dimension)).store(at.load(dimension))
    program.call(flows.spread, scheme, p, setting, rests, rows)
    return program

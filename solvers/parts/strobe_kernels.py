"""Machine code of stroboscopic averaging: turns, their central differences, the stages of a macro-step, its rows."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import pi

from polhode.models.problem import Parts
from polhode.solvers.machine_code.program import Array, Program, compare, compiled
from polhode.solvers.machine_code.tracing import OPERATIONS, Number
from polhode.solvers.parts.kernels import Pieces

# Turns of which the averaged field takes differences, at most; stages in a row of a Runge-Kutta table.
MOST_TURNS, TABLE = 3, 16


@dataclass(frozen=True)
class StrobeKernels:
    """Those of stroboscopic averaging; a point is a state with its time behind it."""

    # As of `Kernels`.
    spread: Callable[..., None]
    # (scheme, p, setting, weights, point, out): weighted sums, a row of weights each, of differences of the map of 1,
    # 2, ... turns: the averaged field, per turn. `setting` holds the steps of a turn, the turns, the rows.
    mean: Callable[..., None]
    # (scheme, p, setting, weights, point, table, stages, ends): stages of a Runge-Kutta step by the averaged field, the
    # last one taken at `ends`; `setting` holds besides the first stage, the one behind the last, the turns in the step.
    macro: Callable[..., None]


@cache
def strobe_kernels(parts: Parts, dimension: int) -> StrobeKernels:
    """Compile those of stroboscopic averaging."""
    pieces = Pieces(parts, dimension)
    turn = _turn(pieces)
    mean = _mean(pieces, turn)
    return StrobeKernels(*compiled(pieces.prepare, turn, pieces.spread, mean, _macro(dimension, mean)))


def _turn(pieces: Pieces) -> Program:
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
    full = OPERATIONS.where_positive(h, 2 * pi, -2 * pi)
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


def _mean(pieces: Pieces, turn: Program) -> Program:
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

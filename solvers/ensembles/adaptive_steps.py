"""Averaged forms for many particles at once: Dormand and Prince's pair in SIMD lanes.

Each particle has its own steps.

A Taylor series would be the wrong method here: every run of an ellipsoid that starts on the
long-axis side crosses L² = 2EI₂. There the averaged field is continuous but not Lipschitz, no
series converges, and the step shrinks to nothing; a Runge–Kutta step goes across.

A tried step is a map of the row (y, rates of y, its bend, time, next step). The bend is the change
of y by `BENDS`: if it is 0, dense output is the cubic through the two states and rates of a step.
"""

import tomllib
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from polhode.models.libraries import installed
from polhode.models.once import once
from polhode.models.operations import ARRAYS
from polhode.models.problem import Factory, Problem
from polhode.solvers.compile import parameter_array
from polhode.solvers.contract import Status
from polhode.solvers.ensembles.methods import Array, change, moved
from polhode.solvers.ensembles.one_by_one import run_one_by_one
from polhode.solvers.machine_code.lanes import Lanes, lanes
from polhode.solvers.machine_code.program import Program, compare, compiled, width
from polhode.solvers.machine_code.tracing import OPERATIONS

_TABLE = tomllib.loads(Path(__file__).with_name("dormand_prince.toml").read_text(encoding="utf-8"))


def _numbers(fractions: Sequence[str]) -> list[float]:
    return [float(Fraction(fraction)) for fraction in fractions]


# Shares of slopes in each stage, in the error estimate, and in the bend.
STAGES = [_numbers(row) for row in _TABLE["stages"]]
DIFFERENCE = _numbers(_TABLE["difference"])
BENDS = _numbers(_TABLE["bends"])
# Share of the step that the error asks for.
_SAFETY = 0.9
# Bounds of the factor by which a step changes.
_LEAST_FACTOR = 0.2
_GREATEST_FACTOR = 5.0
# The first step over the run's duration.
_FIRST_STEP = 1e-2
# The step over the run's duration below which a particle has failed.
_LEAST_STEP = 1e-15
# A particle is given up after this many steps over tolerance^(1/5) and further ones per relaxation
# time: three times the steps of the slowest of 20 000. If L shrinks to nothing, averaging breaks
# down, E falls below the tolerance, and steps stay tiny without end.
_MOST_STEPS = 16.0
# Further steps per relaxation time, which stability asks for.
_STEPS_PER_RELAXATION = 4.0
# Particles under way at once.
AT_ONCE = 1024
# Steps after which particles that have arrived are replaced.
_STEPS = 8
# Square of a relative error that is as good as none.
_NOTHING = 1e-12


def run_adaptive(
    problem: Problem, starts: Array, times: Array, tolerance: float
) -> tuple[Array, Array]:
    """Solve a problem from starts, shape (n, d): states, shape (m, n, d), and statuses.

    States are NaN from the time on at which a particle failed. The times increase from 0 to the
    end; the tolerance is of the local error per step, absolute below 1 and relative above, in the
    Euclidean norm. Source: Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19; Shampine's
    fourth-order interpolation. Without llvmlite the particles run one by one, by another solver.
    """
    if not installed("llvmlite"):
        return run_one_by_one(problem, starts, times, tolerance)
    n, d = starts.shape
    end = float(times[-1])
    parameters = parameter_array(problem)
    code = _stepper(problem.field, d, len(parameters))
    fill = _filler(d, width())
    constants = np.array([tolerance, end, *parameters])
    with np.errstate(all="ignore"):
        rates = np.stack(np.broadcast_arrays(*problem.field(ARRAYS)(starts.T, parameters)), axis=1)
        pace = np.nanmedian(np.abs(rates).max(axis=1) / np.abs(starts).max(axis=1))
    most = _MOST_STEPS * tolerance**-0.2 + _STEPS_PER_RELAXATION * end * float(pace)
    fresh = np.column_stack([starts, rates, np.zeros((n, d + 1)), np.full(n, _FIRST_STEP * end)])
    # Particle by particle in memory: a step fills rows that lie side by side.
    states = np.full((n, len(times), d), np.nan)
    states[:, 0] = starts
    statuses = np.array([str(Status.REACHED_END)], dtype=object).repeat(n)
    due = np.ones(n)
    tried = np.zeros(n)
    index = np.arange(0)
    rows = fresh[:0]
    begun = 0
    while begun < n or len(index):
        more = np.arange(begun, min(n, begun + AT_ONCE - len(index)))
        index = np.append(index, more)
        rows = np.concatenate([rows, fresh[more]])
        begun = begun + len(more)
        path = code.march(rows, _STEPS + 1, constants, 1)
        first = np.arange(len(index)) // width() * path[0].size + np.arange(len(index)) % width()
        counts = np.array([len(index), len(times)], dtype=float)
        fill(path, first.astype(float), index.astype(float), times, due, states, counts)
        rows = path[:, -1].swapaxes(1, 2).reshape(-1, rows.shape[1])[: len(index)]
        tried[index] += _STEPS
        unfinished = due[index] < len(times)
        vanished = ~(rows[:, -1] > _LEAST_STEP * end)
        endless = tried[index] >= most
        statuses[index[unfinished & endless]] = str(Status.STEP_LIMIT)
        statuses[index[unfinished & vanished]] = str(Status.STEP_UNDERFLOW)
        under_way = unfinished & ~vanished & ~endless
        index = index[under_way]
        rows = rows[under_way]
    return states.swapaxes(0, 1), statuses


@once()
def _stepper(field: Factory, dimension: int, parameters: int) -> Lanes:
    """A tried step; its constants are the tolerance, the end, and the field's parameters."""
    rhs = field(OPERATIONS)
    sqrt = OPERATIONS.sqrt
    where = OPERATIONS.where_positive

    def step(row: Sequence[Any], c: Sequence[Any]) -> Sequence[Any]:
        y = row[:dimension]
        rates = row[dimension : 2 * dimension]
        time, wish = row[3 * dimension :]
        tolerance = c[0]
        end = c[1]
        p = c[2:]
        left = end - time
        last = wish - left
        h = where(last, left, wish)
        slopes: list[Sequence[Any]] = [rates]
        new = y
        for shares in STAGES:
            new = moved(y, h, shares, slopes)
            slopes.append(rhs(new, p))
        square = _NOTHING
        for before, error in zip(y, change(h, DIFFERENCE, slopes), strict=True):
            size = where(before, before, -before)
            share = error / (tolerance * where(size - 1, size, 1.0))
            square = square + share * share
        # The error's power -3/16: nearly the -1/5 of theory, by roots alone. NaN gives the least
        # factor.
        eighth = sqrt(sqrt(sqrt(square)))
        factor = _SAFETY * sqrt(sqrt(eighth)) / eighth
        factor = where(
            _GREATEST_FACTOR - factor,
            where(factor - _LEAST_FACTOR, factor, _LEAST_FACTOR),
            _GREATEST_FACTOR,
        )
        factor = where(square, factor, _LEAST_FACTOR)
        arrived = where(last, end, time + h)

        def taken(news: Sequence[Any], olds: Sequence[Any]) -> list[Any]:
            return [where(1 - square, new, old) for new, old in zip(news, olds, strict=True)]

        return [
            *taken(new, y),
            *taken(slopes[-1], rates),
            *change(h, BENDS, slopes),
            *taken([arrived], [time]),
            where(left, h * factor, end),
        ]

    return lanes(step, 3 * dimension + 2, 2 + parameters)


@once()
def _filler(dimension: int, wide: int) -> Callable[..., None]:
    """A function that fills the rows that steps in lanes have passed, and counts the next row."""
    # Particle k of `counts[0]` begins in `path` at `first[k]`, and is number `index[k]` in `due`
    # and `states`.
    size = 3 * dimension + 2
    program = Program("fill", "path first index times due states counts")
    path, first, index, times, due, states, counts = program.arguments
    particles, rows = counts.load(2)
    with program.times(particles) as particle:
        at = path + first[particle]
        whose = index[particle]
        place = program.cell(due[whose])
        out = states + whose * rows * dimension
        with program.times(_STEPS) as step:
            before = at + step * (size * wide)
            after = before + size * wide
            time, arrived = (numbers[3 * dimension * wide] for numbers in (before, after))
            with program.repeat() as leave:
                row = place[0]
                leave(compare("oge", row, rows))
                leave(compare("ogt", times[row], arrived))
                h = arrived - time
                share = (times[row] - time) / h
                complement = 1 - share
                filled = out + row * dimension
                for i in range(dimension):
                    y, rate = (before[(i + k * dimension) * wide] for k in (0, 1))
                    new, slope, bend = (after[(i + k * dimension) * wide] for k in (0, 1, 2))
                    rise = new - y
                    cubic = complement * (h * rate - rise) - share * (h * slope - rise)
                    filled[i] = y + share * (
                        rise + complement * (cubic + share * complement * bend)
                    )
                place[0] = row + 1.0
        due[whose] = place[0]
    (function,) = compiled(program)
    return function

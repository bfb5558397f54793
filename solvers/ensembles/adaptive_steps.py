"""Averaged forms for many particles at once: Dormand and Prince's pair in SIMD lanes.

Each particle has its own steps.

A Taylor series would be the wrong method here: every run of an ellipsoid that starts on the
long-axis side crosses L² = 2EI₂. There the averaged field is continuous but not Lipschitz, no
series converges, and the step shrinks to nothing; a Runge–Kutta step goes across.

A tried step is a map of a particle's *row*: its state, rates, bend, time and next step, at the
places that `_RowAt` names. The bend is the change of the state by `BENDS`: if it is 0, dense output
is the cubic through the two states and rates of a step. A step whose error is too large leaves
state, rates and time as they are, and makes the next step smaller.

Particles are under way in lanes, `AT_ONCE` at most. After `_STEPS` tried steps the rows that they
passed are filled, and particles that arrived or failed make room for others.
"""

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
# Estimates here change the number of steps, and thereby the time. The tolerance alone decides the error
# that a step may make.
#
# Share of the step that the error asks for; an estimate.
_SAFETY = 0.9
# Bounds of the factor by which a step changes; estimates.
_LEAST_FACTOR = 0.2
_GREATEST_FACTOR = 5.0
# The first step over the run's duration; an estimate.
_FIRST_STEP = 1e-2
# The step over the run's duration below which a particle has failed: a few roundings of the time.
_LEAST_STEP = 1e-15
# A particle is given up after this many steps over tolerance^(1/5) and further ones per relaxation
# time: three times the steps of the slowest of 20 000, which no command repeats. If L shrinks to nothing,
# averaging breaks down, E falls below the tolerance, and steps stay tiny without end.
_MOST_STEPS = 16.0
# Further steps per relaxation time; an estimate. Stability bounds a step by 3.3 such times, so that it asks
# for one in 3.3 alone.
_STEPS_PER_RELAXATION = 4.0
# Particles under way at once, whose path of `_STEPS` steps is a megabyte or two; an estimate.
AT_ONCE = 1024
# Steps after which particles that have arrived are replaced; an estimate. A lane that has arrived idles
# for as many at most.
_STEPS = 8
# Square of a relative error that is as good as none: keeps the factor of a step finite.
_NOTHING = 1e-12
# Places of a step's constants; the field's parameters stand behind them.
_TOLERANCE = 0
_END = 1
_PARAMETERS = 2


@dataclass(frozen=True)
class _RowAt:
    """Places in a particle's row, of d components: ``state (d) | rates (d) | bend (d) | time | step``."""

    dimension: int

    @property
    def rates(self) -> int:
        """First place of the state's rates; the state itself stands at 0."""
        return self.dimension

    @property
    def bend(self) -> int:
        """First place of the bend of the step that led to the state."""
        return 2 * self.dimension

    @property
    def time(self) -> int:
        """Place of the state's time."""
        return 3 * self.dimension

    @property
    def step(self) -> int:
        """Place of the next step to be tried, a time."""
        return 3 * self.dimension + 1

    @property
    def size(self) -> int:
        """Numbers in a row."""
        return 3 * self.dimension + 2


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
    at = _RowAt(d)
    end = float(times[-1])
    parameters = parameter_array(problem)
    code = _stepper(problem.field, d, len(parameters))
    fill = _filler(d, width())
    constants = np.array([tolerance, end, *parameters])
    rates, pace = _rates_and_pace(problem, starts, parameters)
    max_steps = _MOST_STEPS * tolerance**-0.2 + _STEPS_PER_RELAXATION * end * pace
    # Rows of particles that have not begun: no bend, time 0.
    fresh = np.zeros((n, at.size))
    fresh[:, :d] = starts
    fresh[:, at.rates : at.bend] = rates
    fresh[:, at.step] = _FIRST_STEP * end
    # Particle by particle in memory: a step fills rows that lie side by side.
    states = np.full((n, len(times), d), np.nan)
    states[:, 0] = starts
    statuses = np.array([str(Status.REACHED_END)], dtype=object).repeat(n)
    # For each particle: index of the next time to be filled, and number of steps tried.
    due = np.ones(n)
    tried = np.zeros(n)
    # Particles under way, and their rows; and how many have begun.
    index = np.arange(0)
    rows = fresh[:0]
    begun = 0
    while begun < n or len(index):
        more = np.arange(begun, min(n, begun + AT_ONCE - len(index)))
        index = np.append(index, more)
        rows = np.concatenate([rows, fresh[more]])
        begun = begun + len(more)
        # Shape (groups, _STEPS + 1, row size, width): row by row of each group of lanes.
        path = code.march(rows, _STEPS + 1, constants, 1)
        group, lane = np.divmod(np.arange(len(index)), width())
        # Index in numbers at which each particle's path begins.
        first = group * path[0].size + lane
        counts = np.array([len(index), len(times)], dtype=float)
        fill(path, first.astype(float), index.astype(float), times, due, states, counts)
        rows = path[:, -1].swapaxes(1, 2).reshape(-1, at.size)[: len(index)]
        tried[index] += _STEPS
        unfinished = due[index] < len(times)
        # NaN counts as vanished.
        vanished = ~(rows[:, at.step] > _LEAST_STEP * end)
        endless = tried[index] >= max_steps
        statuses[index[unfinished & endless]] = str(Status.STEP_LIMIT)
        statuses[index[unfinished & vanished]] = str(Status.STEP_UNDERFLOW)
        under_way = unfinished & ~vanished & ~endless
        index = index[under_way]
        rows = rows[under_way]
    return states.swapaxes(0, 1), statuses


def _rates_and_pace(problem: Problem, starts: Array, parameters: Array) -> tuple[Array, float]:
    """Rates at the starts, shape (n, d), and the inverse of a time of relaxation.

    That is the median over the particles of the largest rate over the largest component.
    """
    with np.errstate(all="ignore"):
        rates = np.stack(np.broadcast_arrays(*problem.field(ARRAYS)(starts.T, parameters)), axis=1)
        paces = np.abs(rates).max(axis=1) / np.abs(starts).max(axis=1)
        return rates, float(np.nanmedian(paces))


@once()
def _stepper(field: Factory, dimension: int, parameters: int) -> Lanes:
    """A tried step of a row; its constants stand at `_TOLERANCE`, `_END` and from `_PARAMETERS` on."""
    rhs = field(OPERATIONS)
    sqrt = OPERATIONS.sqrt
    where = OPERATIONS.where_positive
    at = _RowAt(dimension)

    def step(row: Sequence[Any], c: Sequence[Any]) -> Sequence[Any]:
        y = row[:dimension]
        rates = row[at.rates : at.bend]
        time = row[at.time]
        wish = row[at.step]
        tolerance = c[_TOLERANCE]
        end = c[_END]
        p = c[_PARAMETERS:]
        left = end - time
        # Positive in a step that would go beyond the end.
        beyond = wish - left
        h = where(beyond, left, wish)
        slopes: list[Sequence[Any]] = [rates]
        new = y
        for shares in STAGES:
            new = moved(y, h, shares, slopes)
            slopes.append(rhs(new, p))
        # Square of the error over the allowed one.
        square = _NOTHING
        for before, error in zip(y, change(h, DIFFERENCE, slopes), strict=True):
            size = where(before, before, -before)
            share = error / (tolerance * where(size - 1, size, 1.0))
            square = square + share * share
        # The error's power -3/16: nearly the -1/5 of theory, by roots alone; `eighth` is its power
        # 1/4, the square's 1/8. NaN gives the least factor.
        eighth = sqrt(sqrt(sqrt(square)))
        factor = _SAFETY * sqrt(sqrt(eighth)) / eighth
        factor = where(
            _GREATEST_FACTOR - factor,
            where(factor - _LEAST_FACTOR, factor, _LEAST_FACTOR),
            _GREATEST_FACTOR,
        )
        factor = where(square, factor, _LEAST_FACTOR)
        arrived = where(beyond, end, time + h)

        def taken(news: Sequence[Any], olds: Sequence[Any]) -> list[Any]:
            """The new numbers if the error is small enough, else the old ones."""
            return [where(1 - square, new, old) for new, old in zip(news, olds, strict=True)]

        return [
            *taken(new, y),
            *taken(slopes[-1], rates),
            *change(h, BENDS, slopes),
            *taken([arrived], [time]),
            # A particle that has arrived keeps a step that has not vanished.
            where(left, h * factor, end),
        ]

    return lanes(step, at.size, _PARAMETERS + parameters)


@once()
def _filler(dimension: int, wide: int) -> Callable[..., None]:
    """A function that fills the rows that steps in lanes have passed, and counts the next row.

    Its arguments are `path`, the rows of all steps in lanes of width `wide`; `first`, where a
    particle's path begins in it; `index`, the particle's number in `due` and `states`; `times`;
    `due`, the next time to be filled; `states`; and the number of particles and of times.
    """
    at = _RowAt(dimension)
    program = Program("fill", "path first index times due states counts")
    path, first, index, times, due, states, counts = program.arguments
    particles, time_count = counts.load(2)
    with program.times(particles) as particle:
        start = path + first[particle]
        whose = index[particle]
        place = program.cell(due[whose])
        out = states + whose * time_count * dimension
        with program.times(_STEPS) as step:
            # The particle's row before and after the step; a number of it is a whole width apart
            # from the next one.
            before = start + step * (at.size * wide)
            after = before + at.size * wide
            time = before[at.time * wide]
            arrived = after[at.time * wide]
            with program.repeat() as leave:
                row = place[0]
                leave(compare("oge", row, time_count))
                leave(compare("ogt", times[row], arrived))
                h = arrived - time
                share = (times[row] - time) / h
                complement = 1 - share
                filled = out + row * dimension
                for i in range(dimension):
                    y = before[i * wide]
                    rate = before[(at.rates + i) * wide]
                    new = after[i * wide]
                    slope = after[(at.rates + i) * wide]
                    bend = after[(at.bend + i) * wide]
                    rise = new - y
                    cubic = complement * (h * rate - rise) - share * (h * slope - rise)
                    filled[i] = y + share * (
                        rise + complement * (cubic + share * complement * bend)
                    )
                place[0] = row + 1.0
        due[whose] = place[0]
    (function,) = compiled(program)
    return function

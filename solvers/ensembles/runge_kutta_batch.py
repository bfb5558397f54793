"""Averaged forms for many particles at once: Dormand and Prince's pair, each particle with its own steps.

The field is the traced one, compiled by heyoka for whole arrays (SIMD). A Taylor series would be the wrong method here:
on L² = 2EI₂, which every run of an ellipsoid that starts on the long-axis side crosses, the averaged field is
continuous but not Lipschitz, no series converges, and the step shrinks to nothing; a Runge–Kutta step goes across.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import FieldFactory, load_heyoka, traced_system
from polhode.solvers.contract import Status

SAFETY, LEAST_FACTOR, GREATEST_FACTOR = 0.9, 0.2, 5.0
# Of the run's duration: the first step, and the step below which a particle has failed.
FIRST_STEP, LEAST_STEP = 1e-2, 1e-15
# A particle is given up after this many steps over tolerance^(1/5), and this many per relaxation time besides, which
# stability asks for: three times what the slowest of 20 000 took. Where L shrinks to nothing, averaging breaks down, E
# loses to the tolerance what L² leaves of it, and steps stay tiny without end.
MOST_STEPS, STEPS_PER_RELAXATION = 16.0, 4.0
# Particles under way at once: enough that NumPy's calls cost little, few enough for the processor's cache.
WIDTH = 4096
# Finished particles are replaced when they make up this share of those under way.
REFILL = 1 / 8

ArrayField = Callable[[np.ndarray, np.ndarray], None]


@dataclass
class _Front:
    """Particles under way; the last index of every array counts them, `due` is the row that each fills next."""

    index: np.ndarray
    time: np.ndarray
    step: np.ndarray
    state: np.ndarray
    rate: np.ndarray
    due: np.ndarray
    tried: np.ndarray

    def exchange(self, kept: np.ndarray, new: "_Front") -> None:
        """Drop all but the kept ones and take in new ones."""
        for name, values in vars(self).items():
            setattr(self, name, np.concatenate([values[..., kept], getattr(new, name)], axis=-1))


def run_vectorised(
    problem: Problem, starts: np.ndarray, times: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Solve a problem from many starts.

    Source: Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19; Shampine's fourth-order interpolation; the
    coefficients are SciPy's.

    Parameters
    ----------
    problem : Problem
        Its own start is not used.
    starts : ndarray, shape (n, d)
    times : ndarray, shape (m,)
        Increasing, from 0 to the end, in the problem's own time.
    tolerance : float
        Of the local error per step, absolute below 1 and relative above, in the maximum norm.

    Returns
    -------
    states : ndarray, shape (m, n, d)
        NaN from where a particle failed.
    statuses : ndarray of str, shape (n,)
    """
    return integrate(array_field(problem), starts, times, tolerance)


def integrate(
    field: ArrayField, starts: np.ndarray, times: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Do what `run_vectorised` does, of a field."""
    # Particle by particle in memory: a step fills rows that lie side by side.
    states = np.full((len(starts), len(times), starts.shape[1]), np.nan)
    states[:, 0] = starts
    statuses = np.full(len(starts), str(Status.REACHED_END), dtype=object)
    end, begun = float(times[-1]), min(WIDTH, len(starts))
    front = _enter(field, starts, 0, begun, end)
    most = _most_steps(front, end, tolerance)
    while front.index.size:
        _step(front, field, times, tolerance, states)
        unfinished = front.due < len(times)
        vanished, endless = ~(front.step > LEAST_STEP * end), front.tried >= most
        statuses[front.index[unfinished & endless]] = str(Status.STEP_LIMIT)
        statuses[front.index[unfinished & vanished]] = str(Status.STEP_UNDERFLOW)
        under_way = unfinished & ~vanished & ~endless
        gone = len(under_way) - int(np.count_nonzero(under_way))
        if gone >= REFILL * len(under_way) or (gone and begun == len(starts)):
            more = min(gone, len(starts) - begun)
            front.exchange(under_way, _enter(field, starts, begun, begun + more, end))
            begun += more
    return states.swapaxes(0, 1), statuses


def array_field(problem: Problem) -> ArrayField:
    """The problem's field as a function of states, that fills rates; both of shape (d, n), contiguous."""
    parameters = np.array(problem.parameters, dtype=float)
    compiled = _compiled(problem.field, problem.dimension, len(parameters))
    repeated = np.empty((len(parameters), 0))

    def field(y: np.ndarray, rates: np.ndarray) -> None:
        nonlocal repeated
        if repeated.shape[1] != y.shape[1]:
            repeated = np.repeat(parameters[:, None], y.shape[1], axis=1)
        # Left to itself, heyoka shares wide arrays among all cores, which other tasks use.
        compiled(y, outputs=rates, pars=repeated, batch_parallel=False)

    return field


def _enter(field: ArrayField, starts: np.ndarray, first: int, last: int, end: float) -> _Front:
    state = np.ascontiguousarray(starts[first:last].T)
    n = last - first
    rate = np.empty_like(state)
    if n:
        field(state, rate)
    due, tried = np.ones(n, dtype=int), np.zeros(n, dtype=int)
    return _Front(np.arange(first, last), np.zeros(n), np.full(n, FIRST_STEP * end), state, rate, due, tried)


def _most_steps(front: _Front, end: float, tolerance: float) -> float:
    """Number of steps after which a particle is given up."""
    pace = np.max(np.abs(front.rate), axis=0) / np.max(np.abs(front.state), axis=0)
    return MOST_STEPS * tolerance**-0.2 + STEPS_PER_RELAXATION * end * float(np.nanmedian(pace))


def _step(front: _Front, field: ArrayField, times: np.ndarray, tolerance: float, states: np.ndarray) -> None:
    """Try one step of every particle; those that succeed move on and fill the rows that they pass."""
    nodes, weights, error_weights, dense = _pair()
    advance, weigh, interpolate = _loops(len(front.state), *dense.shape)
    y, left = front.state, times[-1] - front.time
    h = np.minimum(front.step, left)
    slopes, new, ratio = np.empty((len(weights) + 1, *y.shape)), np.empty_like(y), np.empty_like(h)
    slopes[0] = front.rate
    for stage, row in enumerate((*nodes, weights), start=1):
        advance(y, h, slopes, row, new)
        field(new, slopes[stage])
    weigh(new, h, slopes, error_weights, ratio)
    ratio /= tolerance
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.clip(SAFETY * ratio**-0.2, LEAST_FACTOR, GREATEST_FACTOR)
    front.step = h * np.where(np.isfinite(ratio), factor, LEAST_FACTOR)
    accepted = (ratio <= 1) & (left > 0)
    arrived = np.where(accepted, np.where(h < left, front.time + h, times[-1]), front.time)
    interpolate(y, h, slopes, dense, front.time, arrived, times, front.due, front.index, states)
    front.state = np.where(accepted, new, y)
    front.rate = np.where(accepted, slopes[-1], front.rate)
    front.time = arrived
    front.tried += 1


@cache
def _pair() -> tuple[list[np.ndarray], np.ndarray, np.ndarray, np.ndarray]:
    """Stages, weights, error weights and dense output of the pair."""
    from scipy.integrate import RK45

    nodes = [np.ascontiguousarray(row[:stage]) for stage, row in enumerate(RK45.A[1:], start=1)]
    return nodes, RK45.B, RK45.E, np.ascontiguousarray(RK45.P)


@cache
def _compiled(factory: FieldFactory, dimension: int, parameters: int) -> Any:
    system = traced_system(factory, dimension, parameters)
    return load_heyoka().cfunc([rate for _, rate in system], [variable for variable, _ in system])


@cache
def _loops(dimension: int, stages: int, degree: int) -> tuple[Callable[..., None], ...]:  # noqa: C901, three in one
    """The arithmetic of a step in compiled loops, which need none of NumPy's temporaries.

    States have shape (d, n), slopes (stages, d, n), steps h (n,). ``advance(y, h, slopes, weights, out)`` puts
    y + h Σ weights k into `out`; ``weigh(y, h, slopes, weights, out)`` the maximum of |h Σ weights k|/max(1, |y|) over
    components; ``interpolate(y, h, slopes, dense, time, arrived, times, due, index, states)`` fills each particle's
    rows of `states`, shape (particles, m, d), at its `index`, from `due` up to the time where it has arrived, and
    leaves in `due` the next one. `dense`, shape (stages, degree), makes of the slopes the coefficients of
    y + h Σ c share^(power + 1).
    """
    import numba

    number, whole = numba.float64, numba.int64
    flat, table, cube = number[::1], number[:, ::1], number[:, :, ::1]
    fixed = numba.types.Array(number, 1, "C", readonly=True)
    fixed2 = numba.types.Array(number, 2, "C", readonly=True)

    @numba.njit(numba.void(cube, fixed, whole, flat))
    def weighted(slopes, weights, i, row):  # noqa: ANN001, ANN202
        row[:] = 0.0
        for stage in range(len(weights)):
            weight, slope = weights[stage], slopes[stage, i]
            for j in range(len(row)):
                row[j] += weight * slope[j]

    @numba.njit(numba.void(table, flat, cube, fixed, table))
    def advance(y, h, slopes, weights, out):  # noqa: ANN001, ANN202
        for i in range(y.shape[0]):
            row = out[i]
            weighted(slopes, weights, i, row)
            for j in range(len(row)):
                row[j] = y[i, j] + h[j] * row[j]

    @numba.njit(numba.void(table, flat, cube, fixed, flat))
    def weigh(y, h, slopes, weights, out):  # noqa: ANN001, ANN202
        row = np.empty_like(out)
        out[:] = 0.0
        for i in range(y.shape[0]):
            weighted(slopes, weights, i, row)
            for j in range(len(row)):
                share = abs(row[j]) / max(1.0, abs(y[i, j]))
                # NaN stays NaN.
                out[j] = out[j] if share <= out[j] else share
        for j in range(len(row)):
            out[j] *= h[j]

    @numba.njit(numba.void(table, flat, cube, fixed2, flat, flat, fixed, whole[::1], whole[::1], cube))
    def interpolate(y, h, slopes, dense, time, arrived, times, due, index, states):  # noqa: ANN001, ANN202
        coefficients = np.empty((dimension, degree))
        for j in range(len(h)):
            if due[j] == len(times) or times[due[j]] > arrived[j]:
                continue
            for i in range(dimension):
                for power in range(degree):
                    total = 0.0
                    for stage in range(stages):
                        total += dense[stage, power] * slopes[stage, i, j]
                    coefficients[i, power] = total
            while due[j] < len(times) and times[due[j]] <= arrived[j]:
                share = (times[due[j]] - time[j]) / h[j]
                for i in range(dimension):
                    slope = 0.0
                    for power in range(degree):
                        slope = (slope + coefficients[i, degree - 1 - power]) * share
                    states[index[j], due[j], i] = y[i, j] + h[j] * slope
                due[j] += 1

    return advance, weigh, interpolate

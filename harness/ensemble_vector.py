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

ArrayField = Callable[[np.ndarray], np.ndarray]


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
    states = np.full((len(times), *starts.shape), np.nan)
    states[0] = starts
    statuses = np.full(len(starts), str(Status.REACHED_END), dtype=object)
    field, end = array_field(problem), float(times[-1])
    begun = min(WIDTH, len(starts))
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
    return states, statuses


def array_field(problem: Problem) -> ArrayField:
    """The problem's field as a function of states, shape (d, n), contiguous."""
    parameters = np.array(problem.parameters, dtype=float)
    compiled = _compiled(problem.field, problem.dimension, len(parameters))
    repeated = np.empty((len(parameters), 0))

    def field(y: np.ndarray) -> np.ndarray:
        nonlocal repeated
        if repeated.shape[1] != y.shape[1]:
            repeated = np.repeat(parameters[:, None], y.shape[1], axis=1)
        return compiled(y, pars=repeated)

    return field


def _enter(field: ArrayField, starts: np.ndarray, first: int, last: int, end: float) -> _Front:
    state = np.ascontiguousarray(starts[first:last].T)
    n = last - first
    rate = field(state) if n else state
    due, tried = np.ones(n, dtype=int), np.zeros(n, dtype=int)
    return _Front(np.arange(first, last), np.zeros(n), np.full(n, FIRST_STEP * end), state, rate, due, tried)


def _most_steps(front: _Front, end: float, tolerance: float) -> float:
    """Number of steps after which a particle is given up."""
    pace = np.max(np.abs(front.rate), axis=0) / np.max(np.abs(front.state), axis=0)
    return MOST_STEPS * tolerance**-0.2 + STEPS_PER_RELAXATION * end * float(np.nanmedian(pace))


def _step(front: _Front, field: ArrayField, times: np.ndarray, tolerance: float, states: np.ndarray) -> None:
    """Try one step of every particle; those that succeed move on and fill the rows that they pass."""
    nodes, weights, error_weights, dense = _pair()
    y, left = front.state, times[-1] - front.time
    h = np.minimum(front.step, left)
    slopes = np.empty((len(weights) + 1, *y.shape))
    flat = slopes.reshape(len(slopes), -1)
    slopes[0] = front.rate
    for stage, row in enumerate(nodes, start=1):
        slopes[stage] = field(y + h * (row[:stage] @ flat[:stage]).reshape(y.shape))
    new = y + h * (weights @ flat[:-1]).reshape(y.shape)
    slopes[-1] = field(new)
    error = np.abs((error_weights @ flat).reshape(y.shape)) / np.maximum(1, np.abs(new))
    ratio = np.max(error, axis=0) * h / tolerance
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.clip(SAFETY * ratio**-0.2, LEAST_FACTOR, GREATEST_FACTOR)
    front.step = h * np.where(np.isfinite(ratio), factor, LEAST_FACTOR)
    accepted = (ratio <= 1) & (left > 0)
    arrived = np.where(h < left, front.time + h, times[-1])
    passed = np.where(accepted, np.searchsorted(times, arrived, side="right") - front.due, 0)
    if np.any(passed):
        _fill(front, h, passed, (dense.T @ flat).reshape(-1, *y.shape), times, states)
        front.due += passed
    front.state = np.where(accepted, new, y)
    front.rate = np.where(accepted, slopes[-1], front.rate)
    front.time = np.where(accepted, arrived, front.time)
    front.tried += 1


def _fill(
    front: _Front, h: np.ndarray, passed: np.ndarray, powers: np.ndarray, times: np.ndarray, states: np.ndarray
) -> None:
    """Interpolate the rows that a step has passed, `passed` of them for each particle."""
    who = np.repeat(np.arange(len(passed)), passed)
    first = np.cumsum(passed) - passed
    rows = front.due[who] + np.arange(len(who)) - first[who]
    share = (times[rows] - front.time[who]) / h[who]
    slope = np.zeros((powers.shape[1], len(who)))
    for coefficient in powers[::-1]:
        slope = (slope + coefficient[:, who]) * share
    states[rows, front.index[who]] = (front.state[:, who] + h[who] * slope).T


@cache
def _pair() -> tuple[list[np.ndarray], np.ndarray, np.ndarray, np.ndarray]:
    """Stages, weights, error weights and dense output of the pair."""
    from scipy.integrate import RK45

    return list(RK45.A[1:]), RK45.B, RK45.E, RK45.P


@cache
def _compiled(factory: FieldFactory, dimension: int, parameters: int) -> Any:
    system = traced_system(factory, dimension, parameters)
    return load_heyoka().cfunc([rate for _, rate in system], [variable for variable, _ in system])

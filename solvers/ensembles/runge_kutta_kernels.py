"""The Runge–Kutta arithmetic of many particles in compiled loops, which need none of NumPy's temporaries."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np


@dataclass(frozen=True)
class Kernels:
    """Compiled loops; the last index of states (d, n) and slopes (stages, d, n) counts particles, h has shape (n,).

    Parameters
    ----------
    advance : callable
        ``advance(y, h, slopes, weights, out)``: y + h Σ weights k into `out`, shape (d, n).
    error : callable
        ``error(y, h, slopes, weights, out)``: max |h Σ weights k|/max(1, |y|) over components into `out`, shape (n,).
    interpolate : callable
        ``interpolate(y, h, slopes, dense, time, arrived, times, due, index, states)``: fills each particle's rows from
        `due` up to the time where it has arrived, and leaves in `due` the next one; into `states`, shape
        (particles, m, d), at its `index`. `dense`, shape (stages, degree), makes of the slopes the coefficients of
        y + h Σ c share^(power + 1).
    """

    advance: Callable[..., None]
    error: Callable[..., None]
    interpolate: Callable[..., None]


@cache
def kernels(dimension: int, stages: int, degree: int) -> Kernels:
    """Compile the loops for states, slopes and interpolants of these sizes, once in each process."""
    import numba

    number, whole = numba.float64, numba.int64
    flat, table, cube = number[::1], number[:, ::1], number[:, :, ::1]
    fixed = numba.types.Array(number, 1, "C", readonly=True)
    fixed2 = numba.types.Array(number, 2, "C", readonly=True)

    @numba.njit(numba.void(table, flat, cube, fixed, table))
    def advance(y, h, slopes, weights, out):  # noqa: ANN001, ANN202
        for i in range(y.shape[0]):
            row = out[i]
            row[:] = 0.0
            for stage in range(len(weights)):
                weight, slope = weights[stage], slopes[stage, i]
                for j in range(len(row)):
                    row[j] += weight * slope[j]
            for j in range(len(row)):
                row[j] = y[i, j] + h[j] * row[j]

    @numba.njit(numba.void(table, flat, cube, fixed, flat))
    def error(y, h, slopes, weights, out):  # noqa: ANN001, ANN202
        row = np.empty_like(out)
        out[:] = 0.0
        for i in range(y.shape[0]):
            row[:] = 0.0
            for stage in range(len(weights)):
                weight, slope = weights[stage], slopes[stage, i]
                for j in range(len(row)):
                    row[j] += weight * slope[j]
            for j in range(len(row)):
                share = abs(row[j]) / max(1.0, abs(y[i, j]))
                # What is no number stays so.
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

    return Kernels(advance, error, interpolate)

"""A slow solution of modest accuracy, along which estimates are made before any solver is asked."""

from collections.abc import Callable
from math import isfinite, nan
from operator import mul

import numpy as np

Array = np.ndarray
Floats = tuple[float, ...]

MOST_STEPS = 2000
# The pair of Dormand and Prince (Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, table II.5.2):
# stages, of which the last row is the solution, and how it differs from that of fourth order.
STAGES = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
DIFFERENCE = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
# Points of a path: so many times those that the integrator took, unless these are many.
FINER, MANY = 4, 900


def slow_path(rates: Callable[[Floats], Floats], start: Floats, end: float, tolerance: float) -> tuple[Array, Array]:
    """Times, shape (m,), and states, shape (m, d), from 0 to `end`, or to where `MOST_STEPS` tried steps lead.

    The tolerance is relative to the largest entry of the first three and of the others. Rates may be no numbers, or
    raise ArithmeticError or ValueError, where there are none: the path ends there.
    """
    times, states = [0.0], [start]
    first, step = _rates(rates, start), end / 100
    for _ in range(MOST_STEPS):
        if not (times[-1] < end and step > 1e-12 * end):
            break
        y, step = states[-1], min(step, end - times[-1])
        slopes, new = [first], y
        for weights in STAGES:
            new = tuple(a + step * sumprod(weights, each) for a, each in zip(y, zip(*slopes, strict=True), strict=True))
            slopes.append(_rates(rates, new))
        error = [abs(sumprod(DIFFERENCE, each)) for each in zip(*slopes, strict=True)]
        sizes = max(*map(abs, new[:3]), 1e-300), max(*map(abs, new[3:]), 1e-300)
        # A sum, as the largest of numbers of which one is none is any.
        worst = step / tolerance * (sum(error[:3]) / sizes[0] + sum(error[3:]) / sizes[1])
        if worst <= 1:
            times.append(end if step == end - times[-1] else times[-1] + step)
            states.append(new)
            first = slopes[-1]
        step *= min(5.0, max(0.2, 0.9 * (worst + 1e-12) ** (-1 / 5))) if isfinite(worst) else 0.2
    return np.array(times), np.array(states)


def sumprod(weights: Floats, values: Floats) -> float:
    """Sum of products."""
    return sum(map(mul, weights, values))


def _rates(rates: Callable[[Floats], Floats], y: Floats) -> Floats:
    try:
        return rates(y)
    except (ArithmeticError, ValueError):
        return (nan,) * len(y)


def refined(times: Array, states: Array, rates: Array) -> tuple[Array, Array]:
    """Times and states, shape (n, d), with further points between any two, by cubic Hermite interpolation."""
    finer = max(1, min(FINER, MANY // len(times)))
    share, step = np.arange(finer)[:, None] / finer, np.diff(times)[:, None, None]
    left, bend = states[:-1, None], np.diff(states, axis=0)[:, None]
    excess = (1 - 2 * share) * bend - (1 - share) * step * rates[:-1, None] + share * step * rates[1:, None]
    inner = left + share * bend - share * (1 - share) * excess
    fine = times[:-1, None] + share[:, 0] * step[:, :, 0]
    return np.append(fine.ravel(), times[-1]), np.concatenate([inner.reshape(-1, states.shape[1]), states[-1:]])


def interpolated(wanted: Array, times: Array, rows: Array) -> Array:
    """Rows, shape (n, d), at other times, linearly."""
    return np.stack([np.interp(wanted, times, column) for column in rows.T], axis=1)

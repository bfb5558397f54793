"""A slow solution of modest accuracy, along which estimates are made before any solver is asked."""

from collections.abc import Callable
from math import isfinite, nan

import numpy as np

Array = np.ndarray
Floats = tuple[float, ...]

TOLERANCE = 1e-4
MOST_STEPS = 2000
# Points of a path: so many times those that the integrator took, unless these are many.
FINER, MANY = 3, 900


def slow_path(rates: Callable[[Floats], Floats], start: Floats, end: float) -> tuple[Array, Array]:
    """Times, shape (m,), and states, shape (m, d), from 0 to `end`, or to where `MOST_STEPS` tried steps lead.

    By the pair of Bogacki and Shampine (Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, §II.5),
    to a tolerance relative to the largest entry of the first three and of the others. Rates may be no numbers, or raise
    ArithmeticError or ValueError, where there are none: the path ends there.
    """
    times, states = [0.0], [start]
    first, step = _rates(rates, start), end / 100
    for _ in range(MOST_STEPS):
        if not (times[-1] < end and step > 1e-12 * end):
            break
        y, step = states[-1], min(step, end - times[-1])
        second = _rates(rates, tuple(a + step / 2 * f for a, f in zip(y, first, strict=True)))
        third = _rates(rates, tuple(a + 3 / 4 * step * g for a, g in zip(y, second, strict=True)))
        slopes = [(2 * f + 3 * g + 4 * h) / 9 for f, g, h in zip(first, second, third, strict=True)]
        new = tuple(a + step * slope for a, slope in zip(y, slopes, strict=True))
        fourth = _rates(rates, new)
        every = zip(first, second, third, fourth, strict=True)
        error = [abs(-5 * f + 6 * g + 8 * h - 9 * last) for f, g, h, last in every]
        sizes = max(*map(abs, new[:3]), 1e-300), max(*map(abs, new[3:]), 1e-300)
        # A sum, as the largest of numbers of which one is none is any.
        worst = step / 72 / TOLERANCE * (sum(error[:3]) / sizes[0] + sum(error[3:]) / sizes[1])
        if worst <= 1:
            times.append(end if step == end - times[-1] else times[-1] + step)
            states.append(new)
            first = fourth
        step *= min(3.0, max(0.2, 0.9 * (worst + 1e-12) ** (-1 / 3))) if isfinite(worst) else 0.2
    return np.array(times), np.array(states)


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

"""A slow solution of modest accuracy, along which estimates are made before any solver is asked."""

from collections.abc import Callable

import numpy as np

Array = np.ndarray

TOLERANCE = 1e-4
MOST_STEPS = 2000
# Points of a path: so many times those that the integrator took, unless these are many.
FINER, MANY = 3, 900


def slow_path(
    rates: Callable[[Array], Array], start: Array, end: float, tidy: Callable[[Array], Array] = lambda y: y
) -> tuple[Array, Array]:
    """Times, shape (m,), and states, shape (m, d), from 0 to `end`, or to where `MOST_STEPS` tried steps lead.

    By the pair of Bogacki and Shampine (Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, §II.5),
    to a tolerance relative to the largest entry of the first three and of the others; `tidy` keeps invariants. Rates
    may be no numbers, or raise ArithmeticError or ValueError, where there are none: the path ends there.
    """
    times, states = [0.0], [start]
    first, step = _rates(rates, start), end / 100
    for _ in range(MOST_STEPS):
        if not (times[-1] < end and step > 1e-12 * end):
            break
        y, step = states[-1], min(step, end - times[-1])
        second = _rates(rates, y + step / 2 * first)
        third = _rates(rates, y + 3 / 4 * step * second)
        new = y + step * (2 * first + 3 * second + 4 * third) / 9
        fourth = _rates(rates, new)
        error = np.abs(step * (-5 * first + 6 * second + 8 * third - 9 * fourth) / 72)
        sizes = max(*np.abs(new[:3]), 1e-300), max(*np.abs(new[3:]), 1e-300)
        worst = max(error[:3].max() / sizes[0], error[3:].max() / sizes[1]) / TOLERANCE
        if worst <= 1:
            times.append(end if step == end - times[-1] else times[-1] + step)
            states.append(tidy(new))
            first = fourth
        step *= min(3.0, max(0.2, 0.9 * (worst + 1e-12) ** (-1 / 3))) if np.isfinite(worst) else 0.2
    return np.array(times), np.array(states)


def _rates(rates: Callable[[Array], Array], y: Array) -> Array:
    try:
        return rates(y)
    except (ArithmeticError, ValueError):
        return np.full_like(y, np.nan)


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

"""Consistent starts of equations ``M y' = f(t, y)`` whose mass matrix is singular, of index 1.

The part of the state that M sees stays as it is. The rest follows from the algebraic equations, by
Newton's method; the slope solves the differential equations and the derivative of the algebraic
ones.

The singular value decomposition of M, of rank r, separates them. The first r left singular vectors
combine the rows of ``M y' = f`` to differential equations. The others combine them to algebraic
ones, without y', as their products with M vanish. The right singular vectors after the r-th are the
directions of y that M does not see, in which the start may be moved.
"""

from collections.abc import Callable

import numpy as np

Rates = Callable[[float, np.ndarray, np.ndarray], None]

# Most Newton steps, by estimate: where there is a solution near, a few do.
_MAX_STEPS = 50
# Residual over one plus the size of the rates at which they end, by estimate: far above rounding, and far
# below any tolerance of a run.
_CONVERGED = 1e-12
# Singular values below this share of the largest one count as zero, by estimate: rounding of a matrix.
_ZERO = 1e-12
# Step of differences, over one plus the size of what is stepped: near the root of a double's rounding, at
# which errors of rounding and of truncation are about equal.
_DIFFERENCE = 1e-7


class IndexAboveOneError(RuntimeError):
    """The algebraic equations alone do not fix the algebraic variables."""


def times(mass: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """A mass matrix, or its diagonal, times a vector."""
    return mass * slope if mass.ndim == 1 else mass @ slope


def full(mass: np.ndarray) -> np.ndarray:
    """A mass matrix of which the diagonal may be given."""
    return np.diag(mass) if mass.ndim == 1 else mass


def consistent(
    rates: Rates, mass: np.ndarray, time: float, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """State and slope at the start, shape (d,) each.

    ``rates(t, y, out)`` fills `out`; `mass` has shape (d,) or (d, d). RuntimeError if there are none
    near `start`, IndexAboveOneError if the algebraic equations alone do not fix the algebraic variables,
    NumPy's LinAlgError if rates are not finite.
    """
    left, values, right = np.linalg.svd(full(mass))
    rank = int((values > _ZERO * values[0]).sum())
    # Rows of `differential` and `algebraic` combine equations; columns of `free` are directions of
    # the state.
    differential = left[:, :rank].T
    algebraic = left[:, rank:].T
    free = right[rank:].T

    def at(moment: float, state: np.ndarray) -> np.ndarray:
        out = np.empty(len(start))
        rates(moment, state, out)
        return out

    state = start.copy()
    for _ in range(_MAX_STEPS):
        now = at(time, state)
        residual = algebraic @ now
        jacobian = _differences(at, time, state, now)
        # It is regular where the algebraic equations fix the free part of the state: index 1.
        matrix = algebraic @ jacobian @ free
        if np.linalg.matrix_rank(matrix) < len(matrix):
            raise IndexAboveOneError
        if np.abs(residual).max() <= _CONVERGED * (1 + np.abs(now).max()):
            break
        state -= free @ np.linalg.solve(matrix, residual)
        if not np.isfinite(state).all():
            raise RuntimeError("the algebraic equations have no solution near the start")
    else:
        raise RuntimeError("the algebraic equations have no solution near the start")
    # The algebraic equations g(t, y) = 0 hold at all times, so that g_y y' = -g_t, where
    # `by_time` is the difference quotient for g_t.
    later = time + _DIFFERENCE * (1 + abs(time))
    by_time = algebraic @ (at(later, state) - now) / (later - time)
    whole = np.vstack([differential @ full(mass), algebraic @ jacobian])
    return state, np.linalg.solve(whole, np.concatenate([differential @ now, -by_time]))


def _differences(
    at: Callable[[float, np.ndarray], np.ndarray], time: float, state: np.ndarray, now: np.ndarray
) -> np.ndarray:
    """The Jacobian of rates, shape (d, d), by forward differences; `now` are the rates at the state."""
    jacobian = np.empty((len(state), len(state)))
    for j in range(len(state)):
        moved = state.copy()
        moved[j] += _DIFFERENCE * (1 + abs(state[j]))
        jacobian[:, j] = (at(time, moved) - now) / (moved[j] - state[j])
    return jacobian

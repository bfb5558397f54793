"""A Jacobian as far as a user states it: as a function, by its pattern, or by its bands."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from polhode.models.libraries import IMPORTS

# Diagonals over the entries of the fullest row, above which a pattern counts as sparse, not banded. An
# estimate: another one changes what a linear system costs, not what it gives.
_MAX_DIAGONALS = 4


@dataclass(frozen=True, eq=False)
class Structure:
    """A Jacobian ``df_i/dy_j`` as far as it is known.

    Parameters
    ----------
    jacobian : callable or matrix, optional
        ``jacobian(t, y, *parameters)``, shape (d, d), as an array or as one of SciPy's sparse
        matrices; or the matrix itself where it is constant.
    sparsity : array or sparse matrix, optional
        Shape (d, d); zero where the Jacobian is.
    lower, upper : int, optional
        Numbers of diagonals below and above the main one that are not zero.
    """

    jacobian: Any = None
    sparsity: Any = None
    lower: int | None = None
    upper: int | None = None

    @cached_property
    def pattern(self) -> Any:
        """The pattern as a sparse matrix of ones in columns; None if none is given."""
        if self.sparsity is None:
            return None
        with IMPORTS:
            from scipy import sparse

        pattern = sparse.csc_matrix(self.sparsity, dtype=float)
        pattern.eliminate_zeros()
        pattern.data[:] = 1.0
        pattern.sort_indices()
        return pattern

    @cached_property
    def bands(self) -> tuple[int, int] | None:
        """Diagonals below and above the main one, as given, or of a pattern with few; else None."""
        if self.lower is not None and self.upper is not None:
            return self.lower, self.upper
        pattern = self.pattern
        if pattern is None:
            return None
        rows = pattern.indices.astype(int)
        # Row less column of each entry: how far it lies below the main diagonal.
        below = rows - np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))
        lower = max(0, int(below.max(initial=0)))
        upper = max(0, -int(below.min(initial=0)))
        fullest = int(np.bincount(rows, minlength=1).max())
        return (lower, upper) if lower + upper + 1 <= _MAX_DIAGONALS * fullest else None


def structure_of(
    jacobian: Any, sparsity: Any, lower: Any, upper: Any, dimension: int
) -> Structure | None:
    """The structure that is given, checked; None if nothing is given.

    If `lower` or `upper` alone is given, the other one is 0. Raises ValueError, in one
    line, for a matrix that is not of shape (`dimension`, `dimension`), or bands out of range.
    """
    if jacobian is None and sparsity is None and lower is None and upper is None:
        return None
    shape = (dimension, dimension)
    if jacobian is not None and not callable(jacobian):
        jacobian = _matrix("jacobian", jacobian, shape, "or a function (t, y) that returns one")
    if sparsity is not None:
        sparsity = _matrix("jac_sparsity", sparsity, shape, "that is zero where the Jacobian is")
    if (lower is None) != (upper is None):
        lower = lower or 0
        upper = upper or 0
    for name, bands in (("lband", lower), ("uband", upper)):
        if bands is not None and not (
            isinstance(bands, int | np.integer) and 0 <= bands < dimension
        ):
            raise ValueError(
                f"{name}: got {bands!r}, expected a whole number from 0 to {dimension - 1}"
            )
    return Structure(jacobian, sparsity, lower, upper)


def _matrix(name: str, matrix: Any, shape: tuple[int, int], more: str) -> Any:
    if not hasattr(matrix, "tocsc"):
        try:
            matrix = np.array(matrix, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(
                f"{name}: got {matrix!r:.60}, expected a matrix of shape {shape}, {more}"
            ) from None
    if matrix.shape != shape:
        raise ValueError(f"{name}: got shape {matrix.shape}, expected {shape}, {more}")
    return matrix


def in_run_time(
    structure: Structure,
    parameters: tuple[float, ...],
    time_at: Callable[[float], float],
    sign: float,
) -> Any:
    """The Jacobian of a run's rates: a function ``(t, y)`` of the run's time, or a constant matrix.

    None if no Jacobian is given. `time_at` gives the user's time at a time of the run; `sign` is -1
    where the user's time goes backwards, else 1.
    """
    jacobian = structure.jacobian
    if jacobian is None:
        return None
    if not callable(jacobian):
        return sign * jacobian
    if sign < 0:
        return lambda t, y: -1.0 * _as_matrix(jacobian(float(time_at(t)), y, *parameters))
    return lambda t, y: jacobian(float(time_at(t)), y, *parameters)


def _as_matrix(matrix: Any) -> Any:
    return matrix if hasattr(matrix, "tocsc") else np.asarray(matrix, dtype=float)

"""A Jacobian as the libraries want what a user knows of it: its pattern, its bands, its entries."""

from typing import Any

import numpy as np

from polhode.models.own_function import OwnField
from polhode.models.problem import Problem
from polhode.models.structure import Structure, in_run_time

# Share of a matrix that its bands may fill, above which they are of no use.
_MAX_BANDED_SHARE = 0.5


def structure_of(problem: Problem) -> Structure | None:
    """What is known of a problem's Jacobian; None of problems that are no user's."""
    return problem.field.structure if isinstance(problem.field, OwnField) else None


def jacobian_of(problem: Problem) -> Any:
    """The user's Jacobian, a matrix or ``(t, y) -> matrix`` in the run's time; None if there is none."""
    structure, field = structure_of(problem), problem.field
    if structure is None or not isinstance(field, OwnField):
        return None
    sign = -1.0 if field.backwards else 1.0
    return in_run_time(structure, problem.parameters or (), field.time_at, sign)


def pattern_of(problem: Problem) -> Any:
    """The pattern of the Jacobian, a sparse matrix of ones in columns; None if it is not known."""
    structure = structure_of(problem)
    if structure is None:
        return None
    from scipy import sparse

    d = problem.dimension
    if structure.sparsity is not None:
        pattern = sparse.csc_matrix(structure.sparsity, dtype=float)
        pattern.eliminate_zeros()
        pattern.data[:] = 1.0
        pattern.sort_indices()
        return pattern
    if structure.lower is not None and structure.upper is not None:
        offsets: Any = range(-structure.lower, structure.upper + 1)
        return sparse.diags([np.ones(d - abs(k)) for k in offsets], list(offsets), format="csc")
    return None


def bands_of(problem: Problem) -> tuple[int, int] | None:
    """The numbers of diagonals below and above the main one, where they are few; None if not."""
    structure = structure_of(problem)
    if structure is None:
        return None
    lower, upper = structure.lower, structure.upper
    if lower is None or upper is None:
        pattern = pattern_of(problem)
        if pattern is None:
            return None
        entries = pattern.tocoo()
        below = entries.row.astype(int) - entries.col
        lower, upper = max(0, int(below.max(initial=0))), max(0, int(-below.min(initial=0)))
    if lower + upper + 1 > _MAX_BANDED_SHARE * problem.dimension:
        return None
    return lower, upper


def dense(matrix: Any) -> np.ndarray:
    """A matrix as an array, sparse or not."""
    return matrix.toarray() if hasattr(matrix, "toarray") else np.asarray(matrix, dtype=float)


def packed(matrix: Any, lower: int, upper: int) -> np.ndarray:
    """The bands of a matrix as LSODA wants them, shape (lower + upper + 1, d)."""
    d = matrix.shape[0]
    bands = np.zeros((lower + upper + 1, d))
    for k in range(-lower, upper + 1):
        diagonal = matrix.diagonal(k)
        first = max(0, k)
        bands[upper - k, first : first + len(diagonal)] = diagonal
    return bands

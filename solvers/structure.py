"""A Jacobian as the libraries want what a user knows of it: its pattern, its bands, its entries.

Problems come here as plain Python, without the time in their state (`compile.as_plain`): the Jacobian has
the shape (d, d), where d is the number of the user's components.
"""

from typing import Any

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.own_function import OwnField
from polhode.models.problem import Problem
from polhode.models.structure import Structure, in_run_time


def structure_of(problem: Problem) -> Structure | None:
    """The structure of a user's problem's Jacobian; None if none is given, and for other problems."""
    return problem.field.structure if isinstance(problem.field, OwnField) else None


def jacobian_of(problem: Problem) -> Any:
    """The user's Jacobian, a matrix or ``(t, y) -> matrix`` in the run's time; None if there is none."""
    structure = structure_of(problem)
    field = problem.field
    if structure is None or not isinstance(field, OwnField):
        return None
    sign = -1.0 if field.backwards else 1.0
    return in_run_time(structure, problem.field_parameters, field.time_at, sign)


def pattern_of(problem: Problem) -> Any:
    """The pattern of the Jacobian as a CSC matrix of ones, shape (d, d); None if it is not known."""
    structure = structure_of(problem)
    if structure is None or structure.pattern is not None or structure.bands is None:
        return structure.pattern if structure else None
    # The lock under which parts of SciPy are imported (`models.libraries`).
    with IMPORTS:
        from scipy import sparse

    d = problem.dimension
    lower, upper = structure.bands
    offsets: Any = range(-lower, upper + 1)
    return sparse.diags([np.ones(d - abs(k)) for k in offsets], offsets=offsets, format="csc")


def bands_of(problem: Problem) -> tuple[int, int] | None:
    """The numbers of diagonals below and above the main one; None if they are not known.

    Bands that the user gives come back however many they are, bands of a pattern only if they are few.
    """
    structure = structure_of(problem)
    return structure.bands if structure else None


def dense(matrix: Any) -> np.ndarray:
    """A matrix as an array, sparse or not."""
    return matrix.toarray() if hasattr(matrix, "toarray") else np.asarray(matrix, dtype=float)


def packed(matrix: Any, lower: int, upper: int, further: int = 0) -> np.ndarray:
    """The bands of a matrix as LSODA wants them, shape (lower + upper + 1 + further, d).

    Entry (i, j) of the matrix stands in row ``upper + i - j`` and column j. The `further` rows are 0.
    """
    d = matrix.shape[0]
    bands = np.zeros((lower + upper + 1 + further, d))
    for k in range(-lower, upper + 1):
        # k above the main diagonal; it begins in column `first`.
        diagonal = matrix.diagonal(k)
        first = max(0, k)
        bands[upper - k, first : first + len(diagonal)] = diagonal
    return bands

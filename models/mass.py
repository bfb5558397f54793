"""Mass matrices of users' functions: ``M y' = f(t, y)``, whatever M is."""

import inspect
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from polhode.models.structure import Structure

# Components up to which a mass matrix may be other than diagonal. An estimate that bounds memory and
# time: its inverse is full, 2 MB here.
_MAX_FULL_MASS = 500


def mass_of(matrix: Any, dimension: int) -> np.ndarray | None:
    """A mass matrix checked: its diagonal, shape (d,), if it has no more, else (d, d).

    None if there is none. Raises ValueError for another shape, for numbers that are not finite, for
    zeros alone, and for a matrix other than diagonal above `_MAX_FULL_MASS` components.
    """
    if matrix is None:
        return None
    expected = f"the diagonal, {dimension} numbers, or a matrix of shape {(dimension, dimension)}"
    if hasattr(matrix, "toarray"):
        dense = matrix.toarray() if dimension <= _MAX_FULL_MASS else _diagonal(matrix)
    else:
        dense = matrix
    try:
        mass = np.array(dense, dtype=float)
    except (TypeError, ValueError):
        mass = np.empty(0)
    if mass.shape not in ((dimension,), (dimension, dimension)) or not np.isfinite(mass).all():
        got = " ".join(f"{dense!r:.60}".split())
        raise ValueError(f"mass: got {got}, expected {expected}")
    if mass.ndim == 2 and not (mass - np.diag(mass.diagonal())).any():
        mass = mass.diagonal().copy()
    if mass.ndim == 2 and dimension > _MAX_FULL_MASS:
        raise ValueError(
            f"mass: got a full matrix of {dimension} components, expected a diagonal one above "
            f"{_MAX_FULL_MASS}"
        )
    if not mass.any():
        raise ValueError("mass: got zeros alone, expected a differential equation")
    return mass


def _diagonal(matrix: Any) -> np.ndarray:
    """The diagonal of a sparse matrix of many components; ValueError if it has other entries."""
    entries = matrix.tocoo()
    if np.any((entries.row != entries.col) & (entries.data != 0)):
        raise ValueError(
            f"mass: got a matrix of {matrix.shape[0]} components, expected a diagonal one above "
            f"{_MAX_FULL_MASS}"
        )
    return matrix.diagonal()


def is_singular(mass: np.ndarray) -> bool:
    """Whether some equations are algebraic."""
    if mass.ndim == 1:
        return bool((mass == 0).any())
    return int(np.linalg.matrix_rank(mass)) < len(mass)


def with_time(mass: np.ndarray) -> np.ndarray:
    """The mass of a state whose last component is the time."""
    if mass.ndim == 1:
        return np.append(mass, 1.0)
    larger = np.eye(len(mass) + 1)
    larger[:-1, :-1] = mass
    return larger


def without_time(mass: np.ndarray) -> np.ndarray:
    """The mass of a state from which the time is left out again."""
    return mass[:-1] if mass.ndim == 1 else mass[:-1, :-1]


def in_rows(mass: np.ndarray) -> tuple[Any, ...]:
    """A diagonal as a tuple of numbers, a matrix as a tuple of its rows: a `Problem` is hashed."""
    return tuple(map(tuple, mass.tolist())) if mass.ndim == 2 else tuple(mass.tolist())


class Unmassed:
    """A user's function with a mass matrix that has an inverse, as rates: ``y' = M⁻¹ f(t, y)``."""

    def __init__(self, function: Callable[..., Any], mass: np.ndarray) -> None:
        self.function = function
        self.mass = mass
        self.inverse = 1 / mass if mass.ndim == 1 else np.linalg.inv(mass)
        self.__name__ = getattr(function, "__name__", "f")
        # The names of the function's parameters.
        with suppress(ValueError):
            self.__signature__ = inspect.signature(function)

    def __call__(self, t: float, y: Any, *parameters: float) -> Any:
        """Rates."""
        values = self.function(t, y, *parameters)
        values = values if isinstance(values, np.ndarray) else np.array(values)
        return self.inverse * values if self.mass.ndim == 1 else self.inverse @ values

    def structure(self, structure: Structure | None) -> Structure | None:
        """The structure of these rates' Jacobian, from the structure of the function's."""
        if structure is None:
            return None
        jacobian = structure.jacobian
        if callable(jacobian):
            jacobian = partial(self._times_given, jacobian)
        elif jacobian is not None:
            jacobian = self._times(jacobian)
        if self.mass.ndim == 2:
            # Products with a full matrix have no pattern of their own.
            return None if jacobian is None else Structure(jacobian)
        return replace(structure, jacobian=jacobian)

    def _times_given(
        self, jacobian: Callable[..., Any], t: float, y: Any, *parameters: float
    ) -> Any:
        return self._times(jacobian(t, y, *parameters))

    def _times(self, matrix: Any) -> Any:
        if self.mass.ndim == 2:
            return self.inverse @ matrix
        if hasattr(matrix, "multiply"):
            return matrix.multiply(self.inverse[:, None]).tocsc()
        return self.inverse[:, None] * np.asarray(matrix, dtype=float)

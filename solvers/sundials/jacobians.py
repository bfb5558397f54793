"""The user's Jacobian, as scikit-sundae takes it: its linear solver, its pattern, its entries."""

from typing import Any

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.problem import Problem
from polhode.solvers.contract import Settings
from polhode.solvers.structure import bands_of, dense, jacobian_of, pattern_of
from polhode.solvers.sundials.consistent import Rates, full

# Step of differences over the size of a component: the root of a double's rounding, at which errors
# of rounding and of truncation are about equal.
_DIFFERENCE = float(np.sqrt(np.finfo(float).eps))
# Least step of differences over atol / rtol: 1000 roundings, as SUNDIALS has it (`MIN_INC_MULT`). Rounding
# then spoils an entry by some thousandth, which is enough for Newton's iteration. A step as large as
# `_DIFFERENCE` spoils more where atol is far above the component: a run failed so.
_LEAST_DIFFERENCE = 1000 * float(np.finfo(float).eps)
# Components up to which a banded Jacobian of the user's is handed over. An estimate that bounds memory:
# scikit-sundae holds it as a full matrix, 8 MB here.
_MAX_FULL = 1000


# A sparse matrix is known by its method `tocsc`, so that SciPy is imported where there is one alone.
def jacobian_options(
    problem: Problem, settings: Settings, rates: Rates, mass: np.ndarray | None
) -> dict[str, Any]:
    """Options of scikit-sundae's classes; with a mass, for IDA's residual.

    Differences are taken of `rates`, which count their calls and look at the deadline.
    """
    jacobian = jacobian_of(problem)
    bands = bands_of(problem)
    if mass is not None and mass.ndim == 2:
        # A residual with a full mass matrix is full.
        return {} if jacobian is None else {"jacfn": _filled(jacobian, mass, dense)}
    if bands:
        options: dict[str, Any] = {"linsolver": "band", "lband": bands[0], "uband": bands[1]}
        # The library's own differences take one right-hand side per diagonal.
        if jacobian is not None and problem.dimension <= _MAX_FULL:
            options["jacfn"] = _filled(jacobian, mass, dense)
        return options
    pattern = pattern_of(problem)
    if pattern is None and jacobian is not None:
        first: Any = jacobian(0.0, np.array(problem.start)) if callable(jacobian) else jacobian
        if hasattr(first, "tocsc"):
            pattern = first.tocsc(copy=True)
            pattern.data = np.ones(len(pattern.data))
    if pattern is not None:
        pattern = _with_diagonal(pattern) if mass is not None else pattern
        if jacobian is None:
            jacobian = _Differences(rates, settings, pattern)
        filled = _filled(jacobian, mass, _Entries(pattern))
        return {"linsolver": "sparse", "sparsity": pattern, "jacfn": filled}
    return {} if jacobian is None else {"jacfn": _filled(jacobian, mass, dense)}


def _with_diagonal(pattern: Any) -> Any:
    """A pattern with the mass's diagonal in it."""
    with IMPORTS:
        from scipy import sparse

    whole = (pattern + sparse.identity(pattern.shape[0], format="csc")).tocsc()
    whole.data[:] = 1.0
    whole.sort_indices()
    return whole


class _Entries:
    """The entries of a matrix at the places of a pattern, column by column."""

    def __init__(self, pattern: Any) -> None:
        self.rows = pattern.indices
        self.columns = np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))
        self.pointers = pattern.indptr

    def __call__(self, matrix: Any) -> np.ndarray:
        if hasattr(matrix, "tocsc"):
            matrix = matrix.tocsc()
            matrix.sort_indices()
            same = np.array_equal(matrix.indptr, self.pointers)
            if same and np.array_equal(matrix.indices, self.rows):
                return matrix.data
        return np.asarray(matrix[self.rows, self.columns], dtype=float).ravel()


class _Differences:
    """A sparse Jacobian by differences, columns without a common row at once.

    Such columns form a group: their components are moved together, as each rate answers to one of
    them at most.

    A component is moved by a share of its size. Near 0 it is moved by a share of atol / rtol, the
    size below which its absolute tolerance rules. CVODE's own least step is a share of the error
    weight too, but one that depends on the step in time, which a Jacobian's function is not told.
    """

    def __init__(self, rates: Rates, settings: Settings, pattern: Any) -> None:
        with IMPORTS:
            from scipy.optimize._numdiff import group_columns

        self.rates = rates
        self.least = _LEAST_DIFFERENCE * settings.atols() / settings.tolerance
        self.pattern = pattern
        self.columns = np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))
        self.groups = group_columns(pattern)

    def __call__(self, t: float, y: np.ndarray) -> Any:
        """The Jacobian at a state."""
        now = np.empty(len(y))
        self.rates(t, y, now)
        size = np.abs(y)
        # If atol is tiny, the rounding of the largest component decides.
        least = np.maximum(self.least, _DIFFERENCE**2 * size.max())
        moved = y + np.maximum(_DIFFERENCE * size, least)
        # As rounded.
        steps = moved - y
        matrix = self.pattern.copy()
        rows = matrix.indices
        rates = np.empty(len(y))
        for group in range(int(self.groups.max()) + 1):
            here = self.groups == group
            self.rates(t, np.where(here, moved, y), rates)
            entries = here[self.columns]
            changes = (rates - now)[rows[entries]]
            matrix.data[entries] = changes / steps[self.columns[entries]]
        return matrix


def _filled(jacobian: Any, mass: np.ndarray | None, entries: Any) -> Any:
    """The function that fills the library's matrix with the Jacobian of f, or of ``mass * y' - f``.

    `entries` makes of a Jacobian the array that the library's matrix holds.
    """

    def at(t: float, y: np.ndarray) -> Any:
        return jacobian(t, y) if callable(jacobian) else jacobian

    if mass is None:

        def of_field(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
            out[:] = entries(at(t, y))

        return of_field

    def of_residual(
        t: float, y: np.ndarray, slope: np.ndarray, residual: Any, cj: float, out: np.ndarray
    ) -> None:
        out[:] = entries(_residual(at(t, y), mass, cj))

    return of_residual


def _residual(jacobian: Any, mass: np.ndarray, cj: float) -> Any:
    """The Jacobian of IDA's residual, ``cj * mass - jacobian``; sparse if `jacobian` is and the mass is diagonal."""
    if mass.ndim == 2 or not hasattr(jacobian, "tocsc"):
        return cj * full(mass) - dense(jacobian)
    with IMPORTS:
        from scipy import sparse

    return (cj * sparse.diags(mass) - jacobian).tocsc()

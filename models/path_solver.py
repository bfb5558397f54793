"""The solver by which models look along a run beforehand: handed over, as they import no solvers.

`polhode` itself hands it over when it is imported; `second_order/path.py` uses it.
"""

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np

    from polhode.models.problem import Problem


class PathSolver(Protocol):
    """The kind of function that `polhode.solvers.following.followed` is."""

    def __call__(
        self, problem: "Problem", tolerance: float, points: int
    ) -> "tuple[np.ndarray, np.ndarray]":
        """About `points` times of the solution, shape (n,), and the states there, shape (n, d).

        Times are the problem's own; if the solver takes more steps than `points`, there is one for each step.
        `tolerance` is the relative one and the absolute one. The times end early where the solution
        does, or where it takes too many steps. A solution that cannot begin gives its start alone.
        """
        ...


_solver: PathSolver | None = None


def use(solver: PathSolver | None) -> None:
    """Look along runs by this solver from now on."""
    global _solver
    _solver = solver


def solved(problem: "Problem", tolerance: float, points: int) -> "tuple[np.ndarray, np.ndarray]":
    """The solution of a problem by the solver in use, as `PathSolver` gives it.

    Raises RuntimeError if none was handed over.
    """
    if _solver is None:
        raise RuntimeError(
            "no path solver: got None, expected one by polhode.models.path_solver.use"
        )
    return _solver(problem, tolerance, points)

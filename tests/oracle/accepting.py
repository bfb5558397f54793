"""Which solvers of the catalogue integrate a problem."""

from polhode.models.problem import Problem
from polhode.solvers.catalogue import SOLVERS, solver


def accepting(problem: Problem) -> list[str]:
    """Names of the solvers that take a problem, the closed form left out."""
    return [name for name in SOLVERS if not solver(name).closed_form and takes(name, problem)]


def takes(name: str, problem: Problem) -> bool:
    """Whether the solver of that name takes a problem."""
    return solver(name).takes(problem)

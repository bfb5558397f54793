"""Which solvers of the catalogue integrate a problem."""

from polhode.models.problem import Problem
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.contract import SolverNotValidError


def accepting(problem: Problem) -> list[str]:
    """Names of the solvers that take a problem, the closed form left out."""
    return [name for name in SOLVERS if not solver(name).closed_form and takes(name, problem)]


def takes(name: str, problem: Problem) -> bool:
    try:
        solver(name).check(problem)
    except SolverNotValidError:
        return False
    return True

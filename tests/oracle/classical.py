"""Classical problems with published solutions, as tests of solvers use them."""

from polhode.models.problems.catalogue import PROBLEMS
from polhode.models.problems.classical import Classical

# The one with an algebraic equation, which few solvers take, stands aside.
ROBERTSON_DAE = PROBLEMS["robertson-dae"]
CLASSICAL = {name: problem for name, problem in PROBLEMS.items() if problem is not ROBERTSON_DAE}

__all__ = ["CLASSICAL", "ROBERTSON_DAE", "Classical"]

"""Classical problems with published solutions, as tests of solvers use them: the two with parts of their own aside."""

from polhode.models.problems.catalogue import PROBLEMS
from polhode.models.problems.classical import Classical

ROBERTSON_DAE = PROBLEMS["robertson-dae"]
CLASSICAL = {name: each for name, each in PROBLEMS.items() if each is not ROBERTSON_DAE}

__all__ = ["CLASSICAL", "ROBERTSON_DAE", "Classical"]

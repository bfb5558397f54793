"""What a classical test problem is, and where they are published."""

from dataclasses import dataclass

import numpy as np

from polhode.models.problem import Problem

IVP = "F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4, University of Bari (2008)"
HNW = "E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993)"
DETEST = (
    "W. H. Enright, J. D. Pryce, Two FORTRAN packages for assessing initial value methods, "
    "ACM Trans. Math. Software 13 (1987) 1"
)


@dataclass(frozen=True)
class Classical:
    """A problem and its solution at the end.

    Parameters
    ----------
    problem : Problem
    reference : tuple of float
        State at the end.
    stiff : bool
    source : str
        Where problem and digits are published; where none are, how the digits were found.
    hopeless : tuple of str
        Solvers that would take minutes, and prove nothing.
    """

    problem: Problem
    reference: tuple[float, ...]
    stiff: bool
    source: str
    hopeless: tuple[str, ...] = ()

    def error(self, state: np.ndarray) -> float:
        """Largest error of a component, relative where the component exceeds one in size."""
        reference = np.array(self.reference)
        return float(np.max(np.abs(state - reference) / np.maximum(1.0, np.abs(reference))))

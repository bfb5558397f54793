"""A classical test problem: equations, start, published end."""

from dataclasses import dataclass

import numpy as np

from polhode.models.problem import Problem


@dataclass(frozen=True)
class Classical:
    """A problem and its solution at the end.

    Parameters
    ----------
    problem : Problem
        The equations, the start and the end.
    reference : tuple of float
        State at the end.
    stiff : bool
        Whether stability, not accuracy, sets the steps of explicit methods.
    source : str
        Where problem and digits are published; where none are, how the digits were found.
    hopeless : tuple of str
        Solvers that would take minutes, and prove nothing.
    atol_per_rtol : float
        Absolute tolerance over the relative one, 1 unless published runs of the problem have another
        ratio (`problems.toml` says whose).
    """

    problem: Problem
    reference: tuple[float, ...]
    stiff: bool
    source: str
    hopeless: tuple[str, ...] = ()
    atol_per_rtol: float = 1.0

    def atol(self, rtol: float) -> float:
        """The absolute tolerance that belongs to a relative one."""
        return self.atol_per_rtol * rtol

    def error(self, state: np.ndarray) -> float:
        """Largest error of a component, relative where the component exceeds one in size."""
        reference = np.array(self.reference)
        return float(np.max(np.abs(state - reference) / np.maximum(1.0, np.abs(reference))))

"""Coefficients of steps: compositions of the flows of two parts, and DOP853."""

from dataclasses import dataclass
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path
from runpy import run_path
from types import SimpleNamespace

import numpy as np


@dataclass(frozen=True)
class Scheme:
    """A palindromic composition of fast and slow flows, fast ones first and last."""

    name: str
    # First half of the shares of a step, the middle one included; slow flows in a step.
    fast: tuple[float, ...]
    slow: tuple[float, ...]
    stages: int

    @cached_property
    def numbers(self) -> dict[type, np.ndarray]:
        """What machine code receives, by the type of its numbers: stages and shares, and those that lead to a row."""
        return {
            number: np.concatenate([_listed(*each, number) for each in ((self.fast, self.slow, self.stages), WITHIN)])
            for number in (float, np.longdouble)
        }

    @cached_property
    def addresses(self) -> dict[type, int]:
        """Where machine code finds these numbers."""
        return {number: array.ctypes.data for number, array in self.numbers.items()}


def _listed(fast: tuple[float, ...], slow: tuple[float, ...], stages: int, number: type) -> np.ndarray:
    """Stages and all shares."""
    shares = [_mirrored(*each, number) for each in ((fast, stages + 1), (slow, stages))]
    return np.concatenate([np.array([stages], number), *shares])


def _mirrored(half: tuple[float, ...], length: int, number: type) -> np.ndarray:
    """All shares; the middle takes up what rounding of the others leaves, since a sum beside 1 changes the clock."""
    shares = np.array([*half, *half[: length - len(half)][::-1]], number)
    middle = shares[(length - 1) // 2 : length // 2 + 1]
    middle += (1 - shares.sum()) / len(middle)
    return shares


# How rows are reached from an end of a step where the slow part is weak: SABA3 errs less in half a step than any scheme
# below in the whole run.
WITHIN = (0.1127016653792583, 0.3872983346207417), (0.2777777777777778, 0.4444444444444444), 3

# Blanes, Casas, Farrés, Laskar, Makazaga and Murua, Appl. Numer. Math. 68 (2013) 58; SABA2 is Laskar and Robutel's of
# 2001, S2 Strang's. On random spheroids SABA3 and ABA(8,4) gained over none of these at any error.
SCHEMES = (
    Scheme("S2", (0.5,), (1.0,), 1),
    Scheme("SABA2", (0.2113248654051871, 0.5773502691896258), (0.5,), 2),
    Scheme(
        "ABA(8,6,4)",
        (0.07113342649822312, 0.24115342795664010, 0.52141176177281479, -0.33369861622767801),
        (0.18308368747219722, 0.31078285989857487, -0.026564618511958801, 0.065396142282373418),
        7,
    ),
    Scheme(
        "ABA(10,6,4)",
        (0.038094497422412195, 0.14529871611691371, 0.20762769572554125, 0.43590970365152616, -0.65386122583278671),
        (0.095858880837075211, 0.20444615314299878, 0.21707034797899110, -0.017375381959065093),
        8,
    ),
)
# Of one run by itself: on random spheroids no other gained over it at any error.
BEST = SCHEMES[-1]


@cache
def dop853() -> SimpleNamespace:
    """SciPy's coefficients of DOP853, without the 0.2 s that its package takes to import."""
    scipy = find_spec("scipy")
    folder = Path((scipy and scipy.origin) or "scipy is not installed").parent
    return SimpleNamespace(**run_path(str(folder / "integrate" / "_ivp" / "dop853_coefficients.py")))

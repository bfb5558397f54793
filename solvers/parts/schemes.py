"""Coefficients of steps: compositions of the flows of two parts (`schemes.toml`), and DOP853.

A *share* is a flow's time over the step's. A step of s stages takes s + 1 fast flows and s slow
ones in turns: fast, slow, fast, ..., slow, fast. Steps h of ABA(10,6,4) err by ε h¹⁰, ε² h⁶ and
ε³ h⁴ over a fixed time, where ε is the size of the slow part over the fast one's. ABA(8,6,4) is read
alike; SABA2 errs by ε h⁴ and ε² h², and S2 by ε h². `parallel` has no such law: its shares
are fitted (`schemes.toml`).

An output row may lie within a step. A step of its own, always one of ABA(10,6,4), leads to it from the
nearer end of the step; where relaxation is strong it starts at the step's begin.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from runpy import run_path
from types import SimpleNamespace

import numpy as np

from polhode.models.libraries import need
from polhode.models.once import once


@dataclass(frozen=True, eq=False)
class Scheme:
    """A palindromic composition of fast and slow flows, fast ones first and last."""

    name: str
    stages: int  # slow flows in a step
    slow: Sequence[float]  # first half of the slow shares, the middle one included
    fast: Sequence[float] = ()  # of the fast ones

    @property
    def chains(self) -> int:
        """Compositions beside each other."""
        return 1

    @cached_property
    def numbers(self) -> dict[type, np.ndarray]:
        """The scheme, and the one of steps to rows, as numbers for machine code, by their type.

        `flows` shows how they lie. The scheme of steps to rows needs no weight.
        """
        types = float, np.longdouble
        return {
            number: np.concatenate([self.listed(number), ABA.listed(number)[:-1]])
            for number in types
        }

    def listed(self, number: type) -> np.ndarray:
        """Stages, fast shares, slow shares, weights of the chains, with the chain as last index."""
        fast = _mirrored(self.fast, self.stages + 1, number)
        slow = _mirrored(self.slow, self.stages, number)
        return np.concatenate([np.array([self.stages], number), fast, slow, np.ones(1, number)])

    @cached_property
    def widest(self) -> float:
        """The largest fast share in size; shares may be negative."""
        fast = self.numbers[float][1 : 1 + (self.stages + 1) * self.chains]
        return float(np.abs(fast).max())

    @cached_property
    def addresses(self) -> dict[type, int]:
        """Addresses of these numbers, by their type."""
        return {number: array.ctypes.data for number, array in self.numbers.items()}


def _mirrored(half: Sequence[float], length: int, number: type) -> np.ndarray:
    """All shares; the middle ones make their sum 1, as another sum would change the clock.

    The table has the digits of doubles, whose sum is not 1 in long double.
    """
    mirror_image = half[: length - len(half)][::-1]
    shares = np.array([*half, *mirror_image], number)
    # One share or two, as `length` is odd or even: a view, through which `shares` changes.
    middle = shares[(length - 1) // 2 : length // 2 + 1]
    middle += (1 - shares.sum()) / len(middle)
    return shares


@dataclass(frozen=True, eq=False)
class Parallel(Scheme):
    """A mean, by weight, of compositions and their mirror images.

    A composition is given by its `stages` slow shares and as many nodes, the places in the step at
    which its slow flows are taken; all compositions stand one behind the other.
    """

    nodes: Sequence[float] = ()
    # Their sum is 1/2 in either type: each counts for the mirror image too.
    weights: Sequence[float] = ()

    @property
    def chains(self) -> int:
        return 2 * len(self.weights)

    def listed(self, number: type) -> np.ndarray:
        # A row for each composition.
        nodes = np.array(self.nodes, number).reshape(-1, self.stages)
        slow = np.array(self.slow, number).reshape(-1, self.stages)
        slow /= slow.sum(axis=1, keepdims=True)
        # Behind them their mirror images.
        nodes = np.concatenate([nodes, 1 - nodes[:, ::-1]])
        slow = np.concatenate([slow, slow[:, ::-1]])
        # The fast flows lead from 0 to the first node, from node to node, and from the last to 1.
        fast = np.diff(nodes, axis=1, prepend=0, append=1)
        return np.concatenate(
            [[self.stages], fast.T.ravel(), slow.T.ravel(), np.tile(self.weights, 2)]
        )


_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
SCHEMES = tuple(Scheme(**palindrome) for palindrome in _TABLES["palindromes"])
# ABA(10,6,4) leads to rows. As the only scheme of a run it took fewer flows than each of the others at any
# error, on random spheroids; no command repeats that. Ensembles at equal steps still choose among all.
ABA = SCHEMES[-1]
PARALLEL = Parallel(**_TABLES["parallel"])
# Numbers whose addresses are given away are computed here, before there are threads: of two copies
# that threads compute at once, one would be freed.
for _scheme in (*SCHEMES, PARALLEL):
    _ = _scheme.addresses


@once()
def dop853() -> SimpleNamespace:
    """SciPy's coefficients of DOP853, without the import of its package, which takes some 0.2 s.

    They have the names of SciPy's module: A and B of the method, D of the interpolant, E3 and E5 of
    the error estimates, `N_STAGES` and further ones.
    """
    need("the coefficients of DOP853", "scipy")
    scipy = find_spec("scipy")
    assert scipy is not None
    folder = Path(scipy.origin or "").parent
    return SimpleNamespace(
        **run_path(str(folder / "integrate" / "_ivp" / "dop853_coefficients.py"))
    )

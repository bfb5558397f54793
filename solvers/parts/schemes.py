"""Coefficients of steps: compositions of the flows of two parts (`schemes.toml`), and DOP853."""

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
    # Slow flows in a step; first half of the shares of a step, the middle one included.
    stages: int
    slow: Sequence[float]
    fast: Sequence[float] = ()

    @property
    def chains(self) -> int:
        """Compositions beside each other."""
        return 1

    @cached_property
    def numbers(self) -> dict[type, np.ndarray]:
        """The scheme and the one that leads to rows as numbers for machine code, by their type."""
        types = float, np.longdouble
        return {
            number: np.concatenate([self.listed(number), ABA.listed(number)[:-1]])
            for number in types
        }

    def listed(self, number: type) -> np.ndarray:
        """Stages, fast shares, slow shares, weights of the chains."""
        fast = _mirrored(self.fast, self.stages + 1, number)
        slow = _mirrored(self.slow, self.stages, number)
        return np.concatenate([np.array([self.stages], number), fast, slow, np.ones(1, number)])

    @cached_property
    def widest(self) -> float:
        """The largest fast share, either way."""
        return float(np.abs(self.numbers[float][1 : 1 + (self.stages + 1) * self.chains]).max())

    @cached_property
    def addresses(self) -> dict[type, int]:
        """Addresses of these numbers, by their type."""
        return {number: array.ctypes.data for number, array in self.numbers.items()}


def _mirrored(half: Sequence[float], length: int, number: type) -> np.ndarray:
    """All shares; the middle ones make their sum 1, as another sum would change the clock."""
    shares = np.array([*half, *half[: length - len(half)][::-1]], number)
    middle = shares[(length - 1) // 2 : length // 2 + 1]
    middle += (1 - shares.sum()) / len(middle)
    return shares


@dataclass(frozen=True, eq=False)
class Parallel(Scheme):
    """A mean, by weight, of compositions and their mirror images.

    Given are the shares of slow flows, and where.
    """

    nodes: Sequence[float] = ()
    weights: Sequence[float] = ()

    @property
    def chains(self) -> int:
        return 2 * len(self.weights)

    def listed(self, number: type) -> np.ndarray:
        nodes, slow = (
            np.array(rows, number).reshape(-1, self.stages) for rows in (self.nodes, self.slow)
        )
        slow /= slow.sum(axis=1, keepdims=True)
        nodes = np.concatenate([nodes, 1 - nodes[:, ::-1]])
        slow = np.concatenate([slow, slow[:, ::-1]])
        fast = np.diff(nodes, axis=1, prepend=0, append=1)
        return np.concatenate(
            [[self.stages], fast.T.ravel(), slow.T.ravel(), np.tile(self.weights, 2)]
        )


_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
SCHEMES = tuple(Scheme(**palindrome) for palindrome in _TABLES["palindromes"])
# By itself it gained over the others at any error; it leads to rows.
ABA = SCHEMES[-1]
PARALLEL = Parallel(**_TABLES["parallel"])
# Numbers whose addresses are given away are computed here, before there are threads: of two copies
# that threads compute at once, one would be freed.
for _scheme in (*SCHEMES, PARALLEL):
    _ = _scheme.addresses


@once()
def dop853() -> SimpleNamespace:
    """SciPy's coefficients of DOP853, without the 0.2 s that its package takes to import."""
    need("the coefficients of DOP853", "scipy")
    scipy = find_spec("scipy")
    assert scipy is not None
    folder = Path(scipy.origin or "").parent
    return SimpleNamespace(
        **run_path(str(folder / "integrate" / "_ivp" / "dop853_coefficients.py"))
    )

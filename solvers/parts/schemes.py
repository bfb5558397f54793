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
    # Slow flows in a step; first half of the shares of a step, the middle one included.
    stages: int
    slow: tuple[float, ...]
    fast: tuple[float, ...] = ()

    @property
    def chains(self) -> int:
        """Compositions beside each other."""
        return 1

    @cached_property
    def numbers(self) -> dict[type, np.ndarray]:
        """What machine code receives, by the type of its numbers: its own, and the scheme that leads to rows."""
        types = float, np.longdouble
        return {each: np.concatenate([self.listed(each), ABA.listed(each)[:-1]]) for each in types}

    def listed(self, number: type) -> np.ndarray:
        """Stages, fast shares, slow shares, weights of the chains."""
        shares = [_mirrored(*each, number) for each in ((self.fast, self.stages + 1), (self.slow, self.stages))]
        return np.concatenate([np.array([self.stages], number), *shares, np.ones(1, number)])

    @cached_property
    def widest(self) -> float:
        """The largest fast share, either way."""
        return float(np.abs(self.numbers[float][1 : 1 + (self.stages + 1) * self.chains]).max())

    @cached_property
    def addresses(self) -> dict[type, int]:
        """Where machine code finds these numbers."""
        return {number: array.ctypes.data for number, array in self.numbers.items()}


def _mirrored(half: tuple[float, ...], length: int, number: type) -> np.ndarray:
    """All shares; the middle takes up what rounding of the others leaves, since a sum beside 1 changes the clock."""
    shares = np.array([*half, *half[: length - len(half)][::-1]], number)
    middle = shares[(length - 1) // 2 : length // 2 + 1]
    middle += (1 - shares.sum()) / len(middle)
    return shares


# Blanes, Casas, Farrés, Laskar, Makazaga and Murua, Appl. Numer. Math. 68 (2013) 58; SABA2 is Laskar and Robutel's of
# 2001, S2 Strang's. On random spheroids SABA3 and ABA(8,4) gained over none of these at any error.
SCHEMES = (
    Scheme("S2", 1, (1.0,), (0.5,)),
    Scheme("SABA2", 2, (0.5,), (0.2113248654051871, 0.5773502691896258)),
    Scheme(
        "ABA(8,6,4)",
        7,
        (0.18308368747219722, 0.31078285989857487, -0.026564618511958801, 0.065396142282373418),
        (0.07113342649822312, 0.24115342795664010, 0.52141176177281479, -0.33369861622767801),
    ),
    Scheme(
        "ABA(10,6,4)",
        8,
        (0.095858880837075211, 0.20444615314299878, 0.21707034797899110, -0.017375381959065093),
        (0.038094497422412195, 0.14529871611691371, 0.20762769572554125, 0.43590970365152616, -0.65386122583278671),
    ),
)
# By itself it gained over the others at any error; it leads to rows.
ABA = SCHEMES[-1]


@dataclass(frozen=True)
class Parallel(Scheme):
    """A mean, by weight, of compositions and their mirror images; given are the shares of slow flows, and where."""

    nodes: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()

    @property
    def chains(self) -> int:
        return 2 * len(self.weights)

    def listed(self, number: type) -> np.ndarray:
        nodes, slow = (np.array(each, number).reshape(-1, self.stages) for each in (self.nodes, self.slow))
        slow /= slow.sum(axis=1, keepdims=True)
        nodes, slow = np.concatenate([nodes, 1 - nodes[:, ::-1]]), np.concatenate([slow, slow[:, ::-1]])
        fast = np.diff(nodes, axis=1, prepend=0, append=1)
        return np.concatenate([[self.stages], fast.T.ravel(), slow.T.ravel(), np.tile(self.weights, 2)])


# By least squares (`docs/derivations/splitting_mean.py`): products of up to three slow flows, as oscillations of up to
# two per turn, err less in steps of 0.4 to 3.8 rad than those of ABA(10,6,4). Symmetric products of two weigh a hundred
# times as much as commutators, since what they leave is no error of a flow.
PARALLEL = Parallel(
    "parallel",
    4,
    (
        *(0.19140705651444528, 0.3250512727840904, 0.3792614666679051, 0.10428020403355924),
        *(0.21797487539631824, 0.3156206356809844, 0.29470371357521685, 0.1717007753474806),
        *(0.03991202328832809, 0.45389825294654107, 0.26375159301871554, 0.24243813074641526),
        *(0.49543100705018606, -0.06976364794746007, 0.3001419533363814, 0.2741906875608926),
    ),
    nodes=(
        *(0.02092428763540588, 0.3050255373894938, 0.6514345701754637, 0.9693069512800301),
        *(0.4383706738834181, 0.31604271635283904, 0.9122169897121791, 0.8418229841543465),
        *(0.1481374704485512, 0.37463419940583303, 0.7822616123869918, 0.96001614226974),
        *(0.3729506442043734, 0.6291939520127563, 0.7588487599981084, 0.9609626478702322),
    ),
    weights=(0.12226402714852647, -0.021027071406257924, 1.6569712744517027, -1.2582082301939712),
)


@cache
def dop853() -> SimpleNamespace:
    """SciPy's coefficients of DOP853, without the 0.2 s that its package takes to import."""
    scipy = find_spec("scipy")
    folder = Path((scipy and scipy.origin) or "scipy is not installed").parent
    return SimpleNamespace(**run_path(str(folder / "integrate" / "_ivp" / "dop853_coefficients.py")))

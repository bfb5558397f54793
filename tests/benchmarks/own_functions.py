"""What `solve_ivp` costs beside the libraries' own calls: sizes, plain Python, events. Prints one line for each.

``python tests/benchmarks/own_functions.py``; exit code 1 if a ratio is above its bound.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from scipy import sparse
from scipy.integrate import solve_ivp as scipys
from sksundae.cvode import CVODE

from polhode import solve_ivp

# Bounds on our time over the library's, and on what the first call may take besides, in seconds.
SIZE_RATIO = 1.5
SIZE_FIRST = 0.5
PLAIN_RATIO = 1.1
PLAIN_FIRST = 0.005
EVENTS_RATIO = 1.2
# Repeats of both, one after the other; the fastest of each counts. Short runs are repeated for so
# many seconds.
REPEATS = 7
SHORT_SECONDS = 0.2
# A run shorter than this, in seconds, is mostly what surrounds it.
SHORT = 1e-3
TOLERANCE = 1e-6
HOW = {"rtol": TOLERANCE, "atol": TOLERANCE}


@dataclass(frozen=True)
class Comparison:
    """Our call and the library's."""

    name: str
    ours: Callable[[], Any]
    theirs: Callable[[], Any]
    ratio: float
    first: float


def seconds(call: Callable[[], Any]) -> float:
    began = perf_counter()
    call()
    return perf_counter() - began


def heat(n: int) -> tuple[Callable[..., Any], np.ndarray, float, int]:
    """The heat equation on n points: rates, start, end, diagonals on either side."""

    def rates(t, y):
        padded = np.concatenate([[0.0], y, [0.0]])
        return (n + 1.0) ** 2 * (padded[2:] - 2 * y + padded[:-2])

    return rates, np.sin(np.pi * np.arange(1, n + 1) / (n + 1)), 0.1, 1


def brusselator(n: int) -> tuple[Callable[..., Any], np.ndarray, float, int]:
    """The Brusselator with diffusion (Hairer and Wanner II, IV.10), n / 2 points."""
    points = n // 2
    x = np.arange(1, points + 1) / (points + 1)
    start = np.empty(n)
    start[::2], start[1::2] = 1 + np.sin(2 * np.pi * x), 3.0
    diffusion = 0.02 * (points + 1) ** 2

    def rates(t, y):
        u, v = y[::2], y[1::2]
        left, right = np.concatenate([[1.0], u, [1.0]]), np.concatenate([[3.0], v, [3.0]])
        out = np.empty_like(y)
        out[::2] = 1 + u * u * v - 4 * u + diffusion * (left[2:] - 2 * u + left[:-2])
        out[1::2] = 3 * u - u * u * v + diffusion * (right[2:] - 2 * v + right[:-2])
        return out

    return rates, start, 10.0, 2


def sizes() -> list[Comparison]:
    """With the same pattern, by SciPy's methods, by SUNDIALS', and by the default one."""
    found = []
    for make in (heat, brusselator):
        for n in (400, 10_000):
            rates, start, end, bands = make(n)
            offsets = range(-bands, bands + 1)
            pattern = sparse.diags([np.ones(n - abs(k)) for k in offsets], list(offsets)).tocsc()
            times = np.linspace(0, end, 11)
            banded = {"lband": bands, "uband": bands}
            known = {"jac_sparsity": pattern}

            def ours(method: str | None, given: dict[str, Any], f=rates, y=start, at=times):
                return lambda: solve_ivp(f, (0, at[-1]), y, method, at, **given, **HOW)

            def theirs(method: str, given: dict[str, Any], f=rates, y=start, at=times):
                return lambda: scipys(f, (0, at[-1]), y, method, at, **given, **HOW)

            def cvodes(f=rates, y=start, at=times, banded=banded):
                def field(t, y, out):
                    out[:] = f(t, y)

                options = {"linsolver": "band", "max_num_steps": 10**6, **banded, **HOW}
                return lambda: CVODE(field, **options).solve(at, y)

            pairs = {
                "bdf": (ours("bdf", known), theirs("BDF", known)),
                "radau": (ours("radau", known), theirs("Radau", known)),
                "lsoda": (ours("lsoda", banded), theirs("LSODA", banded)),
                "cvode-bdf": (ours("cvode-bdf", banded), cvodes()),
                "default": (ours(None, known), cvodes()),
            }
            for method, (mine, library) in pairs.items():
                name = f"{make.__name__}, n = {n}, {method}"
                found.append(Comparison(name, mine, library, SIZE_RATIO, SIZE_FIRST))
    return found


def plain() -> list[Comparison]:
    """A right-hand side with a table, by SciPy's methods."""
    table = np.linspace(0, 50, 200)
    force = 0.37 * np.cos(1.2 * table)
    names = {"dop853": "DOP853", "rk45": "RK45", "radau": "Radau", "bdf": "BDF", "lsoda": "LSODA"}
    found = []
    for name, theirs in names.items():
        for end in (4.0, 20.0):

            def tabulated(t, y):
                return [y[1], y[0] - y[0] ** 3 - 0.3 * y[1] + np.interp(t, table, force)]

            question = tabulated, (0, end), [1.0, 0.0]
            found.append(
                Comparison(
                    f"plain Python, {name}, to t = {end:g}",
                    lambda q=question, m=name: solve_ivp(*q, m, **HOW),
                    lambda q=question, m=theirs: scipys(*q, m, **HOW),
                    PLAIN_RATIO,
                    PLAIN_FIRST,
                )
            )
    return found


def events() -> list[Comparison]:
    """1,266 passages of an oscillator through zero."""

    def oscillator(t, y):
        return [y[1], -y[0]]

    def passage(t, y):
        return y[0]

    question = oscillator, (0, 1266 * np.pi), [1.0, 0.0]
    how = {"rtol": TOLERANCE, "events": passage}
    pairs = {None: "DOP853", "dop853": "DOP853", "rk45": "RK45", "lsoda": "LSODA"}
    pairs |= {"taylor": "DOP853", "cyrk-tsit5": "RK45", "cvode-bdf": "BDF"}
    return [
        Comparison(
            f"1,266 events, {mine or 'default'}",
            lambda m=mine: solve_ivp(*question, m, **how),
            lambda m=theirs: scipys(*question, m, atol=TOLERANCE, **how),
            EVENTS_RATIO,
            np.inf,
        )
        for mine, theirs in pairs.items()
    ]


def main() -> int:
    """Print a line for each comparison; 1 if one is above its bounds."""
    chosen = {"sizes": sizes, "plain": plain, "events": events}
    names = sys.argv[1:] or list(chosen)
    above = 0
    for comparison in [each for name in names for each in chosen[name]()]:
        # The library's own imports are no part of it.
        comparison.theirs()
        first = seconds(comparison.ours)
        mine, library = [], []
        repeats = max(REPEATS, int(SHORT_SECONDS / seconds(comparison.ours)))
        for _ in range(repeats):
            mine.append(seconds(comparison.ours))
            library.append(seconds(comparison.theirs))
        ratio, extra = min(mine) / min(library), first - min(mine)
        bad = min(library) >= SHORT and ratio > comparison.ratio
        bad = bad or extra > comparison.first
        above += bad
        print(
            f"{comparison.name:34} {1e3 * min(mine):9.2f} ms, library {1e3 * min(library):9.2f} ms: "
            f"{ratio:.2f} times, first call {1e3 * extra:+.1f} ms{'  ABOVE' if bad else ''}",
            flush=True,
        )
    return int(above > 0)


if __name__ == "__main__":
    sys.exit(main())

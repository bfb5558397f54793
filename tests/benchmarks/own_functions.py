"""What `solve_ivp` costs beside the libraries' own calls: sizes, plain Python, events. Prints one line for each.

``python tests/benchmarks/own_functions.py [sizes] [plain] [events]``; exit code 1 if a ratio or a first call is
above its bound.
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

# Bounds on the time of `solve_ivp` over the library's, and on what its first call may take besides, in
# seconds: of problems by size, of plain Python, of events. Targets, set and not measured.
SIZE_RATIO = 1.5
SIZE_FIRST = 0.5
PLAIN_RATIO = 1.1
PLAIN_FIRST = 0.005
EVENTS_RATIO = 1.2
# Repeats of both, in turns; the fastest of each counts. Short runs are repeated for so many seconds.
REPEATS = 7
SHORT_SECONDS = 0.2
# A run of the library shorter than this, in seconds, is mostly what surrounds it: no ratio is required.
SHORT = 1e-3
# Relative and absolute: a usual one.
TOLERANCE = 1e-6
HOW = {"rtol": TOLERANCE, "atol": TOLERANCE}
# Sizes of the problems: a small one, and one whose full Jacobian would take 800 MB.
SIZES = (400, 10_000)
# Rows of their solutions.
SAMPLES = 11
# Passages through zero of the oscillator, one in each half period. An estimate: so many that the run is no
# short one.
PASSAGES = 1266


@dataclass(frozen=True)
class Comparison:
    """A call of `solve_ivp` and the library's own, with their bounds."""

    name: str
    ours: Callable[[], Any]
    theirs: Callable[[], Any]
    ratio: float  # Bound on the time of ours over theirs.
    first: float  # Bound on what the first call of ours takes besides, in seconds.


def seconds(call: Callable[[], Any]) -> float:
    """Wall time of a call."""
    began = perf_counter()
    call()
    return perf_counter() - began


def heat(n: int) -> tuple[Callable[..., Any], np.ndarray, float, int]:
    """The heat equation on n points between ends at 0.

    Returns the rates, the start, the end of the run, and the number of diagonals of the Jacobian on either side.
    """

    def rates(t, y):
        padded = np.concatenate([[0.0], y, [0.0]])
        return (n + 1.0) ** 2 * (padded[2:] - 2 * y + padded[:-2])

    return rates, np.sin(np.pi * np.arange(1, n + 1) / (n + 1)), 0.1, 1


def brusselator(n: int) -> tuple[Callable[..., Any], np.ndarray, float, int]:
    """The Brusselator with diffusion on n / 2 points (Hairer and Wanner II, IV.10, whose numbers it has).

    Returns as `heat` does. The state has u and v of each point in turn.
    """
    points = n // 2
    x = np.arange(1, points + 1) / (points + 1)
    start = np.empty(n)
    start[::2] = 1 + np.sin(2 * np.pi * x)
    start[1::2] = 3.0
    diffusion = 0.02 * (points + 1) ** 2

    def rates(t, y):
        u = y[::2]
        v = y[1::2]
        # With the values at both ends, u = 1 and v = 3.
        all_u = np.concatenate([[1.0], u, [1.0]])
        all_v = np.concatenate([[3.0], v, [3.0]])
        out = np.empty_like(y)
        out[::2] = 1 + u * u * v - 4 * u + diffusion * (all_u[2:] - 2 * u + all_u[:-2])
        out[1::2] = 3 * u - u * u * v + diffusion * (all_v[2:] - 2 * v + all_v[:-2])
        return out

    return rates, start, 10.0, 2


def sizes() -> list[Comparison]:
    """Large problems with the pattern of their Jacobian, by SciPy's methods, by SUNDIALS', and by the default one."""
    comparisons = []
    for make in (heat, brusselator):
        for n in SIZES:
            rates, start, end, bands = make(n)
            offsets = range(-bands, bands + 1)
            pattern = sparse.diags([np.ones(n - abs(k)) for k in offsets], list(offsets)).tocsc()
            times = np.linspace(0, end, SAMPLES)
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
                comparisons.append(Comparison(name, mine, library, SIZE_RATIO, SIZE_FIRST))
    return comparisons


def plain() -> list[Comparison]:
    """A right-hand side with a table, by SciPy's methods."""
    # Duffing's oscillator with two wells, periodically forced. The table of the force goes beyond the
    # longer run.
    table = np.linspace(0, 50, 200)
    force = 0.37 * np.cos(1.2 * table)
    names = {"dop853": "DOP853", "rk45": "RK45", "radau": "Radau", "bdf": "BDF", "lsoda": "LSODA"}
    comparisons = []
    for name, theirs in names.items():
        for end in (4.0, 20.0):

            def tabulated(t, y):
                return [y[1], y[0] - y[0] ** 3 - 0.3 * y[1] + np.interp(t, table, force)]

            question = tabulated, (0, end), [1.0, 0.0]
            comparisons.append(
                Comparison(
                    f"plain Python, {name}, to t = {end:g}",
                    lambda q=question, m=name: solve_ivp(*q, m, **HOW),
                    lambda q=question, m=theirs: scipys(*q, m, **HOW),
                    PLAIN_RATIO,
                    PLAIN_FIRST,
                )
            )
    return comparisons


def events() -> list[Comparison]:
    """An oscillator whose passages through zero are events."""

    def oscillator(t, y):
        return [y[1], -y[0]]

    def passage(t, y):
        return y[0]

    question = oscillator, (0, PASSAGES * np.pi), [1.0, 0.0]
    how = {"rtol": TOLERANCE, "events": passage}
    pairs = {None: "DOP853", "dop853": "DOP853", "rk45": "RK45", "lsoda": "LSODA"}
    pairs |= {"taylor": "DOP853", "cyrk-tsit5": "RK45", "cvode-bdf": "BDF"}
    return [
        Comparison(
            f"{PASSAGES:,} events, {mine or 'default'}",
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
    comparisons = []
    for name in names:
        comparisons += chosen[name]()
    for comparison in comparisons:
        # The library's own imports are no part of the first call.
        comparison.theirs()
        first = seconds(comparison.ours)
        mine = []
        library = []
        repeats = max(REPEATS, int(SHORT_SECONDS / seconds(comparison.ours)))
        for _ in range(repeats):
            mine.append(seconds(comparison.ours))
            library.append(seconds(comparison.theirs))
        ratio = min(mine) / min(library)
        extra = first - min(mine)
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

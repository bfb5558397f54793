"""Memory of one process over many runs: scenes by several solvers, and functions that are made, run once and freed.

`python -m torture.memory SOLVES FUNCTIONS` in the folder `tests`: exit code 1 and a line if it grows.
"""

import gc
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from itertools import cycle
from pathlib import Path

import numpy as np
from commandline import importing

from polhode.harness.api import solve
from polhode.harness.ivp import solve_ivp
from polhode.models.scene import Ellipsoid, EulerStart, Scene
from polhode.solvers.catalogue import SOLVERS

# Runs of either kind in which libraries are loaded and caches are filled; after these, memory may grow by no
# more than the second number, in MiB. Estimates: a leak of a few kB a run grows beyond it in 20,000 runs.
FIRST = 500
MAX_GROWTH = 50.0

# Solvers of the scenes: one or two of each library.
_SOLVERS = ("cyrk-vern8", "taylor", "cvode-bdf", "ida", "radau", "lsoda")


def memory() -> float:
    """Resident memory of this process, in MiB."""
    gc.collect()
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    line = next(line for line in lines if line.startswith("VmRSS"))
    # The name, a number, and its unit: kB, which are 1024 bytes here.
    return int(line.split()[1]) / 1024


def solves() -> Iterator[None]:
    """Runs of scenes that differ in their start."""
    body = Ellipsoid((1.0, 0.8, 0.5))
    for number, solver in enumerate(cycle(_SOLVERS)):
        # Starts differ, and stay so close that all runs take about as many steps.
        start = EulerStart((1.0, 0.5, 0.1 + 1e-5 * number), (1.0, 1.0, -1.0))
        scene = Scene(body, 1000.0, start, 20.0)
        solve(scene, form="quaternion", solver=solver, tolerance=1e-5, samples=5)
        yield


def functions() -> Iterator[None]:
    """Runs of functions of one's own that are accepted, a new one each time, which hold a large array."""
    for number, solver in enumerate(cycle(SOLVERS)):
        # The array, 80 kB, would show if it were not freed. Frequencies differ, and stay so close that all
        # runs take about as many steps.
        captured = np.full(10_000, 1.0 + 1e-3 * number)

        def rates(t: float, y: np.ndarray, captured: np.ndarray = captured) -> list[float]:
            return [-captured[0] * y[1], captured[0] * y[0]]

        # Some solvers accept no functions.
        with suppress(ValueError):
            solve_ivp(rates, (0.0, 1.0), [1.0, 0.0], solver, [0.0, 1.0], rtol=1e-5)
            yield


def growth(count_of_solves: int, count_of_functions: int) -> float:
    """MiB by which memory grows after the first runs of either kind, over so many runs in all of each."""
    kinds = ((solves(), count_of_solves), (functions(), count_of_functions))
    for runs, _ in kinds:
        for _ in range(FIRST):
            next(runs)
    before = memory()
    for runs, count in kinds:
        for _ in range(count - FIRST):
            next(runs)
    return memory() - before


def grown(count_of_solves: int, count_of_functions: int) -> list[str]:
    """A complaint if memory grows by more than `MAX_GROWTH` in a process of its own; else none."""
    words = map(str, (count_of_solves, count_of_functions))
    command = [sys.executable, "-m", "torture.memory", *words]
    environment = importing(Path(__file__).parents[1])
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    return [(run.stdout + run.stderr).strip()] * bool(run.returncode)


def main() -> None:
    """Measure, and complain."""
    grew = growth(*map(int, sys.argv[1:]))
    print(f"memory grew by {grew:.1f} MiB after the first {FIRST} runs of either kind")
    sys.exit(grew > MAX_GROWTH)


if __name__ == "__main__":
    main()

"""Many threads at once, cold: every scene, form and solver that go together, to the last bit as in one thread.

`python -m torture.threads THREADS SEED EVERY` in the folder `tests` prints the digest of every so
many cells as JSON.
"""

import hashlib
import json
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random

import numpy as np
from commandline import importing

from polhode.harness.api import pick, solve
from polhode.harness.ivp import solve_ivp
from polhode.models.catalogue import FORMS
from polhode.models.scene import BodyStart, Ellipsoid, EulerStart, Scene
from polhode.solvers.catalogue import SOLVERS

# Few digits and few rows make short runs: a round has all scenes, forms and solvers. Results are compared
# bit by bit, whatever their error.
TOLERANCE = 1e-5
SAMPLES = 7
# Seconds after which a round is stopped: it takes a minute or two.
_LIMIT = 1200.0
# Threads of a round, more than the processors of usual machines, so that they wait for each other.
_THREADS = 12
# What a function of one's own captures, or takes as its argument: any number, the same in all threads.
_FREQUENCY = 1.25

# Shapes, St and starts of all kinds, a few shear times each; the numbers are made up.
_SPINNING = EulerStart((1.0, 0.5, 0.1), (1.0, 1.0, -1.0))
_TUMBLING = BodyStart((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.7))
SCENES = {
    "triaxial": Scene(Ellipsoid((1.0, 0.8, 0.5)), 1000.0, _SPINNING, 6.0),
    "prolate": Scene(Ellipsoid((1.0, 1.0, 2.0)), 1000.0, _SPINNING, 6.0),
    "oblate": Scene(Ellipsoid((0.4, 1.0, 1.0)), 300.0, _SPINNING, 6.0),
    "damped": Scene(Ellipsoid((1.0, 0.8, 0.5)), 5.0, _SPINNING, 4.0),
    "damped-prolate": Scene(Ellipsoid((1.0, 1.0, 3.0)), 5.0, _SPINNING, 4.0),
    "tumbling": Scene(Ellipsoid((1.0, 0.7, 0.5)), 10.0, _TUMBLING, 4.0),
    "massless": Scene(Ellipsoid((1.0, 1.0, 2.0)), 0.0, _SPINNING, 4.0),
    "top": Scene(Ellipsoid((1.0, 2.0, 2.3)), float("inf"), _SPINNING, 4.0),
    "sphere": Scene(Ellipsoid((1.0, 1.0, 1.0)), 100.0, _SPINNING, 4.0),
}
Cell = tuple[str, str, str]
"""What one thread runs: scene, form and solver.

With `OWN` instead of a scene it is the kind of function, "shared" or "closure", and the solver. With
`DEFAULT` it is the function called, "solve" or "pick", and the scene.
"""
OWN = "own function"
DEFAULT = "by default"


def cells() -> list[Cell]:
    """All of them, those that are refused too, and functions of a user's own by every solver."""
    scenes = [(scene, form, solver) for scene in SCENES for form in FORMS for solver in SOLVERS]
    own = [(OWN, kind, solver) for kind in ("shared", "closure") for solver in SOLVERS]
    default = [(DEFAULT, call, scene) for call in ("solve", "pick") for scene in SCENES]
    return [*scenes, *own, *default]


def digest(cell: Cell) -> str:
    """The status and a checksum of all numbers of a run; empty where it is refused."""
    scene, form, solver = cell
    try:
        if scene == OWN:
            return _own(form, solver)
        if scene == DEFAULT:
            return _by_default(form, solver)
        solution = solve(
            SCENES[scene],
            form=form,
            solver=solver,
            tolerance=TOLERANCE,
            samples=SAMPLES,
            estimate=False,
        )
    except ValueError:
        return ""
    arrays = [solution.times, solution.angular_momentum, solution.energy, solution.rotation]
    return _digest(solution.status, *(array for array in arrays if array is not None))


def _digest(status: object, *arrays: np.ndarray) -> str:
    """A status, and 16 digits of the checksum of arrays: enough to tell a few thousand cells apart."""
    content = b"".join(array.tobytes() for array in arrays)
    return f"{status} {hashlib.sha256(content).hexdigest()[:16]}"


def _shared(t: float, y: np.ndarray, a: float) -> list[float]:
    """Rates of a smooth problem of three components, made up: with time, products and a quotient."""
    return [
        -a * y[1] + 0.1 * np.sin(t),
        a * y[0] - 0.2 * y[1] * y[2],
        -0.3 * y[2] / (1 + y[0] ** 2),
    ]


def _own(kind: str, solver: str) -> str:
    """The digest of a run of a function that all threads share, or of one that is made for this run."""
    frequency = _FREQUENCY

    def closure(t: float, y: np.ndarray) -> list[float]:
        return _shared(t, y, frequency)

    start = [1.0, 0.5, 0.7]
    span = (0.0, 3.0)
    times = np.linspace(*span, SAMPLES)
    if kind == "shared":
        solution = solve_ivp(_shared, span, start, solver, times, args=[frequency], rtol=TOLERANCE)
    else:
        solution = solve_ivp(closure, span, start, solver, times, rtol=TOLERANCE)
    return _digest(solution.status, solution.y)


def _by_default(call: str, scene: str) -> str:
    """The digest of `solve` with its own choices, of samples and of times between them; whether `pick` answers."""
    if call == "pick":
        # Its ranking follows times that are measured.
        return f"{len(pick(SCENES[scene], TOLERANCE).ranking) > 0}"
    solution = solve(SCENES[scene], error=TOLERANCE, samples=SAMPLES)
    # A tenth of an inverse shear rate before each sample: samples lie further apart.
    between = solution(solution.times[1:] - 0.1)
    return _digest(solution.status, solution.angular_momentum, solution.energy, between.energy)


def digests(chosen: Sequence[Cell], threads: int, seed: int) -> dict[str, str]:
    """The digest of each cell, from several threads, by the words of the cell.

    Each cell is run twice in a row, so that two threads compile the same at once. Where the two digests
    differ, both stand there.
    """
    order = list(chosen)
    Random(seed).shuffle(order)
    if threads == 1:
        return {" ".join(cell): digest(cell) for cell in order}
    twice = [cell for cell in order for _ in range(2)]
    with ThreadPoolExecutor(threads) as pool:
        results = list(pool.map(digest, twice))
    return {
        " ".join(cell): first if first == second else f"{first} and {second}"
        for cell, first, second in zip(order, results[::2], results[1::2], strict=True)
    }


def in_process(threads: int, seed: int, every: int = 1) -> dict[str, str]:
    """The digests of each `every`-th cell from a process of its own.

    Raises RuntimeError if that dies, or has not ended after `_LIMIT`: threads may wait for each other.
    """
    words = map(str, (threads, seed, every))
    command = [sys.executable, "-m", "torture.threads", *words]
    head = f"{threads} threads, seed {seed}"
    try:
        run = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=_LIMIT,
            check=False,
            env=importing(Path(__file__).parents[1]),
        )
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"{head}: no end after {_LIMIT:g} s") from None
    if run.returncode:
        last = run.stderr.strip().splitlines()[-1:]
        raise RuntimeError(f"{head}: exit code {run.returncode} {last}")
    return json.loads(run.stdout)


def threaded(seed: int, rounds: int, every: int = 1, threads: int = _THREADS) -> list[str]:
    """Complaints about so many rounds of threads beside one thread, of each `every`-th cell."""
    serial = in_process(1, seed, every)
    complaints = []
    for number in range(rounds):
        try:
            parallel = in_process(threads, seed + number, every)
        except RuntimeError as error:
            complaints.append(str(error))
            continue
        complaints += [
            f"{cell}: {parallel[cell]}, in one thread {expected}"
            for cell, expected in serial.items()
            if parallel[cell] != expected
        ]
    return complaints


def main() -> None:
    """Print the digests."""
    threads, seed, every = map(int, sys.argv[1:])
    json.dump(digests(cells()[::every], threads, seed), sys.stdout)


if __name__ == "__main__":
    main()

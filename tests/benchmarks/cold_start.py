"""Cold commands, each in processes of their own: wall and processor time, the medians of five."""

import os
import subprocess
import sys
from itertools import pairwise
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

COMMANDS = (
    "polhode --help",
    "polhode shape 1 0.8 0.5",
    "polhode forms",
    "polhode scenes",
    "polhode solvers",
    "polhode solve paper --out /dev/null",
    "polhode solve paper --form quaternion --solver cyrk-vern8 --tolerance 1e-8 --out /dev/null",
    "polhode pick paper --error 1e-6",
)
PYTHON = ("import polhode", "import polhode; polhode.solve('paper')")
RUNS = 5
AGAIN = """
import time, polhode
polhode.solve("paper")
began = time.perf_counter()
polhode.solve("paper")
print(time.perf_counter() - began)
"""


def python(*words: str, fresh: bool = False) -> str:
    """What a process prints, with a cache of its own that is empty if it is to be fresh."""
    with TemporaryDirectory() as folder:
        environment = {**os.environ, "POLHODE_CACHE": folder} if fresh else os.environ
        command = [sys.executable, *words]
        return subprocess.run(
            command, check=True, capture_output=True, text=True, env=environment
        ).stdout


def clocks() -> tuple[float, float]:
    """Wall time, and processor time of ended processes."""
    used = getrusage(RUSAGE_CHILDREN)
    return perf_counter(), used.ru_utime + used.ru_stime


def seconds(*words: str, fresh: bool = False) -> str:
    """Cells of a table: both times of a process, after one that fills the caches."""
    python(*words, fresh=fresh)
    marks = [clocks()]
    for _ in range(RUNS):
        python(*words, fresh=fresh)
        marks.append(clocks())
    wall, processor = (
        median(b - a for a, b in pairwise(column)) for column in zip(*marks, strict=True)
    )
    return f"{wall:.2f} | {processor:.2f}"


if __name__ == "__main__":
    print("| what | wall, s | processor, s |\n|---|---|---|")
    for command in COMMANDS:
        print(f"| `{command}` | {seconds('-m', *command.split())} |", flush=True)
    print(
        f"| `{COMMANDS[5]}`, a new shape | {seconds('-m', *COMMANDS[5].split(), fresh=True)} |",
        flush=True,
    )
    for code in PYTHON:
        print(f'| `python -c "{code}"` | {seconds("-c", code)} |', flush=True)
    print(
        f"| `polhode.solve('paper')` once more | {median(float(python('-c', AGAIN)) for _ in range(RUNS)):.4f} | |"
    )

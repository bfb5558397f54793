"""Cold commands, each in processes of their own: wall and processor time, the medians of five.

With --write the table goes into reports/cold-start too.
"""

import csv
import os
import subprocess
import sys
from collections.abc import Iterator
from io import StringIO
from itertools import pairwise
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from polhode.harness.common.files import write_file
from polhode.harness.common.machine import here, provenance
from polhode.harness.common.text import markdown
from polhode.harness.pages.tables import folded

# Command lines as they are timed; the page leaves out where they write.
SOLVE_COMMAND = "polhode solve paper --out /dev/null"
COMMANDS = (
    "polhode --help",
    "polhode shape 1 0.8 0.5",
    "polhode forms",
    "polhode scenes",
    "polhode solvers",
    SOLVE_COMMAND,
    "polhode solve paper --form quaternion --solver cyrk-vern8 --tolerance 1e-8 --out /dev/null",
    "polhode pick paper --error 1e-6",
)
PYTHON = ("import polhode", "import polhode; polhode.solve('paper')")
# Processes of each kind, of which the median counts: one or two slow ones do not move it.
RUNS = 5
FOLDER = Path(__file__).parents[2] / "reports" / "cold-start"
# Columns of seconds.csv; both times are in seconds.
HEADS = ("command", "wall", "processor")
_UNSEEN = " --out /dev/null"
# A program that prints the seconds of a second `solve` in its process.
AGAIN = """
import time, polhode
polhode.solve("paper")
began = time.perf_counter()
polhode.solve("paper")
print(time.perf_counter() - began)
"""


def python(*words: str, fresh: bool = False) -> str:
    """What a process prints; a fresh one has an empty cache of its own, another one the user's."""
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


def seconds(*words: str, fresh: bool = False) -> list[str]:
    """Wall and processor time of a process, in s with two decimals: medians of `RUNS`, after one that fills the caches.

    `words` are Python's command line. A fresh process has an empty cache.
    """
    python(*words, fresh=fresh)
    marks = [clocks()]
    for _ in range(RUNS):
        python(*words, fresh=fresh)
        marks.append(clocks())
    return [
        f"{median(end - begin for begin, end in pairwise(column)):.2f}"
        for column in zip(*marks, strict=True)
    ]


def rows() -> Iterator[list[str]]:
    """Rows of the table: what is run, wall and processor time in s."""
    for command in COMMANDS:
        yield [f"`{command.replace(_UNSEEN, '')}`", *seconds("-m", *command.split())]
    new = "with a new shape and an empty cache"
    words = SOLVE_COMMAND.split()
    yield [f"`{SOLVE_COMMAND.replace(_UNSEEN, '')}` {new}", *seconds("-m", *words, fresh=True)]
    for code in PYTHON:
        yield [f'`python -c "{code}"`', *seconds("-c", code)]
    again = median(float(python("-c", AGAIN)) for _ in range(RUNS))
    yield ["`polhode.solve('paper')` once more in a process", f"{again:.4f}", ""]


def write(table: list[list[str]]) -> None:
    """Write the page and its data into `FOLDER`; `table` are `rows`."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([HEADS, *table])
    write_file(FOLDER / "seconds.csv", text.getvalue(), summed=True)
    longest = max(table, key=lambda row: float(row[1]))
    answer = f"{longest[0]} takes {longest[1]} s, which is the longest of {len(table)}."
    made = folded(provenance("python tests/benchmarks/cold_start.py --write", [here()]))
    cells = markdown(["what", "wall, s", "processor, s"], table, right=(1, 2))
    how = f"Medians of {RUNS} processes each, after one that fills the caches. [seconds.csv](seconds.csv)"
    lines = ["# Cold start", "", f"- {answer}", "", cells, f"{how}", "", made, ""]
    write_file(FOLDER / "README.md", "\n".join(lines))


if __name__ == "__main__":
    print("| what | wall, s | processor, s |\n|---|---|---|")
    measured = []
    for row in rows():
        measured.append(row)
        print(f"| {' | '.join(row)} |", flush=True)
    if "--write" in sys.argv[1:]:
        write(measured)

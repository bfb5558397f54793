"""Torture: `python -m torture --minutes 20 --seed 1`, in the folder `tests`. Exit code 1 and a line for each complaint.

Inputs, flips, kills and the like come from the seed; how many, from the minutes. `--full`: more of
most, and 5,000 runs whose true error is known, in an hour or so. Names of parts, such as
`kills`, leave out the others.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

# Minutes that all parts but the last take with the `USUAL` counts, about. Parts that have no count take as
# long with fewer minutes.
USUAL_MINUTES = 20.0


class Counts(NamedTuple):
    """How many of each there are."""

    inputs: int
    flips: int
    kills: int
    fills: int  # runs of each command on a full disk


USUAL = Counts(inputs=1000, flips=500, kills=40, fills=2)
# With `--full`.
FULL = Counts(inputs=2000, flips=500, kills=100, fills=5)
# The last one, 5,000 runs, takes most of an hour: it runs with `--full`, or if it is named.
PARTS = (
    "flips",
    "races",
    "disks",
    "kills",
    "inputs",
    "libraries",
    "caches",
    "streams",
    "edges",
    "threads",
    "memory",
    "runs",
)
# Rounds of threads, each in a process of its own, of one or two minutes.
ROUNDS = 5
# Solves, and runs of functions of one's own, in one process: so many that leaks of a few kB show (`memory`).
SOLVES = 20_000
FUNCTIONS = 5_000
SUCCESSES = ("-m", "torture.successes", "--runs", "5000")


def successes() -> list[str]:
    """Complaint about false successes, and good runs doubted; the page counts them."""
    code = subprocess.run([sys.executable, *SUCCESSES], check=False).returncode
    return [f"docs/false-successes.md: exit code {code}"] * bool(code)


def main() -> None:
    """Run the parts, and print a line for each with its complaints; exit code 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--minutes",
        type=float,
        default=USUAL_MINUTES,
        help=f"below {USUAL_MINUTES:g} the counts shrink with it",
    )
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}")
    given = parser.parse_args()
    if unknown := [name for name in given.parts if name not in PARTS]:
        parser.error(f"got {unknown[0]!r}, expected one of {', '.join(PARTS)}")
    counts = FULL
    if not given.full:
        share = min(1.0, given.minutes / USUAL_MINUTES)
        counts = Counts(*(round(share * count) for count in USUAL))
    with tempfile.TemporaryDirectory() as place:
        os.environ["POLHODE_CACHE"] = str(Path(place, "p"))
        # They read the cache's place when they are imported.
        from torture.edges import at_the_edges
        from torture.flips import flipped
        from torture.fuzz import fuzzed, warm
        from torture.kills import filled, killed, raced
        from torture.memory import grown
        from torture.surroundings import closed, foreign, without
        from torture.threads import threaded

        def folder(name: str) -> Path:
            path = Path(place, name)
            path.mkdir()
            return path

        spoiled = Path("../build/torture")
        spoiled.mkdir(parents=True, exist_ok=True)
        parts: dict[str, tuple[str, Callable[[], list[str]]]] = {
            "flips": (f"{counts.flips} bit flips", lambda: flipped(given.seed, counts.flips)),
            "races": ("races", lambda: raced(folder("races"))),
            "disks": (
                f"{counts.fills} full disks for each command",
                lambda: filled(given.seed, counts.fills, folder("full")),
            ),
            "kills": (
                f"{counts.kills} kills",
                lambda: killed(given.seed, counts.kills, folder("kills")),
            ),
            "inputs": (
                f"{counts.inputs} inputs",
                lambda: fuzzed(given.seed, counts.inputs, spoiled),
            ),
            "libraries": ("libraries taken away", lambda: without(folder("libraries"))),
            "caches": ("foreign cache folders", lambda: foreign(folder("caches"))),
            "streams": ("closed streams", lambda: closed(folder("streams"))),
            "edges": (
                f"{counts.inputs} scenes at the edges",
                lambda: at_the_edges(given.seed, counts.inputs, spoiled),
            ),
            "threads": (
                f"{ROUNDS} rounds of 12 cold threads",
                lambda: threaded(given.seed, ROUNDS),
            ),
            "memory": (
                f"{SOLVES} solves, {FUNCTIONS} functions",
                lambda: grown(SOLVES, FUNCTIONS),
            ),
            "runs": ("5000 runs", successes),
        }
        chosen = given.parts or (PARTS if given.full else PARTS[:-1])
        if {"inputs", "edges"} & set(chosen):
            warm()
        complaints = 0
        for name in chosen:
            title, part = parts[name]
            began = time.monotonic()
            part_complaints = part()
            complaints += len(part_complaints)
            print(
                f"{title}: {len(part_complaints)} complaints, {time.monotonic() - began:.0f} s",
                *part_complaints,
                sep="\n  ",
                flush=True,
            )
    sys.exit(complaints > 0)


if __name__ == "__main__":
    main()

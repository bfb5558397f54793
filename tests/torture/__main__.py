"""Torture: `python -m torture --minutes 20 --seed 1`, in the folder `tests`. Exit code 1 and a line for each complaint.

Inputs, flips and kills come from the seed; how many, from the minutes. `--full`: more of each, and
5,000 runs whose true error is known, in 50 minutes or so. Names of parts, such as `kills`, leave
out the others.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

# How many inputs, flips, kills, and runs of each command on a full disk: in 20 minutes, and in all
# that was asked for.
USUAL, FULL = (1000, 500, 40, 2), (2000, 500, 100, 5)
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
# Rounds of threads, each in a process of its own.
ROUNDS = 5
# Solves, and functions of one's own, in one process.
RUNS = (20_000, 5_000)
SUCCESSES = ("-m", "torture.successes", "--runs", "5000")


def successes() -> list[str]:
    """Complaint about false successes, and good runs doubted; the page counts them."""
    code = subprocess.run([sys.executable, *SUCCESSES], check=False).returncode
    return [f"docs/false-successes.md: exit code {code}"] * bool(code)


def main() -> None:
    """Do it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--minutes", type=float, default=20.0, help="at most; the counts shrink with it"
    )
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}")
    given = parser.parse_args()
    if unknown := [name for name in given.parts if name not in PARTS]:
        parser.error(f"got {unknown[0]!r}, expected one of {', '.join(PARTS)}")
    share = 1.0 if given.full else min(1.0, given.minutes / 20.0)
    fuzzes, flips, kills, fills = (
        round(share * count) for count in (FULL if given.full else USUAL)
    )
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
            "flips": (f"{flips} bit flips", lambda: flipped(given.seed, flips)),
            "races": ("races", lambda: raced(folder("races"))),
            "disks": (
                f"{fills} full disks for each command",
                lambda: filled(given.seed, fills, folder("full")),
            ),
            "kills": (f"{kills} kills", lambda: killed(given.seed, kills, folder("kills"))),
            "inputs": (f"{fuzzes} inputs", lambda: fuzzed(given.seed, fuzzes, spoiled)),
            "libraries": ("libraries taken away", lambda: without(folder("libraries"))),
            "caches": ("foreign cache folders", lambda: foreign(folder("caches"))),
            "streams": ("closed streams", lambda: closed(folder("streams"))),
            "edges": (
                f"{fuzzes} scenes at the edges",
                lambda: at_the_edges(given.seed, fuzzes, spoiled),
            ),
            "threads": (
                f"{ROUNDS} rounds of 12 cold threads",
                lambda: threaded(given.seed, ROUNDS),
            ),
            "memory": (f"{RUNS[0]} solves, {RUNS[1]} functions", lambda: grown(*RUNS)),
            "runs": ("5000 runs", successes),
        }
        chosen = given.parts or (PARTS if given.full else PARTS[:-1])
        if {"inputs", "edges"} & set(chosen):
            warm()
        complaints = 0
        for name, part in (parts[each] for each in chosen):
            began, found = time.monotonic(), part()
            complaints += len(found)
            print(
                f"{name}: {len(found)} complaints, {time.monotonic() - began:.0f} s",
                *found,
                sep="\n  ",
                flush=True,
            )
    sys.exit(complaints > 0)


if __name__ == "__main__":
    main()

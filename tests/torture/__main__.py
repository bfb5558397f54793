"""Torture: `python -m torture --minutes 20 --seed 1`, in the folder `tests`. Exit code 1 and a line for each complaint.

Inputs, flips and kills come from the seed; how many, from the minutes.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

FUZZED, FLIPPED, KILLED = 2000, 500, 100


def main() -> None:
    """Do it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=20.0, help="at most; the counts shrink with it")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    share = min(1.0, given.minutes / 20.0)
    with tempfile.TemporaryDirectory() as place:
        os.environ["POLHODE_CACHE"] = str(Path(place, "p"))
        # They read the cache's place when they are imported.
        from torture.flips import flipped
        from torture.fuzz import fuzzed, warm
        from torture.kills import killed, raced

        def folder(name: str) -> Path:
            path = Path(place, name)
            path.mkdir()
            return path

        parts: dict[str, Callable[[], list[str]]] = {
            f"{round(FLIPPED * share)} bit flips": lambda: flipped(given.seed, round(FLIPPED * share)),
            "races": lambda: raced(folder("races")),
            f"{round(KILLED * share)} kills": lambda: killed(given.seed, round(KILLED * share), folder("kills")),
            f"{round(FUZZED * share)} inputs": lambda: fuzzed(
                given.seed, round(FUZZED * share), Path("torture-inputs")
            ),
        }
        Path("torture-inputs").mkdir(exist_ok=True)
        warm()
        complaints = 0
        for name, part in parts.items():
            began, found = time.monotonic(), part()
            complaints += len(found)
            print(f"{name}: {len(found)} complaints, {time.monotonic() - began:.0f} s", *found, sep="\n  ", flush=True)
    sys.exit(complaints > 0)


if __name__ == "__main__":
    main()

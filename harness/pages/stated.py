"""The page of stated errors: how many hold, by kind of confirmation, and how many answers meet the error.

A run states an interval of its error. `polhode.harness.answers.coverage` holds it against a reference and counts
how many hold; a kind of confirmation is how the run was compared with another (`docs/method.md`).
"""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from polhode.harness.answers import coverage
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import here, provenance
from polhode.harness.common.store import Record
from polhode.harness.pages.tables import fill

# Numbers of one scene alone in a refusal: a list in brackets, a slow time, what it got. Without them
# refusals for one reason have one text.
_OWN_NUMBERS = re.compile(r"\[[^\]]*\]|(?<=t₂ = )[\d.]+(?:e[+-]\d+)?|(?<=got )[\d.e+-]*\d")


def write_page(folder: Path, rows: Sequence[Record], command: str) -> Path:
    """Write `stated.md` into a folder and return its path.

    `rows` come from `polhode.harness.answers.coverage`: a row for each run, or for a scene that was
    left out, with the reason under "left_out".
    """
    counts = coverage.counted(rows)
    # Numbers of runs: those that state no error, and all that were judged.
    silent, judged = coverage.unstated(rows)
    page = fill(
        "stated",
        made=provenance(command, [here()]),
        limits=coverage,
        counts=counts,
        # Kinds whose statements miss too many errors, and kinds whose statements lie too far above them.
        over=[count for count in counts if count.missed > coverage.MOST_MISSED * count.runs],
        loose=[count for count in counts if count.factor > coverage.LARGEST_FACTOR],
        answers=coverage.answered(rows),
        silent=silent,
        judged=judged,
        left_out=reasons(row["left_out"] for row in rows if "left_out" in row),
    )
    return write_file(folder / "stated.md", page)


def reasons(refusals: Iterable[str]) -> str:
    """Reasons and how often each occurred, the most frequent first, in words.

    "…" stands for numbers of one scene alone, so that equal reasons are counted together.
    """
    counts = Counter(_OWN_NUMBERS.sub("…", refusal) for refusal in refusals)
    return "; ".join(f"{count} × {reason}" for reason, count in counts.most_common())

"""The page on what each part of `pick`'s race buys (`polhode.harness.answers.ablation`).

The race picks a method for each scene with one of its parts left out, and with all of them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.answers import heldout
from polhode.harness.answers.ablation import ALL_PARTS, compared
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import here, provenance
from polhode.harness.common.store import Record
from polhode.harness.pages.tables import fill

# Three significant digits of numbers in `ablation.csv`: times vary by more than a hundredth between repeats.
_CSV_NUMBER = "%.3g"


def write_page(folder: Path, rows: Sequence[Record], command: str) -> Path:
    """Write `ablation.md` and `ablation.csv` into a folder and return the page's path.

    `rows` come from `polhode.harness.answers.ablation`: a row for each scene and part left out
    ("without"). "met" says whether the chosen run met the error; "asking" is the choice's time in s.
    """
    table: Any = pd.DataFrame(rows)
    text = table.to_csv(index=False, float_format=_CSV_NUMBER)
    write_file(folder / "ablation.csv", text, summed=True)
    # The races that nothing is left out of.
    whole = table[table["without"] == ALL_PARTS]
    page = fill(
        "ablation",
        made=provenance(command, [here()]),
        limits=heldout,
        scenes=len(whole),
        met=int(whole["met"].sum()),
        asking=float(whole["asking"].median()),
        rows=compared(table),
    )
    return write_file(folder / "ablation.md", page)

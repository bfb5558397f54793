"""The page of the time to an answer, over plain practice.

Plain practice is what a careful user does by hand (`polhode.harness.answers.timed`): one solver of the
full form, its tolerance tightened tenfold until two runs agree to half the requested error. The
column `apart` is how far answer and plain practice differ.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from polhode.harness.answers import timed
from polhode.harness.answers.timed import Timing, strata
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import here, provenance
from polhode.harness.pages.tables import fill


def write_page(folder: Path, timings: Sequence[Timing], command: str, load: int = 0) -> Path:
    """Write `time.md` and `times.csv` into a folder and return the page's path.

    `load` is the number of other processes that kept the processors busy. With 8 of them the files are
    `time-load8.md` and `times-load8.csv`. The template takes its targets from the module `timed`.
    """
    text = pd.DataFrame(timings).to_csv(index=False, float_format="%.4g")
    suffix = f"-load{load}" if load else ""
    write_file(folder / f"times{suffix}.csv", text, summed=True)
    page = fill(
        "answer-time",
        made=provenance(command, [here()]),
        limits=timed,
        load=load,
        data=f"times{suffix}.csv",
        rows=strata(timings, load),
        missed=[timing for timing in timings if timing.apart > timed.MISSED * timing.error],
    )
    return write_file(folder / f"time{suffix}.md", page)

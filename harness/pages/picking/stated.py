"""The page of the errors that `solve` states, held against references."""

from pathlib import Path

import pandas as pd

from polhode.harness.calibration.stated import judged
from polhode.harness.common.files import write_file
from polhode.harness.common.text import duration, markdown
from polhode.harness.picking.second_look import BOUNDED, LEAST, SHARE


def write_page(folder: Path, runs: pd.DataFrame, command: str) -> Path:
    """Write the page of the errors that `solve` states, and its table."""
    write_file(folder / "stated.csv", runs.to_csv(index=False, float_format="%.4g"), summed=True)
    rows = []
    for (stratum, solver), mine in [
        *(((stratum, "all"), mine) for stratum, mine in runs.groupby("stratum")),
        *((("both", solver), mine) for solver, mine in runs.groupby("solver")),
    ]:
        found = judged(mine)
        shares = [f"{found[name]:.1%}" for name in ("stated", "bounded", "cheap")]
        rows.append([stratum, solver, found["runs"], *shares, f"{found['factor']:.2g}"])
    header = ["stratum", "solver", "runs", "stated", "bounded", "in time", "stated over true, median"]
    lines = [
        "# The error that `solve` states",
        "",
        f"Made by `{command}`. Do not edit: the next run overwrites this page.",
        "",
        *(f"- {sentence}" for sentence in summary(runs)),
        "",
        "Each run is a random scene by a random form, solver and tolerance, with a certified reference; runs of "
        "more rotations than are certified in seconds are left out. *In time*: the second look took no more than its "
        "share of the run, or than it may on a short one. Every run is in [stated.csv](stated.csv).",
        "",
        markdown(header, rows, right=range(2, 7)),
    ]
    page = folder / "stated.md"
    write_file(page, "\n".join(lines))
    return page


def summary(runs: pd.DataFrame) -> list[str]:
    """What the errors stated are worth, in sentences."""
    found = judged(runs)
    return [
        f"The error stated bounds the true one in {found['bounded']:.1%} of {found['runs']} runs (target: "
        f"{BOUNDED:.1%}); {found['stated']:.1%} state one.",
        f"It is {found['factor']:.2g} times the true error in the median (target: at most 10).",
        f"The second look takes at most {SHARE:.0%} of the run, or {duration(LEAST)}, in {found['cheap']:.1%}.",
    ]

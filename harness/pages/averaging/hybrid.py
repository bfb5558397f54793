"""The page of the study of the form `hybrid`: how often it meets the requested error, and how fast it is.

Columns are the fields of `HybridError` (`Study.errors`) and `Speed` (`Study.speed`), where they are
described. "slow" is the error of L and E over I_max. Templates take the study's numbers from `form`,
which is the module `polhode.harness.averaging.hybrid`.
"""

from collections.abc import Sequence
from pathlib import Path
from statistics import quantiles
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import frame_of
from polhode.harness.averaging import hybrid
from polhode.harness.averaging.data import write_study
from polhode.harness.averaging.hybrid import HybridError, Speed, Study
from polhode.harness.common.files import write_file
from polhode.harness.common.fits import wilson
from polhode.harness.common.machine import provenance
from polhode.harness.common.text import short
from polhode.harness.pages.figures.hybrid import errors_and_speed
from polhode.harness.pages.figures.style import measured, repeats_vary, save
from polhode.harness.pages.tables import fill, lines_of


def write_page(study: Study, folder: Path, command: str) -> None:
    """Write the page and its data into a folder."""
    write_study(study, folder)
    if study.errors:
        runs = _judged(study.errors)
        speeds = _compared(study.speed)
        # `SPEED_REPEATS` is the number of turns, and of runs in each turn.
        note = (
            f"{runs['start'].nunique()} random starts by {hybrid.SEGMENT_SOLVER}. Allowed: the error "
            "requested, or the reference's uncertainty if larger. Speed: error "
            f"{short(hybrid.FAST_ERROR)}, t₂ = {hybrid.FAST_SLOW_TIME:g}, beside "
            f"{' and '.join(hybrid.FULL_SOLVERS)} at tolerances {short(hybrid.FULL_TOLERANCES[0])} to "
            f"{short(hybrid.FULL_TOLERANCES[-1])}; the shortest of {hybrid.SPEED_REPEATS**2} warm "
            f"runs; {measured(_made(study, command))}. Steps show the spread over starts and bodies, "
            f"pale lines its quartiles; {_repeats(speeds)}."
        )
        save(errors_and_speed(runs, speeds, note), folder, "errors")
    write_file(folder / "README.md", page(study, command))


def page(study: Study, command: str) -> str:
    """The report as Markdown."""
    # Columns of the table of errors: the column of `_judged` that each is made of, and how.
    columns = {
        "runs": ("slow", "size"),
        "within": ("within", "mean"),
        "bounded": ("bounded", "mean"),
        "largest": ("slow", "max"),
        "over": ("over", "median"),
        "full": ("full_share", "median"),
    }
    solved = _judged(study.errors).dropna(subset=["slow"])
    errors = solved.groupby(["stokes", "error"]).agg(**columns)
    speeds = _compared(study.speed).groupby(["stokes", "bodies"])
    medians = speeds[["seconds", "few_seconds", "full_share", "gain", "over_knowing"]].median()
    return fill(
        "hybrid",
        made=_made(study, command),
        findings=findings(study),
        form=hybrid,
        repeats=_repeats(_compared(study.speed)),
        errors=errors.sort_index(ascending=[True, False]).reset_index().to_dict("records"),
        speeds=medians.assign(runs=speeds.size()).reset_index().to_dict("records"),
    )


def _repeats(speeds: Any) -> str:
    """By how much the repeats of compared runs differ from turn to turn, or that it was not kept."""
    columns = ("seconds", "few_seconds", "full_seconds", "knowing_seconds")
    seconds = pd.concat([speeds[name] for name in columns])
    spreads = pd.concat([speeds[f"{name}_spread"] for name in columns])
    vary = repeats_vary(seconds, spreads)
    return f"the turns' shortest times {vary}" if vary else "the spread of repeats was not kept"


def _made(study: Study, command: str) -> list[str]:
    """The lines by which the page says how it was made."""
    timed = [study.timed.get(part, {}) for part in hybrid.HYBRID_PARTS if getattr(study, part)]
    return provenance(command, timed)


def findings(study: Study) -> list[str]:
    """The findings in sentences."""
    runs = _judged(study.errors)
    speeds = _compared(study.speed)
    gains = speeds.dropna(subset=["gain"]).groupby("stokes")
    # Milliseconds that tables take, of shapes that have some: spheroids have none.
    times = 1e3 * speeds.loc[speeds["new_shape"] > 0, ["new_shape", "known_shape"]]
    stated = runs.dropna(subset=["estimated"])
    triaxial = speeds[speeds["kind"] == "triaxial"]
    # Starts that were timed at every St.
    everywhere = triaxial.pivot_table(index="start", columns="stokes", values="seconds").dropna()
    return lines_of(
        "hybrid-findings",
        form=hybrid,
        runs=runs,
        wilson=wilson,
        stated=stated,
        ratios=stated["over"][stated["slow"] > 0],
        settled=runs.dropna(subset=["mirror"]),
        worst=(runs["slow"] / runs[["error", "uncertainty"]].max(axis=1)).max(),
        # The sentence gives quantiles, which need two runs.
        gains=[(stokes, stokes_gains) for stokes, stokes_gains in gains if len(stokes_gains) > 1],
        quantiles=quantiles,
        # The sentence compares St: with one of them it is left out.
        everywhere=everywhere if everywhere.shape[1] > 1 else [],
        tables=[(seconds.median(), seconds.max()) for _, seconds in times.items() if len(seconds)],
    )


def _judged(rows: Sequence[HybridError]) -> Any:
    """The runs as a table, with three more columns.

    `within`: whether the error of L and E is at most the requested one; `bounded`: whether it is at most the
    estimated one, empty without an estimate. An error below the reference's uncertainty counts as both.
    `over` is the estimate over the measured error, or over that uncertainty if it is larger.
    """
    runs = frame_of(HybridError, rows)
    runs["within"] = runs["slow"] <= runs[["error", "uncertainty"]].max(axis=1)
    runs["bounded"] = (runs["slow"] <= runs[["estimated", "uncertainty"]].max(axis=1)).where(
        runs["estimated"].notna()
    )
    runs["over"] = runs["estimated"] / runs[["slow", "uncertainty"]].max(axis=1)
    return runs


def _compared(rows: Sequence[Speed]) -> Any:
    """The runs as a table, with four more columns.

    `bodies` is "triaxial" or "spheroids". `gain` is the time of the best full solution over the time of
    `hybrid`, `over_knowing` the same for a solver that knows St. `fewer` is the ratio of the steps of the full
    solution and of the segments that `hybrid` solves in full.
    """
    runs = frame_of(Speed, rows)
    runs["bodies"] = runs["kind"].where(runs["kind"] == "triaxial", "spheroids")
    runs["gain"] = runs["full_seconds"] / runs["seconds"]
    runs["over_knowing"] = runs["knowing_seconds"] / runs["seconds"]
    runs["fewer"] = (runs["full_steps"] / runs["segment_steps"]).where(runs["segment_steps"] > 0)
    return runs

"""The page of the study of the form `hybrid`: how often it keeps its word, and how fast it is."""

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import pandas as pd

from polhode.harness.averaging import hybrid
from polhode.harness.averaging.data import write_study
from polhode.harness.averaging.hybrid import HybridError, Speed, Study
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.text import in_two_digits, short
from polhode.harness.pages.figures.averaging import errors_and_speed
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import bullets, fill, table


def write_page(study: Study, folder: Path, command: str) -> None:
    """Write the page and its data into a folder."""
    write_study(study, folder)
    save(errors_and_speed(study), folder, "errors")
    write_file(folder / "README.md", page(study, command))


def page(study: Study, command: str) -> str:
    """The report as Markdown."""
    timed = [study.timed.get(part, {}) for part in hybrid.PARTS if getattr(study, part)]
    return fill(
        "hybrid",
        header=header("Form hybrid: errors and speed", command, timed),
        findings=bullets(findings(study)),
        form=hybrid,
        errors=table(_errors(_judged(study.errors)), "hybrid-errors"),
        speed=_speed(study.speed) if study.speed else "",
    )


def _speed(rows: Sequence[Speed]) -> str:
    solvers = " and ".join(hybrid.FULL_SOLVERS)
    return fill(
        "hybrid-speed", solvers=solvers, speeds=table(_speeds(rows), "hybrid-speed", few=hybrid.FEW), form=hybrid
    )


def findings(study: Study) -> list[str]:
    """What was found, in sentences."""
    rows, runs = study.errors, _judged(study.errors)
    found = [
        f"Of {len({row.start for row in rows})} random starts at {len(hybrid.ERRORS)} errors, "
        f"{sum(row.status == 'reached_end' for row in rows)} of {len(rows)} runs reached their end.",
        f"The slow error was within the one asked for in {_percent(runs['within'])} of the runs.",
        *_stated(runs.dropna(subset=["estimated"]), len(rows)),
    ]
    sure = runs["mirror"].dropna()
    if len(sure):
        found.append(f"The settled body ended the right way up in {_percent(sure)} of {len(sure)} runs.")
    for stokes in hybrid.FAST:
        gains = [row.full_seconds / row.seconds for row in study.speed if row.stokes == stokes]
        gains = [gain for gain in gains if isfinite(gain)]
        if len(gains) > 1:
            found.append(
                f"At St = {short(stokes)}, t₂ = {hybrid.FAST_SLOW_TIME:g} and error {short(hybrid.FAST_ERROR)} it was "
                f"{in_two_digits(median(gains))} times as fast as the faster one of "
                f"{' and '.join(hybrid.FULL_SOLVERS)} in the median, "
                f"at least {in_two_digits(quantiles(gains, n=10)[0])} times in nine of ten."
            )
    return [*found, *_prepared(study.speed)]


def _prepared(rows: Sequence[Speed]) -> list[str]:
    """How long the tables of a triaxial shape take."""
    times = [[getattr(row, name) for row in rows if row.new_shape] for name in ("new_shape", "known_shape")]
    if not all(times):
        return []
    new, known = (
        f"{in_two_digits(1e3 * median(each))} ms in the median, {in_two_digits(1e3 * max(each))} at most"
        for each in times
    )
    return [f"The tables of a triaxial shape took {new}, when not seen before; read from disk {known}."]


def _judged(rows: Sequence[HybridError]) -> Any:
    """The runs as a table, with whether each kept its word and how its estimate compares."""
    runs = pd.DataFrame(rows)
    runs["within"] = runs["slow"] <= runs[["error", "uncertainty"]].max(axis=1)
    runs["bounded"] = (runs["slow"] <= runs[["estimated", "uncertainty"]].max(axis=1)).where(runs["estimated"].notna())
    runs["over"] = runs["estimated"] / runs[["slow", "uncertainty"]].max(axis=1)
    return runs


def _stated(runs: Any, of: int) -> list[str]:
    """What the errors are worth that runs state of themselves."""
    ratios = runs["over"][runs["slow"] > 0]
    if not len(ratios):
        return []
    return [
        f"{len(runs)} of {of} runs state an error of their own: it bounds the one measured in "
        f"{_percent(runs['bounded'])}, and is {in_two_digits(median(ratios))} times as large in the median."
    ]


def _percent(holds: Any) -> str:
    return f"{100 * float(holds.astype(float).mean()):.3g} %"


def _errors(runs: Any) -> list[dict[Any, Any]]:
    return (
        runs.dropna(subset=["slow"])
        .groupby(["stokes", "error"])
        .agg(
            runs=("slow", "size"), within=("within", "mean"), bounded=("bounded", "mean"), largest=("slow", "max"),
            over=("over", "median"), full=("full_share", "median"),
        )
        .sort_index(ascending=[True, False])
        .reset_index()
        .to_dict("records")
    )  # fmt: skip


def _speeds(rows: Sequence[Speed]) -> list[dict[Any, Any]]:
    runs = pd.DataFrame(rows)
    runs["bodies"] = runs["kind"].where(runs["kind"] == "triaxial", "spheroids")
    runs["gain"] = runs["full_seconds"] / runs["seconds"]
    runs["runs"] = 1
    found = runs.groupby(["stokes", "bodies"])
    medians = found[["seconds", "few_seconds", "full_share", "gain"]].median()
    return medians.assign(runs=found["runs"].sum()).reset_index().to_dict("records")

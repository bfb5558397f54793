"""The page of the study of the form `hybrid`: how often it keeps its word, and how fast it is."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import product
from math import isfinite, isnan, nan
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from polhode.harness.averaging import hybrid
from polhode.harness.averaging.hybrid import HybridError, Speed, Study
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header, machine, now, versions
from polhode.harness.common.text import in_two_digits, short
from polhode.harness.pages.figures.averaging import errors_and_speed
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import table

ERRORS = {
    "St": "{stokes:number}",
    "error asked for": "{error:number}",
    "runs": "{runs}",
    "within": "{within}",
    "bounded": "{bounded}",
    "largest error": "{largest:error}",
    "over": "{over:two}",
    "in full": "{full:two}",
}
SPEEDS = {
    "St": "{stokes:number}",
    "bodies": "{bodies}",
    "runs": "{runs}",
    "time": "{time:time}",
    f"with {hybrid.FEW} samples": "{few:time}",
    "in full": "{full:two}",
    "times as fast": "{gain:two}",
}
SPEED = (
    "## Speed",
    "",
    f"Random starts, t₂ = {hybrid.FAST_SLOW_TIME:g}, error {short(hybrid.FAST_ERROR)}, {hybrid.SAMPLES} samples; "
    "medians; observables and planning are within the times, tables and compilation are not. *Times as fast*: as "
    f"the faster one of {' and '.join(hybrid.FULL_SOLVERS)} at the loosest tolerance that meets the error.",
    "",
)


def write_page(study: Study, folder: Path, command: str) -> None:
    """Write the page and its data into a folder."""
    hybrid.write(study, folder)
    save(errors_and_speed(study), folder, "errors")
    write_file(folder / "README.md", page(study, command))


def as_json(study: Study) -> dict[str, Any]:
    """All that was measured, as plain data."""
    return asdict(study)


def as_text(study: Study) -> str:
    """What was found, for a terminal."""
    return "\n".join(findings(study))


def page(study: Study, command: str) -> str:
    """The report as Markdown."""
    here = {"date": now(), "machine": machine(), "versions": versions()}
    return "\n".join(
        [
            *header("Form hybrid: errors and speed", command, [here]),
            *(f"- {sentence}" for sentence in findings(study)),
            "",
            "![Error measured against the one asked for; speed against a full solution](errors.png)",
            "",
            "How the form works: [docs](../../docs/second-order.md). Data: [errors](errors.csv), [speed](speed.csv).",
            "",
            "## Errors by St and error asked for",
            "",
            f"Random starts, half of them triaxial, by `{hybrid.SOLVER}`; slow errors are the largest over "
            f"{hybrid.SAMPLES} samples, over I_max. *Within*: runs within the error asked for, or within the truth's "
            "uncertainty. *Bounded*: runs whose error is below the estimate; *over*: median of estimate over error. "
            "*In full*: median share of the time that the full equations follow.",
            "",
            table(_errors(study.errors), ERRORS, left=0),
            *([*SPEED, table(_speeds(study.speed), SPEEDS, left=0)] if study.speed else []),
        ]
    )


def findings(study: Study) -> list[str]:
    """What was found, in sentences."""
    rows = study.errors
    found = [
        f"Of {len({row.start for row in rows})} random starts at {len(hybrid.ERRORS)} errors, "
        f"{sum(row.status == 'reached_end' for row in rows)} of {len(rows)} runs reached their end.",
        f"The slow error was within the one asked for in {_percent(rows, _within)} of the runs.",
        f"It was below the run's own estimate in {_percent(rows, lambda row: row.slow <= row.estimated)}, which "
        f"exceeded it {in_two_digits(median([row.estimated / row.slow for row in rows if row.slow > 0]))} times in "
        "the median.",
    ]
    sure = [row for row in rows if not isnan(row.mirror)]
    if sure:
        right = _percent(sure, lambda row: row.mirror == 1)
        found.append(f"The settled body ended the right way up in {right} of {len(sure)} runs.")
    for stokes in hybrid.FAST:
        gains = [row.full_seconds / row.seconds for row in study.speed if row.stokes == stokes]
        gains = [gain for gain in gains if isfinite(gain)]
        if len(gains) > 1:
            found.append(
                f"At St = {short(stokes)}, t₂ = {hybrid.FAST_SLOW_TIME:g} and error {short(hybrid.FAST_ERROR)} it was "
                f"{in_two_digits(median(gains))} times as fast as the best full solution in the median, "
                f"{in_two_digits(quantiles(gains, n=10)[0])} times in nine of ten."
            )
    return found


def _within(row: HybridError) -> bool:
    return row.slow <= max(row.error, row.uncertainty)


def _percent(rows: Sequence[HybridError], holds: Callable[[HybridError], bool]) -> str:
    return f"{100 * sum(map(holds, rows)) / max(1, len(rows)):.3g} %"


def _errors(rows: Sequence[HybridError]) -> list[dict[str, Any]]:
    found = []
    for stokes, error in product(hybrid.STOKES, hybrid.ERRORS):
        some = [row for row in rows if (row.stokes, row.error) == (stokes, error) and not isnan(row.slow)]
        if some:
            row = {"stokes": stokes, "error": error, "runs": len(some), "within": _percent(some, _within)}
            row |= {"bounded": _percent(some, lambda row: row.slow <= row.estimated), "largest": max(_slow(some))}
            row |= {"over": median([row.estimated / row.slow for row in some])}
            found.append(row | {"full": median([row.full_share for row in some])})
    return found


def _slow(rows: Sequence[HybridError]) -> list[float]:
    return [row.slow for row in rows]


def _speeds(rows: Sequence[Speed]) -> list[dict[str, Any]]:
    found = []
    for stokes, bodies in product(hybrid.FAST, ("spheroids", "triaxial")):
        some = [r for r in rows if r.stokes == stokes and (r.kind == "triaxial") == (bodies == "triaxial")]
        gains = [row.full_seconds / row.seconds for row in some if isfinite(row.full_seconds)]
        if some:
            row = {"stokes": stokes, "bodies": bodies, "runs": len(some), "gain": median(gains) if gains else nan}
            row |= {"time": median([r.seconds for r in some]), "few": median([r.few_seconds for r in some])}
            found.append(row | {"full": median([r.full_share for r in some])})
    return found

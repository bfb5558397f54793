"""The page of the study of the form `hybrid`: how often it keeps its word, and how fast it is."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from math import isfinite, isnan
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from polhode.harness.averaging import hybrid
from polhode.harness.averaging.hybrid import HybridError, Speed, Study
from polhode.harness.common.machine import header, machine, now, versions
from polhode.harness.common.text import duration, in_two_digits, markdown, scientific, short


def write_page(study: Study, folder: Path, command: str) -> None:
    """Write the page and its data into a folder."""
    hybrid.write(study, folder)
    (folder / "README.md").write_text(page(study, command), encoding="utf-8")


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
            "How the form works: [docs](../../docs/second-order.md). Data: [errors](errors.csv), [speed](speed.csv).",
            "",
            "## What was found",
            "",
            *(f"- {sentence}" for sentence in findings(study)),
            "",
            "## Errors by St and error asked for",
            "",
            f"Random starts, half of them triaxial, by `{hybrid.SOLVER}`; slow errors are the largest over "
            f"{hybrid.SAMPLES} samples, over I_max. *Within*: runs within the error asked for, or within the truth's "
            "uncertainty. *Bounded*: runs whose error is below the estimate; *over*: median of estimate over error. "
            "*In full*: median share of the time that the full equations follow.",
            "",
            _errors(study.errors),
            *(_speeds(study.speed) if study.speed else []),
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


def _errors(rows: Sequence[HybridError]) -> str:
    table = []
    for stokes in hybrid.STOKES:
        for error in hybrid.ERRORS:
            some = [row for row in rows if (row.stokes, row.error) == (stokes, error) and not isnan(row.slow)]
            if some:
                table.append(
                    (
                        *(short(stokes), short(error), len(some), _percent(some, _within)),
                        *(_percent(some, lambda row: row.slow <= row.estimated), scientific(max(r.slow for r in some))),
                        in_two_digits(median([row.estimated / row.slow for row in some])),
                        in_two_digits(median([row.full_share for row in some])),
                    )
                )
    head = ("St", "error asked for", "runs", "within", "bounded", "largest error", "over", "in full")
    return markdown(head, table, right=range(8))


def _speeds(rows: Sequence[Speed]) -> list[str]:
    table = []
    for stokes in hybrid.FAST:
        for kind in ("spheroids", "triaxial"):
            some = [r for r in rows if r.stokes == stokes and (r.kind == "triaxial") == (kind == "triaxial")]
            gains = [row.full_seconds / row.seconds for row in some if isfinite(row.full_seconds)]
            if some:
                table.append(
                    (
                        *(short(stokes), kind, len(some), duration(median([row.seconds for row in some]))),
                        duration(median([row.few_seconds for row in some])),
                        in_two_digits(median([row.full_share for row in some])),
                        in_two_digits(median(gains)) if gains else "–",
                    )
                )
    head = ("St", "bodies", "runs", "time", f"with {hybrid.FEW} samples", "in full", "times as fast")
    return [
        "## Speed",
        "",
        f"Random starts, t₂ = {hybrid.FAST_SLOW_TIME:g}, error {short(hybrid.FAST_ERROR)}, {hybrid.SAMPLES} samples; "
        "medians; observables and planning are within the times, tables and compilation are not. *Times as fast*: as "
        f"the faster one of {' and '.join(hybrid.FULL_SOLVERS)} at the loosest tolerance that meets the error.",
        "",
        markdown(head, table, right=(0, *range(2, 7))),
    ]

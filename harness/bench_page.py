"""The page of the main job: table, figures, verdict, all from the records."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.figures import save, work_precision_panels
from polhode.harness.provenance import header
from polhode.harness.store import Record, export
from polhode.harness.study import Study
from polhode.harness.tables import frame, where
from polhode.harness.text import bracketed, duration, markdown, scientific
from polhode.harness.uncertainty import BRACKETS, least_known, uncertainty_of
from polhode.harness.verdict import TARGETS, averaged_costs, cheapest, sentences
from polhode.solvers.contract import Status


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its figures and its data into a folder and return the page's path."""
    table = frame(records)
    folder.mkdir(parents=True, exist_ok=True)
    export(list(records), folder / "records.jsonl")
    save(work_precision_panels(table, "slow_error", "slow error over $I_{max}$"), folder, "slow")
    save(work_precision_panels(table, "orientation_error", "orientation error, rad"), folder, "orientation")
    page = folder / "README.md"
    page.write_text("\n".join(_lines(study, table, records, command)), encoding="utf-8")
    return page


def _lines(study: Study, table: pd.DataFrame, records: Sequence[Record], command: str) -> list[str]:
    return [
        *header(study.title, command, records),
        "## Verdict",
        "",
        *(f"- {sentence}" for sentence in [*sentences(table), *averaged_costs(table)]),
        "",
        "The cheapest run that meets a slow error (form, solver, tolerance: time; methods within 15 % of it):",
        "",
        _winners(table, "slow_error"),
        "The same for the orientation error, in rad:",
        "",
        _winners(table, "orientation_error"),
        "## Cost against error",
        "",
        "![Wall time against slow error, one panel per St](slow.png)",
        "",
        "![Wall time against orientation error, one panel per St](orientation.png)",
        "",
        "## Every run",
        "",
        f"Times are the minimum of up to five warm runs in interleaved order, over {study.samples} samples; "
        "*first* is compilation, where it happened in this case; errors are maxima along the run; the slow error of an "
        "averaged form is split into solver error and model error; *RHS* counts every call of the vector field. "
        f"{BRACKETS}",
        "",
        *_every_run(table),
        _uncertainties(table),
    ]


def _winners(table: pd.DataFrame, error: str) -> str:
    numbers = sorted(set(table["stokes"].astype(float)))
    rows = []
    for target in TARGETS:
        row = [f"{target:g}"]
        for stokes in numbers:
            runs = where(table, table["stokes"] == stokes)
            uncertainty = runs[uncertainty_of(error)].dropna()
            if len(uncertainty) and target <= least_known(float(uncertainty.iloc[0])):
                row.append("unknown: the reference cannot tell")
                continue
            winner = cheapest(runs, target, error)
            if winner is None:
                row.append("none")
                continue
            best = winner.row
            tied = f" (tied: {', '.join(winner.tied)})" if winner.tied else ""
            time = duration(float(best["seconds"]))  # pyright: ignore[reportArgumentType]
            row.append(f"{best['form']}, {best['solver']}, {best['tolerance']:g}: {time}{tied}")
        rows.append(row)
    return markdown(["error", *(f"St = {stokes:g}" for stokes in numbers)], rows)


def _every_run(table: pd.DataFrame) -> list[str]:
    lines = []
    for stokes in sorted(set(table["stokes"].astype(float))):
        runs = where(table, table["stokes"] == stokes)
        rows = [_row(run) for run in runs.to_dict("records")]
        header = ["form", "solver", "tolerance", "slow error", "of which solver", "of which model", "orientation"]
        header += ["time", "spread", "first", "RHS", "steps", "status"]
        lines += [f"### St = {stokes:g}", "", markdown(header, rows, right=range(2, 12))]
    return lines


def _row(run: dict) -> list[str]:
    status = str(run["status"]).replace("_", " ")
    first = 0.0 if pd.isna(run["prepare_seconds"]) else run["prepare_seconds"]
    averaged = not pd.isna(run["model_slow_error"]) and run["model_slow_error"] > 0
    return [
        run["form"],
        run["solver"],
        f"{run['tolerance']:g}",
        _error(run, "slow"),
        scientific(run["solver_slow_error"]) if averaged else "",
        scientific(run["model_slow_error"]) if averaged else "",
        _error(run, "orientation"),
        duration(run["seconds"]),
        duration(run["seconds_spread"]),
        duration(first) if first > COMPILED else "",
        _count(run["work.rhs_calls"]),
        _count(run["work.steps"]),
        status + (", inferred" if run["inferred"] else "") if status != Status.REACHED_END.replace("_", " ") else "",
    ]


def _error(run: dict, want: str) -> str:
    """An error in figures, in brackets where it is not known."""
    error = run[f"{want}_error"]
    return scientific(error) if pd.isna(error) else bracketed(error, bool(run[f"{want}_known"]))


# Preparing an integrator that was compiled before takes less than this, in seconds.
COMPILED = 0.02


def _count(value: Any) -> str:
    return "–" if value is None or value is pd.NA else str(int(value))


def _uncertainties(table: pd.DataFrame) -> str:
    rows = []
    for stokes in sorted(set(table["stokes"].astype(float))):
        runs = where(table, (table["stokes"] == stokes) & table["slow_uncertainty"].notna())
        if not runs.empty:
            first = runs.iloc[0]
            numbers = scientific(first["slow_uncertainty"]), scientific(first["orientation_uncertainty"])
            rows.append([f"{stokes:g}", *numbers])
    text = "Uncertainty of the references (long double Taylor runs; not less than what half an ulp in the start makes):"
    return f"{text}\n\n{markdown(['St', 'slow', 'orientation, rad'], rows)}"

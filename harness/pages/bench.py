"""The page of the main job: table, figures, verdict, all from the records."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import frame, where
from polhode.harness.analysis.winners import TARGETS, averaged_costs, by_scene, cheapest, sentences
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import bracketed, duration, markdown, scientific
from polhode.harness.pages.bench_scenes import scenes_section
from polhode.harness.pages.work_precision import save, work_precision_panels
from polhode.harness.references.uncertainty import BRACKETS, least_known, uncertainty_of
from polhode.harness.studies.study import Study
from polhode.solvers.contract import Status

# By the name of their file: error, label of its axis, and what stands for the picture where it is not shown.
FIGURES = {
    "slow": ("slow_error", "slow error over $I_{max}$", "Wall time against slow error, one panel per St"),
    "orientation": (
        "orientation_error",
        "orientation error, rad",
        "Wall time against orientation error, one panel per St",
    ),
}


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its figures and its data into a folder and return the page's path."""
    table = frame(records)
    folder.mkdir(parents=True, exist_ok=True)
    export(list(records), folder / "records.jsonl")
    for (scene, runs), ending in zip(by_scene(table), _endings(table), strict=True):
        for name, (error, label, _) in FIGURES.items():
            if len(runs[error].dropna()):
                title = f"{scene}: {label}" if scene else label
                save(work_precision_panels(runs, error, title), folder, f"{name}{ending}")
    page = folder / "README.md"
    page.write_text("\n".join(_lines(study, table, records, command)), encoding="utf-8")
    return page


def _endings(table: pd.DataFrame) -> list[str]:
    """What is added to the names of each scene's figures: nothing to those of the first."""
    return ["", *(f"-{scene}" for scene, _ in by_scene(table)[1:])]


def _lines(study: Study, table: pd.DataFrame, records: Sequence[Record], command: str) -> list[str]:
    return [
        *header(study.title, command, records),
        *scenes_section(records),
        "## Verdict",
        "",
        *(f"- {sentence}" for sentence in [*sentences(table), *averaged_costs(table)]),
        "",
        *(line for scene, runs in by_scene(table) for line in _best(scene, runs)),
        "## Cost against error",
        "",
        *(
            line
            for (scene, runs), ending in zip(by_scene(table), _endings(table), strict=True)
            for name, (error, _, text) in FIGURES.items()
            if len(runs[error].dropna())
            for line in (f"![{f'{scene}: ' if scene else ''}{text}]({name}{ending}.png)", "")
        ),
        "## Every run",
        "",
        f"Times are the minimum of up to five warm runs in interleaved order, over {study.samples} samples; "
        "*first* is compilation, where it happened in this case; errors are maxima along the run; the slow error of an "
        "averaged form is split into solver error and model error; *RHS* counts every call of the vector field. "
        f"{BRACKETS}",
        "",
        *(line for scene, runs in by_scene(table) for line in _every_run(scene, runs)),
        _uncertainties(table),
    ]


def _best(scene: str, runs: pd.DataFrame) -> list[str]:
    """Who is the cheapest at each error."""
    return [
        *([f"### The cheapest: {scene}", ""] if scene else []),
        "The cheapest run that meets a slow error (form, solver, tolerance: time; methods within 15 % of it):",
        "",
        _winners(runs, "slow_error"),
        "The same for the orientation error, in rad:",
        "",
        _winners(runs, "orientation_error"),
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
            tied = f" (tied: {winner.ties})" if winner.ties else ""
            time = duration(float(best["seconds"]))  # pyright: ignore[reportArgumentType]
            row.append(f"{best['form']}, {best['solver']}, {best['tolerance']:g}: {time}{tied}")
        rows.append(row)
    return markdown(["error", *(f"St = {stokes:g}" for stokes in numbers)], rows)


def _every_run(scene: str, table: pd.DataFrame) -> list[str]:
    lines = []
    for stokes in sorted(set(table["stokes"].astype(float))):
        runs = where(table, table["stokes"] == stokes)
        rows = [_row(run) for run in runs.to_dict("records")]
        columns = ["form", "solver", "tolerance", "slow error", "of which solver", "of which model", "orientation"]
        columns += ["time", "spread", "first", "RHS", "steps", "status"]
        lines += [
            f"### {f'{scene}, ' if scene else ''}St = {stokes:g}",
            "",
            markdown(columns, rows, right=range(2, 12)),
        ]
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
    for scene, runs in by_scene(where(table, table["slow_uncertainty"].notna())):
        for stokes in sorted(set(runs["stokes"].astype(float))):
            first = where(runs, runs["stokes"] == stokes).iloc[0]
            numbers = scientific(first["slow_uncertainty"]), scientific(first["orientation_uncertainty"])
            rows.append([*([scene] if scene else []), f"{stokes:g}", *numbers])
    text = "Uncertainty of the references (long double Taylor runs; not less than what half an ulp in the start makes):"
    columns = [*(["scene"] if rows and len(rows[0]) == 4 else []), "St", "slow", "orientation, rad"]
    return f"{text}\n\n{markdown(columns, rows)}"

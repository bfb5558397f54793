"""Data for the scripts of two pages: the question with its answers and the map; cost against error, run by run."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from io import BytesIO
from itertools import chain, groupby
from math import isnan
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import (
    NEEDED,
    RUN_COLUMNS,
    by_stokes,
    frame,
    of_runs,
    rows_of,
    where,
)
from polhode.harness.analysis.pareto import Cell, usual_form
from polhode.harness.common.files import read_file
from polhode.harness.common.store import read_export
from polhode.harness.common.text import duration, factor, short
from polhode.harness.pages.figures.map_picture import MAP_ERRORS, by_side
from polhode.harness.pages.figures.style import colour, is_averaged, looks
from polhode.harness.pages.figures.work_precision import LARGEST_ERROR
from polhode.harness.pages.regimes import read_cells
from polhode.harness.site.markup import Page, html
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Status

TITLE = "What should I run?"
# The two kinds of error: the word of `--want`, and the page's name.
_WANTS = {"slow_error": ("slow", "L and E"), "orientation_error": ("orientation", "orientation")}
# Letters of a name that may be broken at its hyphens.
_LONG = 12

_COSTS = "Cost against accuracy"
_LEAD = "Every run measured: wall time, or calls of the right-hand side, against the error along the whole run."
_WORDS = ("form", "solver", "status", "message")
RUN_NUMBERS = (
    "slow_error",
    "orientation_error",
    "seconds",
    "work.rhs_calls",
    "work.steps",
    "model_slow_error",
)


def question(folder: Path, sure: str = "") -> tuple[str, dict[str, Any]]:
    """The question, its maps, and its script's data, from `folder`, empty without cells; `sure`: who never failed."""
    path = folder / "cells.csv"
    panels = read_cells(path) if path.is_file() else {}
    if not panels:
        return "", {}
    file = folder / "runs.csv"
    runs = pd.read_csv(BytesIO(read_file(file))) if file.is_file() else pd.DataFrame()
    reached = where(
        runs.reindex(columns=pd.Index(RUN_COLUMNS)),
        lambda frame: frame["status"] == Status.REACHED_END,
    )
    shapes = reached.groupby("scene_name")["scene.shape.semi_axes"].first().dropna()
    particles = {name: f"{name} {shapes.get(name, '')}".strip() for name, _ in panels}
    maps = [_map(name, error, cells) for (name, error), cells in panels.items()]
    body = html(
        "verdict",
        particles=particles,
        maps=maps,
        sure=sure,
        colour=colour,
        factor=factor,
        long=_LONG,
    )
    data = {
        "particles": particles,
        "wants": dict(_WANTS.values()),
        "columns": _answers(panels, reached),
    }
    return body, {"question-data": data}


def _answers(
    panels: Mapping[tuple[str, str], Sequence[Cell]], reached: pd.DataFrame
) -> list[dict[str, Any]]:
    """Columns for the script: span and averaging by particle, kind of error and St; the answer of each cell there."""
    columns = []
    for (name, error), cells in panels.items():
        scene_runs = where(reached, (reached["scene_name"] == name) & reached[error].notna())
        for stokes in dict.fromkeys(cell.stokes for cell in cells):
            runs = where(scene_runs, scene_runs["stokes"] == stokes)
            answers = [_answer(cell, runs, error) for cell in cells if cell.stokes == stokes]
            place = {"particle": name, "want": _WANTS[error][0], "St": stokes}
            columns.append(place | _there(runs, error) | {"cells": answers})
    return columns


def _there(runs: Any, error: str) -> dict[str, Any]:
    """How far the runs at one St go, and the least error of each averaged form among them."""
    averaged: Any = where(runs, runs["form"].map(is_averaged))
    span_and_averaging: dict[str, Any] = {
        "averaging": averaged.groupby("form", sort=False)[error].min().to_dict()
    }
    for stokes, time in runs[["stokes", "scene.time"]].dropna().head(1).to_numpy().tolist():
        span_and_averaging["span"] = f"t = {short(time)}" + (
            f", t₂ = {short(time / stokes)}" if stokes else ""
        )
    return span_and_averaging


def _answer(cell: Cell, runs: Any, error: str) -> dict[str, Any]:
    """The method of a cell, and the loosest tolerance with which it reaches the error."""
    answer = {"error": cell.target, "known": cell.known}
    if cell.winner:
        form, solver = cell.winner
        answer |= {"form": form, "solver": solver}
        answer |= {
            "time": duration(cell.seconds),
            "next": str(cell.second or ""),
            "tied": cell.tied,
        }
        answer["lead"] = "" if isnan(cell.lead) else factor(cell.lead)
        good = (runs["form"] == form) & (runs["solver"] == solver) & (runs[error] <= cell.target)
        answer["tolerance"] = short(runs.loc[good, "tolerance"].max()) if good.any() else ""
    return answer


def _map(particle: str, error: str, panel: Sequence[Cell]) -> dict[str, Any]:
    """Content of a map: its cells in rows by error, and the methods that win, by kind."""
    ordered = sorted(panel, key=lambda cell: (-cell.target, cell.stokes))
    rows = [[*row] for _, row in groupby(ordered, key=lambda cell: cell.target)]
    key = by_side(cell.winner for cell in panel if cell.winner)
    about = {"name": particle, "want": _WANTS[error][0], "title": MAP_ERRORS[error][1]}
    return about | {"key": key, "rows": rows, "usual": usual_form(panel)}


def cost_page(reports: Path) -> Page:
    """Every run of every study as a point."""
    studies, unreadable = read_studies(
        reports, (*_WORDS, *RUN_NUMBERS, "backend", "jacobian", "inferred", "tags")
    )
    body = html("cost", studies=studies, unreadable=unreadable)
    if not studies:
        return Page(_COSTS, _LEAD, body)
    groups = []
    rows = []
    for study, table in studies.items():
        for scene, scene_runs in table.groupby("scene_name", sort=False):
            for stokes, runs in by_stokes(scene_runs):
                rows += [[len(groups), *_row(run)] for run in rows_of(runs)]
                tags: Any = runs["tags"] if "tags" in runs else pd.Series(dtype=object)
                groups.append(
                    [study, scene, stokes, sorted(tags.explode().dropna().astype(str).unique())]
                )
    # A line stands together and goes from the loosest tolerance to the tightest.
    rows.sort(key=lambda row: (*row[:3], -row[5]))
    # Words stand once: columns hold their places.
    words: dict[str, int] = {}
    for value in chain.from_iterable(rows):
        if isinstance(value, str):
            words.setdefault(value, len(words))
    names = ("group", *_WORDS, "tolerance", "inferred", *RUN_NUMBERS)
    columns = {}
    for name, values in zip(names, zip(*rows, strict=True), strict=True):
        columns[name] = _runs(words[v] if isinstance(v, str) else v for v in values)
    forms = {}
    for name, look in looks(str(row[1]) for row in rows).items():
        averaged = is_averaged(name)
        color = look.colour if averaged else "#555"
        forms[name] = {"averaged": averaged, "color": color, "mark": look.outline}
    data = {
        "words": list(words),
        "groups": groups,
        "columns": columns,
        "forms": forms,
        "solvers": _solvers({str(row[2]) for row in rows}),
        "largest": LARGEST_ERROR,
        "meanings": {str(status): status.meaning for status in Status},
    }
    return Page(_COSTS, _LEAD, body, {"cost-data": data}, ("tables.js", "chart.js", "cost.js"))


def _row(run: dict[Any, Any]) -> list[Any]:
    """A run as the page's script reads it, its solver with the back end and the Jacobian where they were chosen."""
    chosen = [str(run[name]) for name in ("backend", "jacobian") if run.get(name)]
    method = f"{run['solver']} ({', '.join(chosen)})" if chosen else run["solver"]
    values = [run["form"], method, run["status"], run.get("message") or "", float(run["tolerance"])]
    return [*values, int(bool(run.get("inferred"))), *(run.get(name) for name in RUN_NUMBERS)]


def _runs(values: Iterable[Any]) -> list[Any]:
    """The values, those that stand several times in a row as [value, times]."""
    counted = ((value, len([*same])) for value, same in groupby(values))
    return [value if times == 1 else [value, times] for value, times in counted]


def _solvers(names: set[str]) -> dict[str, Any]:
    """Look and tags of the solvers, in the order of the catalogue."""
    solvers = {}
    for solver, look in looks(name.partition(" ")[0] for name in names).items():
        method = find_solver(solver) if solver in SOLVERS else None
        for name in sorted(name for name in names if name.partition(" ")[0] == solver):
            compiled = (
                method
                and "compiled" in method.backends
                and "(numba" not in name
                and "(python" not in name
            )
            tags = ["implicit" if method and method.implicit else "explicit"]
            tags.append("compiled" if compiled else "Python in the loop")
            solvers[name] = {"color": look.colour, "mark": look.outline, "tags": tags}
    return solvers


def read_studies(
    folder: Path, columns: Collection[str]
) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Runs of each study by the name of its folder, and file if it holds several; and the files that cannot be read."""
    studies = {}
    unreadable = []
    # Folders of `reports` that hold no study.
    not_studies = ("site", "paper", "accuracy", "pick", "problems")
    folders = [
        path
        for path in sorted(folder.glob("*"))
        if path.name.removesuffix("-quick") not in not_studies
    ]
    # Exported records; where there are none, the table of runs.
    paths = []
    for study_folder in folders:
        paths += sorted(study_folder.glob("*.jsonl")) or study_folder.glob("runs.csv")
    for path in paths:
        name = (
            path.parent.name
            if path.stem in ("records", "runs")
            else f"{path.parent.name}/{path.stem}"
        )
        try:
            if path.suffix == ".csv":
                table = pd.read_csv(BytesIO(read_file(path)), dtype_backend="numpy_nullable")
            else:
                table = frame(read_export(path), {*NEEDED, *columns})
            studies[name] = of_runs(table, path)
        except (ValueError, OSError) as error:
            unreadable.append(f"{path}: {str(error).removeprefix(f'{path}: ')}")
    return studies, unreadable

"""The opening page: a question with its answer from the measured cells, and the regime map as a table."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from io import BytesIO
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.pareto import Cell, usual_form
from polhode.harness.common.files import read_file
from polhode.harness.common.text import duration, factor, short
from polhode.harness.pages.figures.map_picture import ERRORS, HEADINGS
from polhode.harness.pages.figures.style import colour, is_averaged, rank
from polhode.harness.pages.regimes import read_cells
from polhode.harness.site.markup import html
from polhode.solvers.contract import Status

TITLE = "What should I run?"
# What the page calls the two kinds of error, and the word of `--want`.
WANTS = {"slow_error": ("slow", "L and E"), "orientation_error": ("orientation", "orientation")}
# Letters of a name that may be broken at its hyphens.
LONG = 12


def question(folder: Path, sure: str = "") -> tuple[str, dict[str, Any]]:
    """The question, its maps, and its script's data, from `folder`, empty without cells; `sure`: who never failed."""
    path = folder / "cells.csv"
    found = read_cells(path) if path.is_file() else {}
    if not found:
        return "", {}
    reached = _reached(folder / "runs.csv")
    shapes = {name: runs[0].get("scene.shape.semi_axes", "") for (name, _), runs in reached.items()}
    particles = {name: f"{name} {shapes.get(name, '')}".strip() for name, _ in found}
    maps = [_map(name, error, cells) for (name, error), cells in found.items()]
    body = html("verdict", particles=particles, maps=maps, sure=sure, colour=colour, factor=factor, long=LONG)
    data = {"particles": particles, "wants": dict(WANTS.values()), "columns": _answers(found, reached)}
    return body, {"question-data": data}


def _answers(
    found: Mapping[tuple[str, str], Sequence[Cell]], reached: Mapping[tuple[str, float], list[dict[Any, Any]]]
) -> list[dict[str, Any]]:
    """What the script knows: of a particle, kind of error and St the span and averaging; of a cell there the answer."""
    columns = []
    for (name, error), cells in found.items():
        for stokes in dict.fromkeys(cell.stokes for cell in cells):
            runs = [run for run in reached.get((name, stokes), []) if not isnan(run[error])]
            answers = [_answer(cell, runs, error) for cell in cells if cell.stokes == stokes]
            place = {"particle": name, "want": WANTS[error][0], "St": stokes}
            columns.append(place | _there(runs, error) | {"cells": answers})
    return columns


def _there(runs: Sequence[dict[Any, Any]], error: str) -> dict[str, Any]:
    """How far the runs at one St go, and the least error of each averaged form among them."""
    averaging: dict[str, float] = {}
    for run in runs:
        if is_averaged(run["form"]):
            averaging[run["form"]] = min(run[error], averaging.get(run["form"], inf))
    if not runs or isnan(time := runs[0].get("scene.time", nan)):
        return {"averaging": averaging}
    slow = f", t₂ = {short(time / runs[0]['stokes'])}" if runs[0]["stokes"] else ""
    return {"averaging": averaging, "span": f"t = {short(time)}{slow}"}


def _answer(cell: Cell, runs: Sequence[dict[Any, Any]], error: str) -> dict[str, Any]:
    """The method of a cell, and the loosest tolerance with which it reaches the error."""
    answer = {"error": cell.target, "known": cell.known}
    if cell.winner:
        method = cell.winner.form, cell.winner.solver
        answer |= dict(zip(("form", "solver"), method, strict=True))
        answer |= {"time": duration(cell.seconds), "next": str(cell.second or ""), "tied": cell.tied}
        answer["lead"] = "" if isnan(cell.lead) else factor(cell.lead)
        own = [run for run in runs if (run["form"], run["solver"]) == method and run[error] <= cell.target]
        answer["tolerance"] = short(max(run["tolerance"] for run in own)) if own else ""
    return answer


def _reached(path: Path) -> Mapping[tuple[str, float], list[dict[Any, Any]]]:
    """Finished runs by scene and St."""
    found = defaultdict(list)
    for run in pd.read_csv(BytesIO(read_file(path))).to_dict("records") if path.is_file() else ():
        if run["status"] == Status.REACHED_END:
            found[run["scene_name"], run["stokes"]].append(run)
    return found


def _map(particle: str, error: str, found: Sequence[Cell]) -> dict[str, Any]:
    """What a map shows: its cells in rows by error, and the methods that win, by kind."""
    rows = defaultdict(list)
    for cell in sorted(found, key=lambda cell: (-cell.target, cell.stokes)):
        rows[cell.target].append(cell)
    winners = {cell.winner.label: cell.winner.side for cell in found if cell.winner}
    kinds = [(words, [name for name in winners if winners[name] == side]) for side, words in HEADINGS.items()]
    key = [(words, sorted(labels, key=rank)) for words, labels in kinds if labels]
    about = {"name": particle, "want": WANTS[error][0], "title": ERRORS[error][1]}
    return about | {"key": key, "rows": [*rows.values()], "usual": usual_form(found)}

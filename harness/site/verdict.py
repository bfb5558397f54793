"""The opening page: a question with its answer from the measured cells, and the regime map as a table."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from html import escape
from io import BytesIO
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.regime_map import Cell, usual_form
from polhode.harness.common.files import read_file
from polhode.harness.common.text import duration, factor, short
from polhode.harness.pages.figures.map_picture import ERRORS, HEADINGS
from polhode.harness.pages.figures.style import colour, is_averaged, rank
from polhode.harness.pages.regimes import read_cells
from polhode.harness.pages.tables import fill
from polhode.harness.site.markup import prose, scroll
from polhode.solvers.contract import Status

TITLE = "What should I run?"
OWN = "This is measured on the two particles of the map. For a scene of your own: `polhode pick scene.toml`."
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
    sections = "".join(
        f'<section class="region" data-particle="{escape(name)}" data-want="{WANTS[error][0]}"><h3>'
        f"The {particles[name]}: {prose(ERRORS[error][1].replace('$I_{max}$', 'I_max'))}</h3>"
        f"{_key(cells)}{_map(name, WANTS[error][0], cells)}</section>"
        for (name, error), cells in found.items()
    )
    body = (
        '<form class="filters ask" id="ask" aria-label="Question"></form><div id="answer" role="status"></div>'
        f'<p class="note">{prose(OWN)}</p>{_sure(sure)}<h2>The map</h2><p class="note">{fill("site-map")}</p>{sections}'
    )
    data = {"particles": particles, "wants": dict(WANTS.values()), "columns": _answers(found, reached)}
    return body, {"question-data": data}


def _sure(sentence: str) -> str:
    """Who never failed, with the way to the hard cases."""
    link = '<a href="hard-cases.html">The hard cases</a>'
    return f"<h2>Which solver never failed?</h2><p>{prose(sentence)} {link}, one by one.</p>" if sentence else ""


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


def _key(found: Sequence[Cell]) -> str:
    """Colours by kind, and the form that full equations are run in."""
    winners = {cell.winner.label: cell.winner.side for cell in found if cell.winner}
    lines = []
    for side, (_, kind) in HEADINGS.items():
        own = sorted((name for name in winners if winners[name] == side), key=rank)
        marks = "".join(f'<span style="--c:{colour(name)}">{escape(name)}</span>' for name in own)
        lines += [f'<p class="key"><b>{kind}</b>{marks}</p>'] if own else []
    note = f"Full equations in the form {usual_form(found)}, unless a cell names another."
    return f"{''.join(lines)}<p class=note>{note}</p>"


def _map(particle: str, want: str, found: Sequence[Cell]) -> str:
    numbers = sorted({cell.stokes for cell in found})
    targets = sorted({cell.target for cell in found}, reverse=True)
    at = {(cell.stokes, cell.target): cell for cell in found}
    usual = usual_form(found)
    head = "".join(f"<th scope=col>{prose(short(stokes))}</th>" for stokes in numbers)

    def cells(target: float) -> str:
        return "".join(_cell(at[stokes, target], usual, f"particle={particle}&want={want}") for stokes in numbers)

    rows = "".join(f"<tr><th scope=row>{prose(short(target))}</th>{cells(target)}</tr>" for target in targets)
    corner = "<th class=axis>error ↓ St →</th>"
    table = f"<table class=map><thead><tr>{corner}{head}</tr></thead><tbody>{rows}</tbody></table>"
    return scroll(table, f"Map of the {particle}, {want}")


def _cell(cell: Cell, usual: str, question: str) -> str:
    if cell.winner is None:
        words = "none" if cell.known else "unknown"
        tip = "no run measured gets there" if cell.known else "below what the reference resolves"
        return f'<td class="none" title="{tip}">{words}</td>'
    label, time = cell.winner.label, duration(cell.seconds)
    name = f"<b{' class=long' if len(label) > LONG else ''}>{escape(label)}</b>"
    form = "" if cell.winner.side == "averaged" or cell.winner.form == usual else f"<i>{escape(cell.winner.form)}</i>"
    lead = (
        f" ={cell.second.label}" if cell.tied and cell.second else "" if isnan(cell.lead) else f" {factor(cell.lead)}"
    )
    tip = escape(f"{cell.winner}: {time}; next: {cell.second or 'none'}")
    address = escape(f"#{question}&St={short(cell.stokes)}&error={short(cell.target)}")
    content = f'<a href="{address}">{name}{form}<span>{time}{escape(lead)}</span></a>'
    return f'<td style="--c:{colour(label)}" title="{tip}">{content}</td>'

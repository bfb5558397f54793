"""Data for the scripts of two pages: the question with its answers and the map; cost against error, run by run.

The opening page asks for a particle, a St, an error and its kind; `verdict.js` answers as `look_up` of
`polhode.harness.site.lookup` does, from the data of `question`. `cost.js` draws the data of `cost_page`.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from io import BytesIO
from itertools import chain, groupby
from math import floor, isnan, log10, nan
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import (
    NEEDED,
    RUN_COLUMNS,
    by_stokes,
    frame,
    of_runs,
    read_csv,
    rows_of,
    where,
)
from polhode.harness.analysis.in_full import ran_in_full
from polhode.harness.analysis.pareto import Method, cost, front, limit_of, methods, pareto_front
from polhode.harness.analysis.regime_map import Cell, usual_form
from polhode.harness.common.files import read_file
from polhode.harness.common.store import read_export, record_files
from polhode.harness.common.text import factor, short
from polhode.harness.pages.figures.map_picture import MAP_ERRORS, by_side
from polhode.harness.pages.figures.style import both_colours, is_averaged, looks
from polhode.harness.pages.figures.work_precision import LARGEST_ERROR
from polhode.harness.pages.regimes import read_cells
from polhode.harness.site.markup import DATA_DIGITS, Page, html
from polhode.harness.studies.study import read_study
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Status

QUESTION_TITLE = "What should I run?"
# The two kinds of error by column: the word of `--want`, and the page's name.
_WANTS = {"slow_error": ("slow", "L and E"), "orientation_error": ("orientation", "orientation")}
# Errors at which methods are compared for the question, from 1 to 1e-14, which is tighter than all runs.
# A method that leads between two neighbours alone would be missed: 16 in a decade are an estimate of how
# narrow a lead may be.
_ERRORS_IN_A_DECADE = 16
_DECADES = 14
_ERRORS = tuple(
    10.0 ** (-place / _ERRORS_IN_A_DECADE) for place in range(_DECADES * _ERRORS_IN_A_DECADE + 1)
)
# Letters beyond which a name in a cell of the map may be broken at its hyphens; chosen by eye.
_LONG = 12
# Decimals of a method's relative spread: it is compared with a tie (`pareto.TIE`), which has as many.
_SPREAD_DECIMALS = 2

_COSTS = "Cost against accuracy"
_LEAD = "Every run measured: wall time, or calls of the right-hand side, against the error along the whole run."
# Columns of a run that `cost.js` reads: words, of which few differ, and numbers. Times are in seconds.
_WORDS = ("form", "solver", "status", "message")
RUN_NUMBERS = (
    "slow_error",
    "orientation_error",
    "seconds",
    "work.rhs_calls",
    "work.steps",
    "model_slow_error",
)
# Columns of all runs, as `cost.js` reads them.
_COST_COLUMNS = ("group", *_WORDS, "tolerance", "inferred", *RUN_NUMBERS)
# Colour of the full equations in the key, in both themes: solvers have colours of their own.
_FULL_FORM = "light-dark(#4A5361, #A3ADBA)"


def question(folder: Path, sure: str = "") -> tuple[str, dict[str, Any]]:
    """The question and its maps as HTML, and the data of its script by element id.

    Both are empty if `folder`, which is the regime map's, has no `cells.csv`. `sure` is a sentence on who never
    failed.
    """
    path = folder / "cells.csv"
    panels = read_cells(path) if path.is_file() else {}
    if not panels:
        return "", {}
    file = folder / "runs.csv"
    runs = read_csv(BytesIO(read_file(file))) if file.is_file() else pd.DataFrame()
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
        colour=both_colours,
        factor=factor,
        long=_LONG,
    )
    data = {
        "particles": particles,
        "wants": dict(_WANTS.values()),
        "columns": question_columns(panels, reached, read_study(None, "regimes").scenes),
    }
    return body, {"question-data": data}


def question_columns(
    panels: Mapping[tuple[str, str], Sequence[Cell]],
    reached: pd.DataFrame,
    scenes: Sequence[tuple[str, Scene]] = (),
) -> list[dict[str, Any]]:
    """The data of `look_up`: the `lookup.Column` of each particle, kind of error and St.

    Parameters
    ----------
    panels
        Cells of the maps, by the particle's name and the column of the error.
    reached
        Runs that reached their end, a frame.
    scenes
        Scenes of the study with their names. They tell which runs of `hybrid` average nothing: these are
        left out.
    """
    columns = []
    for (name, error), cells in panels.items():
        scene_runs = where(reached, (reached["scene_name"] == name) & reached[error].notna())
        scene_runs = where(scene_runs, ~ran_in_full(scene_runs, scenes))
        for stokes in dict.fromkeys(cell.stokes for cell in cells):
            runs = where(scene_runs, scene_runs["stokes"] == stokes)
            limit = limit_of(runs, error) if len(runs) else nan
            column = {"particle": name, "want": _WANTS[error][0], "St": stokes}
            column["limit"] = None if isnan(limit) else _rounded_up(limit)
            column["span"] = _span(runs)
            column["methods"] = _methods(runs, error)
            columns.append(column)
    return columns


def _span(runs: pd.DataFrame) -> str:
    """How far the runs at one St go, in words."""
    for stokes, time in runs[["stokes", "scene.time"]].dropna().head(1).to_numpy().tolist():
        return f"t = {short(time)}" + (f", t₂ = {short(time / stokes)}" if stokes else "")
    return ""


def _methods(runs: pd.DataFrame, error: str) -> list[dict[str, Any]]:
    """The methods that are the fastest, or next of another label, at some error, or on an averaged form's front.

    No answer needs another method: it names the fastest, the next one of another label, and averaged forms.
    Each has its runs under "points".
    """
    # The frame of each method's runs, and of those with a result its front: error and seconds.
    runs_of = dict(methods(runs))
    fronts = {}
    for method, method_runs in runs_of.items():
        points = front(method_runs, error)
        if len(points):
            fronts[method] = points
    chosen: set[Method] = set()
    for target in _ERRORS:
        seconds = {method: cost(points, target) for method, points in fronts.items()}
        ranked = sorted((time, method) for method, time in seconds.items() if not isnan(time))
        chosen.update(method for _, method in ranked[:1])
        rivals = [method for _, method in ranked if method.label != ranked[0][1].label]
        chosen.update(rivals[:1])
    averaged = where(runs, runs["form"].map(is_averaged).astype(bool))
    for _, form_runs in averaged.groupby("form"):
        chosen.update(method for method, _ in methods(pareto_front(form_runs, error)))
    return [
        {
            "form": method.form,
            "solver": method.solver,
            "label": method.label,
            "averaged": is_averaged(method.form),
            "points": _points(runs_of[method], error),
        }
        for method in fronts
        if method in chosen
    ]


def _points(runs: pd.DataFrame, error: str) -> list[list[float]]:
    """Error, seconds, tolerance and relative spread of a method's runs that no other of its runs beats."""
    best = pareto_front(runs.dropna(subset=[error, "seconds"]), error)
    spreads = (best["seconds_spread"].astype(float) / best["seconds"].astype(float)).fillna(0.0)
    rows = best.assign(spread=spreads)[[error, "seconds", "tolerance", "spread"]].to_numpy(float)
    return [
        [_rounded_up(size), seconds, tolerance, round(spread, _SPREAD_DECIMALS)]
        for size, seconds, tolerance, spread in rows.tolist()
    ]


def _rounded_up(value: float) -> float:
    """The least number of `DATA_DIGITS` digits, as pages hold them, that is no smaller.

    Rounded down, an error would seem to be met by a run that just misses it.
    """
    decimals = DATA_DIGITS - 1
    near = float(f"{value:.{decimals}e}")
    if near >= value or value <= 0:
        return near
    last_digit = 10.0 ** (floor(log10(value)) - decimals)
    return float(f"{near + last_digit:.{decimals}e}")


def _map(particle: str, error: str, panel: Sequence[Cell]) -> dict[str, Any]:
    """Content of a map: its cells in rows by error, and in `key` the methods that win, by kind."""
    ordered = sorted(panel, key=lambda cell: (-cell.target, cell.stokes))
    rows = [[*row] for _, row in groupby(ordered, key=lambda cell: cell.target)]
    key = by_side(cell.winner for cell in panel if cell.winner)
    about = {"name": particle, "want": _WANTS[error][0], "title": MAP_ERRORS[error][1]}
    return about | {"key": key, "rows": rows, "usual": usual_form(panel)}


def cost_page(reports: Path) -> Page:
    """The page on which every run of every study in the folder `reports` is a point."""
    studies, unreadable = read_studies(
        reports, (*_WORDS, *RUN_NUMBERS, "backend", "jacobian", "inferred", "tags")
    )
    body = html("cost", studies=studies, unreadable=unreadable)
    if not studies:
        return Page(_COSTS, _LEAD, body)
    groups, rows = _groups_and_rows(studies)
    values = dict(zip(_COST_COLUMNS, zip(*rows, strict=True), strict=True))
    # Words and tolerances stand once: columns hold their places.
    named = (*_WORDS, "tolerance")
    words: dict[Any, int] = {}
    for value in chain.from_iterable(values[name] for name in named):
        words.setdefault(value, len(words))
    columns = {}
    for name, column in values.items():
        places = [words[value] for value in column] if name in named else column
        columns[name] = _counted(places)
    forms = {}
    for name, look in looks(map(str, values["form"])).items():
        averaged = is_averaged(name)
        color = look.both if averaged else _FULL_FORM
        forms[name] = {"averaged": averaged, "color": color, "mark": look.outline}
    data = {
        "words": list(words),
        "groups": groups,
        "columns": columns,
        "forms": forms,
        "solvers": _solvers(set(map(str, values["solver"]))),
        "largest": LARGEST_ERROR,
        "meanings": {str(status): status.meaning for status in Status},
    }
    return Page(_COSTS, _LEAD, body, {"cost-data": data}, ("chart.js", "cost.js"))


def _groups_and_rows(studies: Mapping[str, pd.DataFrame]) -> tuple[list[Any], list[list[Any]]]:
    """Groups: study, scene, St, tags; and all runs as rows of `_COST_COLUMNS`, each with the place of its group.

    Runs of one line of the diagram stand together, from the loosest tolerance to the tightest.
    """
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
    tolerance = _COST_COLUMNS.index("tolerance")
    # Group, form and solver are the first columns.
    rows.sort(key=lambda row: (*row[:3], -row[tolerance]))
    return groups, rows


def _row(run: dict[Any, Any]) -> list[Any]:
    """A run as a row of `_COST_COLUMNS` but for its group; the solver with back end and Jacobian, where chosen."""
    chosen = [str(run[name]) for name in ("backend", "jacobian") if run.get(name)]
    method = f"{run['solver']} ({', '.join(chosen)})" if chosen else run["solver"]
    values = [run["form"], method, run["status"], run.get("message") or "", float(run["tolerance"])]
    return [*values, int(bool(run.get("inferred"))), *(run.get(name) for name in RUN_NUMBERS)]


def _counted(values: Iterable[Any]) -> list[Any]:
    """The values; one that stands several times in a row becomes [value, times]."""
    counted = ((value, len([*same])) for value, same in groupby(values))
    return [value if times == 1 else [value, times] for value, times in counted]


def _solvers(names: set[str]) -> dict[str, Any]:
    """Look and tags of the solvers, in the order of the catalogue.

    A name is one of `_row`: a solver, or a solver with its back end and Jacobian in brackets.
    """
    solvers = {}
    for solver, look in looks(name.partition(" ")[0] for name in names).items():
        method = find_solver(solver) if solver in SOLVERS else None
        for name in sorted(name for name in names if name.partition(" ")[0] == solver):
            # Without a back end in its name a run is by the default one: compiled, where there is that.
            compiled = (
                method
                and "compiled" in method.backends
                and "(numba" not in name
                and "(python" not in name
            )
            tags = ["implicit" if method and method.implicit else "explicit"]
            tags.append("compiled" if compiled else "Python in the loop")
            solvers[name] = {"color": look.both, "mark": look.outline, "tags": tags}
    return solvers


def read_studies(
    folder: Path, columns: Collection[str]
) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Runs of each study in the folder of reports, and the files that cannot be read, with the reasons.

    A study has the name of its folder. The name of a file other than `records` or `runs` follows after "/".
    Frames of exported records have `columns` alone, and the columns that every frame needs.
    """
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
    paths: dict[str, Path] = {}
    for study_folder in folders:
        files = record_files(study_folder)
        table = study_folder / "runs.csv"
        if not files and table.is_file():
            files = {"runs": table}
        for name, path in files.items():
            alone = name in ("records", "runs")
            paths[study_folder.name if alone else f"{study_folder.name}/{name}"] = path
    for name, path in paths.items():
        try:
            if path.suffix == ".csv":
                runs = read_csv(BytesIO(read_file(path)), dtype_backend="numpy_nullable")
            else:
                runs = frame(read_export(path), {*NEEDED, *columns})
            studies[name] = of_runs(runs, path)
        except (ValueError, OSError) as error:
            unreadable.append(f"{path}: {str(error).removeprefix(f'{path}: ')}")
    return studies, unreadable

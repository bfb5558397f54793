"""Cost against error, run by run, with filters, from the records of all studies in a folder of reports."""

from collections.abc import Collection, Iterable
from itertools import groupby
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import by_stokes, frame, rows_of, where
from polhode.harness.common.files import open_file
from polhode.harness.common.store import Store, read_export
from polhode.harness.pages.figures.style import is_averaged, looks
from polhode.harness.pages.figures.work_precision import LARGEST_ERROR
from polhode.harness.site.markup import Page, html
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Status

TITLE = "Cost against accuracy"
LEAD = "Every run measured: wall time, or calls of the right-hand side, against the error along the whole run."
WORDS = ("form", "solver", "status", "message")
COLUMNS = ("slow_error", "orientation_error", "seconds", "work.rhs_calls", "work.steps", "model_slow_error")
# What else a record says of a run.
MARKS = ("stokes", "backend", "jacobian", "inferred", "tags")
NEEDED = ("scene_name", "form", "solver", "tolerance", "status")
# Folders of `reports` that hold something else than a study.
NO_STUDY = ("site", "paper", "accuracy", "pick", "problems")


def cost_page(reports: Path) -> Page:
    """Every run of every study as a point."""
    studies, unreadable = read_studies(reports, (*WORDS, *COLUMNS, *MARKS))
    body = html("cost", studies=studies, unreadable=unreadable)
    if not studies:
        return Page(TITLE, LEAD, body)
    groups, rows = [], []
    for study, table in studies.items():
        for scene in dict.fromkeys(table["scene_name"]):
            own = where(table, table["scene_name"] == scene)
            for stokes, runs in by_stokes(own):
                rows += [[len(groups), *_row(run)] for run in rows_of(runs)]
                groups.append([study, scene, stokes, _scene_tags(runs)])
    # A line stands together and goes from the loosest tolerance to the tightest.
    rows.sort(key=lambda row: (*row[:3], -row[5]))
    forms = looks(str(row[1]) for row in rows)
    solvers = _solvers({str(row[2]) for row in rows})
    # Words stand once: columns hold their places.
    words = {
        word: i for i, word in enumerate(dict.fromkeys(word for row in rows for word in row if isinstance(word, str)))
    }
    names = ("group", *WORDS, "tolerance", "inferred", *COLUMNS)
    data = {
        "words": list(words),
        "groups": groups,
        "columns": {
            name: _runs(words[value] if isinstance(value, str) else value for value in values)
            for name, values in zip(names, zip(*rows, strict=True), strict=True)
        },
        "forms": {
            name: {
                "averaged": is_averaged(name),
                "color": look.colour if is_averaged(name) else "#555",
                "mark": look.outline,
            }
            for name, look in forms.items()
        },
        "solvers": solvers,
        "largest": LARGEST_ERROR,
        "meanings": {str(status): status.meaning for status in Status},
    }
    return Page(TITLE, LEAD, body, {"cost-data": data}, ("tables.js", "chart.js", "cost.js"))


def _row(run: dict[Any, Any]) -> list[Any]:
    """A run as the page's script reads it, its solver with the back end and the Jacobian where they were chosen."""
    chosen = [str(run[name]) for name in ("backend", "jacobian") if run.get(name)]
    method = f"{run['solver']} ({', '.join(chosen)})" if chosen else run["solver"]
    values = [run["form"], method, run["status"], run.get("message") or "", float(run["tolerance"])]
    return [*values, int(bool(run.get("inferred"))), *(run.get(name) for name in COLUMNS)]


def _runs(values: Iterable[Any]) -> list[Any]:
    """The values, those that stand several times in a row as [value, times]."""
    counted = ((value, sum(1 for _ in same)) for value, same in groupby(values))
    return [value if times == 1 else [value, times] for value, times in counted]


def _scene_tags(runs: pd.DataFrame) -> list[str]:
    """Tags that the study gives the scene."""
    lists = runs["tags"].to_list() if "tags" in runs else []
    return sorted({str(tag) for own in lists if isinstance(own, list) for tag in own})


def _solvers(names: set[str]) -> dict[str, Any]:
    """Look and tags of the solvers, in the order of the catalogue."""
    found = {}
    for solver, look in looks(name.partition(" ")[0] for name in names).items():
        for name in sorted(name for name in names if name.partition(" ")[0] == solver):
            method = find_solver(solver) if solver in SOLVERS else None
            compiled = method and "compiled" in method.backends and "(numba" not in name and "(python" not in name
            tags = ["implicit" if method and method.implicit else "explicit"]
            tags.append("compiled" if compiled else "Python in the loop")
            found[name] = {"color": look.colour, "mark": look.outline, "tags": tags}
    return found


def read_studies(folder: Path, columns: Collection[str]) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Runs of each study by the name of its folder, and file if it holds several; and the files that cannot be read."""
    studies, unreadable = {}, []
    for path in _files(folder):
        name = path.parent.name if path.stem in ("records", "store", "runs") else f"{path.parent.name}/{path.stem}"
        try:
            table = _table(path, {*NEEDED, *columns})
            lacking = [column for column in NEEDED if column not in table]
            if len(table) and lacking:
                raise ValueError(f"a record without {lacking[0]!r}, expected those of `polhode bench`")
        except (ValueError, OSError) as error:
            unreadable.append(f"{path}: {error}")
            continue
        if len(table):
            studies[name] = table
    return studies, unreadable


def _files(folder: Path) -> list[Path]:
    """One file per study: exported records; where there are none, the table of runs; where there is none, the store."""
    found = []
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if not path.is_dir() or path.name in NO_STUDY:
            continue
        exported = sorted(path.glob("*.jsonl"))
        single = [file for file in (path / "runs.csv", path / "store.sqlite") if file.is_file()]
        found += exported or single[:1]
    return found


def _table(path: Path, columns: Collection[str]) -> pd.DataFrame:
    if path.suffix == ".csv":
        with open_file(path) as file:
            return pd.read_csv(file, dtype_backend="numpy_nullable")
    if path.suffix == ".jsonl":
        return frame(read_export(path), columns)
    with Store(path) as store:
        return frame(store, columns)

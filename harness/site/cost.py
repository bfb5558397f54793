"""Cost against error, run by run, with filters."""

from typing import Any

import pandas as pd

from polhode.harness.pages.regimes import COLORS
from polhode.harness.pages.work_precision import EXPLICIT, IMPLICIT, LARGEST_ERROR, MARKERS
from polhode.harness.site.markup import Page, missing
from polhode.harness.site.origins import commands, origins
from polhode.harness.site.sources import Sources
from polhode.models.catalogue import FORMS
from polhode.models.catalogue import form as find_form
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status

COLUMNS = ("slow_error", "orientation_error", "seconds", "work.rhs_calls", "work.steps", "prepare_seconds")
COLUMNS += ("model_slow_error", "slow_error_so_far")
CAPTION = (
    "Lower is cheaper, right is more accurate. A line joins the runs of one form and solver at different tolerances; "
    "stars are averaged forms, by any solver, and the dotted lines the error that those forms make by themselves. Runs "
    "that gave no result stand side by side in the strip above, at the tolerance they were asked for, those left out "
    "as hopeless not among them; hollow points lie beyond the axis. Point at a run, or take the arrow keys, to see it "
    "in numbers."
)


def cost_page(sources: Sources) -> Page:
    """Every run of every study as a point."""
    if not sources.studies:
        body = missing("Measured runs are", "polhode bench")
        return Page("cost", "Cost against accuracy", "Every run measured, as a point.", body)
    body = (
        '<form class="filters" id="filters" aria-label="Filters"></form>'
        f'<figure class="chart" id="cost-chart"><figcaption>{CAPTION}</figcaption></figure>'
        '<h2>Runs without a result</h2><div id="failures"></div>'
    )
    groups, rows = [], []
    for study in sources.studies.values():
        for scene, stokes, runs in study.groups():
            rows += [[len(groups), *_row(run)] for run in runs.to_dict("records")]
            groups.append([study.name, scene, stokes, _scene_tags(runs)])
    names = {"forms": sorted({str(row[1]) for row in rows}), "solvers": sorted({str(row[2]) for row in rows})}
    data = {
        "groups": groups,
        "columns": ["group", "form", "solver", "tolerance", "status", "message", "inferred", *COLUMNS],
        "rows": rows,
        "forms": {name: _form(name) for name in names["forms"]},
        "solvers": _solvers(names["solvers"]),
        "largest": LARGEST_ERROR,
        "meanings": {str(status): status.meaning for status in Status},
    }
    return Page(
        "cost",
        "Cost against accuracy",
        "Every run measured: wall time, or calls of the right-hand side, against the error along the whole run.",
        body,
        commands(sources.folder, sources.studies.values()),
        origins(sources.folder, sources.studies.values()),
        {"cost-data": data},
        ("tables.js", "chart.js", "cost.js"),
    )


def _row(run: dict[Any, Any]) -> list[Any]:
    values = [run["form"], _method(run), float(run["tolerance"]), run["status"], _known(run.get("message")) or ""]
    return [*values, int(bool(_known(run.get("inferred")))), *(_number(run.get(name)) for name in COLUMNS)]


def _method(run: dict[Any, Any]) -> str:
    """The solver, with the back end and the Jacobian where they were chosen."""
    chosen = [str(run[name]) for name in ("backend", "jacobian") if _known(run.get(name))]
    return f"{run['solver']} ({', '.join(chosen)})" if chosen else str(run["solver"])


def _known(value: Any) -> Any:
    return None if value is None or value is pd.NA or value != value else value


def _number(value: Any) -> float | int | None:
    known = _known(value)
    return known if known is None or isinstance(known, int) else float(known)


def _scene_tags(runs: pd.DataFrame) -> list[str]:
    """Tags that the study gives the scene."""
    lists = runs["tags"].to_list() if "tags" in runs else []
    return sorted({str(tag) for own in lists if isinstance(own, list) for tag in own})


def _form(name: str) -> dict[str, Any]:
    averaged = name in FORMS and find_form(name).averaged
    return {"averaged": averaged, "color": COLORS.get(name, COLORS["averaged"]) if averaged else "#555"}


def _solvers(names: list[str]) -> dict[str, Any]:
    """Colour, marker and tags of the solvers, in the order of the catalogue."""
    counts: dict[str, int] = {}
    found = {}
    for name in sorted(names, key=_place):
        solver = name.partition(" ")[0]
        library = find_solver(solver).family
        found[name] = {
            "library": library,
            "color": colour_of(solver),
            "mark": MARKERS[counts.get(library, 0) % len(MARKERS)],
            "tags": _tags(solver, name),
        }
        counts[library] = counts.get(library, 0) + 1
    return found


def _place(name: str) -> tuple[int, str]:
    solver, known = name.partition(" ")[0], list(SOLVERS)
    return (known.index(solver) if solver in known else len(known)), name


def _tags(solver: str, name: str) -> list[str]:
    method = find_solver(solver) if solver in SOLVERS else None
    implicit = method is not None and method.implicit
    compiled = "(numba" not in name and "(python" not in name and method is not None and "compiled" in method.backends
    return ["implicit" if implicit else "explicit", "compiled" if compiled else "Python in the loop"]


def colour_of(solver: str) -> str:
    """Colour of a solver's library, lighter for implicit methods."""
    implicit = solver in SOLVERS and find_solver(solver).implicit
    return (IMPLICIT if implicit else EXPLICIT)[find_solver(solver).family]

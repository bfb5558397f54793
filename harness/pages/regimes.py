"""The page of the regime map, beside its pictures and data, from the records alone.

The map says which method, a form by a solver, is the cheapest at each St and error. A cell is one St
and error, a panel all cells of one scene and one kind of error (`polhode.harness.analysis.regime_map`).
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from io import BytesIO
from math import isnan
from pathlib import Path
from statistics import median
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import frame, read_csv, where, write_runs
from polhode.harness.analysis.in_full import HYBRID, ran_in_full
from polhode.harness.analysis.pareto import TIE, Method
from polhode.harness.analysis.regime_map import Cell, Standing, cells, standings
from polhode.harness.common.files import read_file, write_file
from polhode.harness.common.machine import made_lines, provenance
from polhode.harness.common.store import Record
from polhode.harness.common.text import duration, factor, markdown, short
from polhode.harness.pages.figures.map_picture import HEADINGS, MAP_ERRORS, picture
from polhode.harness.pages.figures.style import measured, save
from polhode.harness.pages.figures.work_precision import conditions, profile_lines
from polhode.harness.pages.tables import fill
from polhode.harness.studies.study import Study

# Runs of at least this many inverse shear rates get a performance profile of their own, beside the one
# of all runs (`figures.work_precision`). A choice: in this study, with t = 0.5 St, they are those from
# St = 1e5 on.
_LONG = 5e4
Maps = Mapping[tuple[str, str], Sequence[Cell]]
"""Cells by the scene's name and the column of the error, "slow_error" or "orientation_error"."""
# Columns of `cells.csv`, made of the fields of `Cell`. "error" is the kind of error, "target" its requested
# size, "known" whether the reference resolves it; "form" and "solver" are the winner's, "seconds" its time;
# "lead" is the time of the second over that, "next" the second as "form, solver". "spread" is by how much
# repeats vary, over their time, and "tie" whether the lead is no more than a tie (`Cell.tied`).
_CELL_COLUMNS = [
    "scene",
    "error",
    "St",
    "target",
    "known",
    "form",
    "solver",
    "seconds",
    "lead",
    "spread",
    "tie",
    "next",
]


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its pictures and its data into a folder and return the page's path."""
    runs = frame(records)
    write_runs(runs, folder)
    return _write(study, runs, folder, provenance(command, records))


def rewrite_page(study: Study, folder: Path) -> Path:
    """Write the page and its pictures anew from the runs in a folder; the page's path.

    The new page keeps the machine and the versions that the old page names.

    Raises
    ------
    ValueError
        The folder has no page, the page does not say how it was made, or a checksum fails.
    OSError
        The folder has no runs.
    """
    page = folder / "README.md"
    if not page.is_file():
        raise ValueError(f"{page}: no such file, expected a page of `polhode regimes`")
    runs = read_csv(BytesIO(read_file(folder / "runs.csv")))
    return _write(study, runs, folder, made_lines(page))


def _write(study: Study, runs: pd.DataFrame, folder: Path, made: Sequence[str]) -> Path:
    """Write the page, its pictures and its cells; `made` says how the runs were made."""
    # Runs of `hybrid` that average nothing are runs of the full form: the page counts them, of those that
    # did not fail, and the maps leave them out.
    hybrid = where(runs, (runs["form"] == HYBRID) & runs["slow_error"].notna())
    in_full = ran_in_full(runs, study.scenes)
    hybrid_in_full = int(in_full[hybrid.index].sum())
    runs = where(runs, ~in_full)
    # Several scenes of the study, which differ by St, share a name.
    by_name = {name: where(runs, runs["scene_name"] == name) for name in dict(study.scenes)}
    maps: Maps = {}
    for name, scene_runs in by_name.items():
        for error in MAP_ERRORS:
            maps[name, error] = cells(scene_runs, error)
    write_file(folder / "cells.csv", _cells_table(maps).to_csv(index=False), summed=True)
    machine = measured(made)
    particles = []
    for name, scene_runs in by_name.items():
        scenes = [scene for scene_name, scene in study.scenes if scene_name == name]
        durations = {scene.stokes: scene.time for scene in scenes}
        note = conditions(scene_runs, machine)
        for error, (_, title) in MAP_ERRORS.items():
            drawing = picture(maps[name, error], durations, f"{name.capitalize()}. {title}", note)
            save(drawing, folder, name if error == "slow_error" else f"{name}-orientation")
        particles.append(
            {
                "name": name,
                "axes": scenes[0].ellipsoid.semi_axes,
                "methods": _method_rows(scene_runs, name, maps),
                "times": [
                    (words, _times(maps[name, error])) for error, (words, _) in MAP_ERRORS.items()
                ],
            }
        )
    long_stokes = [scene.stokes for _, scene in study.scenes if scene.time >= _LONG]
    long_runs = where(runs, runs["stokes"].isin(long_stokes))
    long_title = f"The same over t ≥ {short(_LONG)} alone"
    long_note = conditions(long_runs, machine)
    long_lines = profile_lines(long_runs, folder, "profiles-long", long_title, long_note)
    page = fill(
        "regimes",
        title=study.title,
        made=made,
        in_full=hybrid_in_full,
        hybrid=len(hybrid),
        sentences=[
            f"The {name}, {sentence(panel, MAP_ERRORS[error][0])}"
            for (name, error), panel in maps.items()
        ],
        particles=particles,
        profiles=[
            *profile_lines(runs, folder, note=conditions(runs, machine)),
            *long_lines,
        ],
        study=study,
        # In percent of the fastest time.
        tie=100 * (TIE - 1),
    )
    return write_file(folder / "README.md", page)


def _cells_table(maps: Maps) -> pd.DataFrame:
    """All cells as rows with the columns `_CELL_COLUMNS`."""
    rows = []
    for (name, error), panel in maps.items():
        for cell in panel:
            form, solver = cell.winner or ("", "")
            rows.append(
                {
                    "scene": name,
                    "error": error,
                    "St": cell.stokes,
                    "target": cell.target,
                    "known": cell.resolved,
                    "form": form,
                    "solver": solver,
                    "seconds": cell.seconds,
                    "lead": cell.lead,
                    "spread": cell.spread,
                    "tie": cell.tied,
                    "next": str(cell.second or ""),
                }
            )
    return pd.DataFrame(rows, columns=_CELL_COLUMNS)


def _method_rows(runs: pd.DataFrame, name: str, maps: Maps) -> list[dict[str, Any]]:
    """How every method stands on both maps of a scene.

    `full` and `slow` are its `Standing` on the map of the orientation and of L and E; `failed` are its runs
    without a result, by status, in words; `seen` is whether it wins or ties somewhere, or lies on a front.
    """
    by_error = {}
    for error in MAP_ERRORS:
        rows = standings(runs, error, maps[name, error])
        by_error[error] = {row.method: row for row in rows}
    methods = []
    # The page calls the map of L and E "slow", the one of the orientation "full".
    for method, slow in by_error["slow_error"].items():
        full = by_error["orientation_error"][method]
        failures = slow.failures.items()
        methods.append(
            {
                "method": method,
                "full": full,
                "slow": slow,
                "failed": [f"{status.replace('_', ' ')} {count}" for status, count in failures],
                "seen": _leads_somewhere(full) or _leads_somewhere(slow),
            }
        )
    return methods


def _times(panel: Sequence[Cell]) -> str:
    """Times of the winners and their leads, by error and St, as Markdown."""
    numbers = list(dict.fromkeys(cell.stokes for cell in panel))
    rows = []
    for target in dict.fromkeys(cell.target for cell in panel):
        row = [cell for cell in panel if cell.target == target]
        rows.append([short(target), *map(_time, row)])
    return markdown(
        ["error", *(f"St = {short(stokes)}" for stokes in numbers)],
        rows,
        right=range(1, len(numbers) + 1),
    )


def _time(cell: Cell) -> str:
    """Time and lead of a cell; "–" if no run gets there, "?" if the reference does not resolve the error."""
    if cell.winner is None:
        return "–" if cell.resolved else "?"
    if isnan(cell.lead):
        return duration(cell.seconds)
    return f"{duration(cell.seconds)}, {'tie' if cell.tied else factor(cell.lead)}"


def read_cells(path: Path) -> Maps:
    """Cells of a file `cells.csv`, as `write_page` wrote it.

    Raises OSError if there is none, and ValueError if its checksum fails.
    """
    maps: dict[tuple[str, str], list[Cell]] = {}
    table = read_csv(
        BytesIO(read_file(path)), keep_default_na=False, na_values={"seconds": "", "lead": ""}
    )
    for row in table.to_dict("records"):
        winner = Method(row["form"], row["solver"]) if row["form"] else None
        second = Method(*row["next"].split(", ")) if row["next"] else None
        cell = Cell(
            stokes=row["St"],
            target=row["target"],
            resolved=row["known"],
            winner=winner,
            second=second,
            seconds=row["seconds"],
            lead=row["lead"],
            spread=row.get("spread", 0.0),  # Files of earlier versions have no such column.
        )
        maps.setdefault((row["scene"], row["error"]), []).append(cell)
    return maps


def _leads_somewhere(standing: Standing) -> bool:
    """Whether a method wins or ties in a cell of a map, or lies on a front."""
    return standing.won + standing.tied + standing.front > 0


def sentence(panel: Sequence[Cell], quantity: str) -> str:
    """A map of a quantity in words: which kind of method wins where, by how much, and in which form.

    The lead of a kind is the median over the cells that it wins; cells without a second have none.
    Averaged forms are left out of the count by form: that they win is said of their kind.
    """
    won: dict[str, list[Cell]] = {side: [] for side in HEADINGS}
    for cell in panel:
        if cell.winner:
            won[cell.winner.side].append(cell)
    forms = Counter(
        cell.winner.form for cell in panel if cell.winner and cell.winner.side != "averaged"
    )
    median_leads = {}
    for side, side_cells in won.items():
        leads = [cell.lead for cell in side_cells if not isnan(cell.lead)]
        if leads:
            median_leads[side] = median(leads)
    return fill(
        "regimes-sentence", what=quantity, won=won, leads=median_leads, forms=forms.most_common()
    )

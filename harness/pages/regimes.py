"""The page of the regime map, beside its pictures and data, from the records alone."""

from collections import Counter
from collections.abc import Mapping, Sequence
from io import BytesIO
from math import isnan
from pathlib import Path
from statistics import median

import pandas as pd

from polhode.harness.analysis.frames import frame, where, write_runs
from polhode.harness.analysis.in_full import HYBRID, ran_in_full
from polhode.harness.analysis.pareto import TIE, Cell, Method, cells, standings
from polhode.harness.common.files import read_file, write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record
from polhode.harness.common.text import short
from polhode.harness.pages.figures.map_picture import ERRORS, HEADINGS, picture
from polhode.harness.pages.figures.work_precision import profile_lines, save
from polhode.harness.pages.tables import fill
from polhode.harness.studies.study import Study

# From this duration on, in shear times, runs have a profile of their own.
_LONG = 5e4
Maps = Mapping[tuple[str, str], Sequence[Cell]]
"""Cells by the scene's name and the error."""
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
    "tie",
    "next",
]


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its pictures and its data into a folder and return the page's path."""
    runs = frame(records)
    write_runs(runs, folder)
    return _write(study, runs, folder, header(study.title, command, records))


def rewrite_page(study: Study, folder: Path) -> Path:
    """Write the page and its pictures anew from the runs in a folder; the first lines of its page stay.

    Raises ValueError if there is no page, or there are no runs.
    """
    page = folder / "README.md"
    if not page.is_file():
        raise ValueError(f"{page}: no such file, expected a page of `polhode regimes`")
    lines = page.read_text(encoding="utf-8").split("\n")
    first = next(number for number, line in enumerate(lines) if line.startswith("Measured "))
    runs = pd.read_csv(BytesIO(read_file(folder / "runs.csv")))
    return _write(study, runs, folder, [*lines[: first + 1], ""])


def _write(study: Study, runs: pd.DataFrame, folder: Path, first_lines: Sequence[str]) -> Path:
    hybrid = where(runs, (runs["form"] == HYBRID) & runs["slow_error"].notna())
    in_full = ran_in_full(runs, study.scenes)
    counted = int(in_full[hybrid.index].sum())
    runs = where(runs, ~in_full)
    named = {name: where(runs, runs["scene_name"] == name) for name in dict(study.scenes)}
    maps: Maps = {
        (name, error): cells(own, error) for name, own in named.items() for error in ERRORS
    }
    rows = []
    for (name, error), found in maps.items():
        for cell in found:
            numbers = (
                *(cell.winner or ("", "")),
                cell.seconds,
                cell.lead,
                cell.tied,
                str(cell.second or ""),
            )
            rows.append((name, error, cell.stokes, cell.target, cell.known, *numbers))
    write_file(
        folder / "cells.csv",
        pd.DataFrame(rows, columns=_CELL_COLUMNS).to_csv(index=False),
        summed=True,
    )
    particles = []
    for name, own in named.items():
        scenes = [scene for each, scene in study.scenes if each == name]
        times = {scene.stokes: scene.time for scene in scenes}
        save(picture([maps[name, error] for error in ERRORS], times), folder, name)
        # How every method stands on both maps, and whether it wins or ties somewhere, or lies on a
        # front.
        full, slow = (
            {row.method: row for row in standings(own, error, maps[name, error])}
            for error in ERRORS
        )
        methods = [
            {"method": method, "full": full[method], "slow": row}
            | {
                "failed": [
                    f"{status.replace('_', ' ')} {number}"
                    for status, number in row.failures.items()
                ]
            }
            | {"seen": any(each.won + each.tied + each.front for each in (full[method], row))}
            for method, row in slow.items()
        ]
        particles.append({"name": name, "axes": scenes[0].ellipsoid.semi_axes, "methods": methods})
    far = [scene.stokes for _, scene in study.scenes if scene.time >= _LONG]
    apart = where(runs, runs["stokes"].isin(far))
    title = f"The same over t ≥ {short(_LONG)} alone"
    long = profile_lines(apart, folder, "profiles-long", title)
    page = fill(
        "regimes",
        header=first_lines,
        in_full=counted,
        hybrid=len(hybrid),
        sentences=[
            f"The {name}, {sentence(found, ERRORS[error][0])}"
            for (name, error), found in maps.items()
        ],
        particles=particles,
        profiles=[*profile_lines(runs, folder), *long],
        study=study,
        tie=100 * (TIE - 1),
    )
    return write_file(folder / "README.md", page)


def read_cells(path: Path) -> Maps:
    """Cells as `write_page` wrote them."""
    maps: dict[tuple[str, str], list[Cell]] = {}
    table = pd.read_csv(
        BytesIO(read_file(path)), keep_default_na=False, na_values={"seconds": "", "lead": ""}
    )
    for row in table.to_dict("records"):
        winner = Method(row["form"], row["solver"]) if row["form"] else None
        second = Method(*row["next"].split(", ")) if row["next"] else None
        cell = Cell(
            row["St"], row["target"], row["known"], winner, second, row["seconds"], row["lead"]
        )
        maps.setdefault((row["scene"], row["error"]), []).append(cell)
    return maps


def sentence(found: Sequence[Cell], what: str) -> str:
    """What a map shows: which kind of method wins where, by how much, and in which form."""
    won = {
        side: [cell for cell in found if cell.winner and cell.winner.side == side]
        for side in HEADINGS
    }
    forms = Counter(
        cell.winner.form for cell in found if cell.winner and cell.winner.side != "averaged"
    )
    leads = {side: [cell.lead for cell in own if not isnan(cell.lead)] for side, own in won.items()}
    halves = {side: median(own) for side, own in leads.items() if own}
    return fill("regimes-sentence", what=what, won=won, leads=halves, forms=forms.most_common())

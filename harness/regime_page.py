"""The regime map as a picture and a page, from the records alone."""

import csv
from collections.abc import Sequence
from math import inf, isnan, log10, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from polhode.harness.figures import save
from polhode.harness.provenance import header
from polhode.harness.regimes import Cell, Method, Side, cells, sentences, standings
from polhode.harness.store import Record
from polhode.harness.study import Study
from polhode.harness.tables import frame, where
from polhode.harness.text import duration, markdown
from polhode.harness.verdict import TIE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's hues: orange for implicit methods, blue and green for explicit ones, purple for averaged forms;
# within a hue the lightness tells the methods apart, so that the map holds in grey and for colour-blind readers.
COLORS = {
    "cyrk-radau": "#E69F00",
    "cyrk-lsoda": "#D55E00",
    "cyrk-bdf": "#F6CF7F",
    "cvode-bdf": "#B5762A",
    "ida": "#8C3B00",
    "cyrk-tsit5": "#CDE8F7",
    "cyrk-dop853": "#8CC7EA",
    "cyrk-vern7": "#3E97CE",
    "cyrk-vern8": "#005C91",
    "taylor": "#F0E442",
    "cvode-adams": "#009E73",
    "averaged": "#CC79A7",
    "averaged-spheroid": "#CC79A7",
    "averaged-second-order": "#8E4585",
}
OTHER = "#999999"
# Colours darker than this carry white numbers.
DARK = 0.4
NOBODY, UNKNOWN = "#FFFFFF", "#E4E4E4"
HEADINGS: dict[Side, tuple[str, str]] = {
    "implicit": ("Stiff side", "implicit methods"),
    "explicit": ("Oscillatory middle", "explicit methods"),
    "averaged": ("Averaged side", "slow equations, any solver"),
}
# In inches, and in rows of the map.
LEGEND_WIDTH, LINE = 2.5, 0.3
ERRORS = {
    "orientation_error": "full solution: orientation error, rad",
    "slow_error": "slow variables: error over $I_{max}$",
}
RUN_COLUMNS = ["scene_name", "stokes", "form", "solver", "tolerance", "status", "slow_error", "orientation_error"]
RUN_COLUMNS += ["model_slow_error", "slow_uncertainty", "orientation_uncertainty", "seconds", "seconds_spread"]
RUN_COLUMNS += ["work.rhs_calls", "work.steps", "sentinel_seconds", "date"]


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its pictures and its data into a folder and return the page's path."""
    table = frame(records)
    folder.mkdir(parents=True, exist_ok=True)
    names = list(dict.fromkeys(name for name, _ in study.scenes))
    maps = {
        (name, error): cells(where(table, table["scene_name"] == name), error) for name in names for error in ERRORS
    }
    for name in names:
        save(picture([maps[name, error] for error in ERRORS]), folder, name)
    table[[column for column in RUN_COLUMNS if column in table]].to_csv(folder / "runs.csv", index=False)
    _write_cells(maps, folder / "cells.csv")
    page = folder / "README.md"
    page.write_text("\n".join(_lines(study, table, records, maps, command)), encoding="utf-8")
    return page


def picture(panels: Sequence[Sequence[Cell]]) -> Any:
    """Two maps above each other, full solution and slow variables, with one legend."""
    import matplotlib.pyplot as plt

    columns = len({cell.stokes for cell in panels[0]})
    width = LEGEND_WIDTH + 0.8 + 0.86 * columns
    drawing, grid = plt.subplots(2, 1, figsize=(width, 10.4), sharex=True)
    for axes, found, title in zip(grid, panels, ERRORS.values(), strict=True):
        draw(axes, found)
        axes.set_title(title[0].upper() + title[1:], fontsize=12, loc="left")
        axes.set_ylabel("error asked for")
    grid[-1].set_xlabel("Stokes number St")
    _legend(drawing, [cell for found in panels for cell in found])
    drawing.tight_layout(rect=(0, 0, 1 - LEGEND_WIDTH / width, 1))
    return drawing


def draw(axes: "Axes", found: Sequence[Cell]) -> "Axes":
    """Draw one map: colour tells the winner, a corner who ties with it, numbers its time and its lead."""
    from matplotlib.patches import Polygon, Rectangle

    numbers = sorted({cell.stokes for cell in found})
    targets = sorted({cell.target for cell in found}, reverse=True)
    at = {(cell.stokes, cell.target): cell for cell in found}
    usual = usual_form(found)
    for i, stokes in enumerate(numbers):
        for j, target in enumerate(targets):
            cell = at[stokes, target]
            color = color_of(cell.winner) if cell.winner else NOBODY if cell.known else UNKNOWN
            axes.add_patch(Rectangle((i, j), 1, 1, facecolor=color, edgecolor="white", linewidth=0.8))
            if cell.tied and cell.second:
                corner = [(i + 0.72, j), (i + 1, j), (i + 1, j + 0.9)]
                axes.add_patch(Polygon(corner, facecolor=color_of(cell.second), edgecolor="none"))
            _write_in(axes, cell, i, j, usual)
    _borders(axes, [[_side(at[stokes, target]) for target in targets] for stokes in numbers])
    axes.set_xlim(0, len(numbers))
    axes.set_ylim(len(targets), 0)
    axes.set_xticks([i + 0.5 for i in range(len(numbers))], [_power(stokes) for stokes in numbers])
    axes.set_yticks([j + 0.5 for j in range(len(targets))], [_power(target) for target in targets])
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    return axes


def color_of(method: Method) -> str:
    """Colour of a method; grey for those that have none of their own."""
    return COLORS.get(method.label, OTHER)


def usual_form(found: Sequence[Cell]) -> str:
    """The full form that wins most cells."""
    forms = [cell.winner.form for cell in found if cell.winner and cell.winner.side != "averaged"]
    return max(dict.fromkeys(forms), key=forms.count, default="")


def _write_in(axes: "Axes", cell: Cell, i: int, j: int, usual: str) -> None:
    """Time and lead of the winner, and its form where that is not the usual one."""
    if cell.winner is None:
        axes.text(i + 0.5, j + 0.5, "–" if cell.known else "?", ha="center", va="center", fontsize=8, color="0.55")
        return
    ink = "white" if _luminance(color_of(cell.winner)) < DARK else "black"
    lead = "tie" if cell.tied else "alone" if isnan(cell.lead) else f"×{_factor(cell.lead)}"
    lines = [(duration(cell.seconds), 7.5), (lead, 6.5)]
    if cell.winner.side != "averaged" and cell.winner.form != usual:
        lines.append((cell.winner.form, 6.0))
    for k, (line, size) in enumerate(lines):
        y = j + 0.52 + LINE * (k - (len(lines) - 1) / 2)
        axes.text(i + 0.46, y, line, ha="center", va="center", fontsize=size, color=ink)


def _borders(axes: "Axes", sides: list[list[Side | None]]) -> None:
    """Heavy lines where one kind of method hands over to another."""
    style = {"color": "black", "linewidth": 2.2, "solid_capstyle": "round", "zorder": 3}
    for i, column in enumerate(sides):
        for j, side in enumerate(column):
            if i + 1 < len(sides) and side != sides[i + 1][j]:
                axes.plot([i + 1, i + 1], [j, j + 1], **style)
            if j + 1 < len(column) and side != column[j + 1]:
                axes.plot([i, i + 1], [j + 1, j + 1], **style)


def _legend(drawing: Any, found: Sequence[Cell]) -> None:
    from matplotlib.patches import Patch

    shown: dict[Side, list[Method]] = {side: [] for side in HEADINGS}
    for cell in found:
        for method in (cell.winner, cell.second if cell.tied else None):
            if method and method.label not in [other.label for other in shown[method.side]]:
                shown[method.side].append(method)
    handles: list[Any] = []
    for side, (heading, what) in HEADINGS.items():
        if shown[side]:
            title = rf"$\bf{{{heading.replace(' ', '~')}}}$"
            handles.append(Patch(facecolor="none", label=f"{title}\n{what}"))
            own = sorted(shown[side], key=lambda method: [*COLORS, method.label].index(method.label))
            handles += [Patch(facecolor=color_of(method), label=method.label) for method in own]
            handles.append(Patch(facecolor="none", label=" "))
    handles.append(Patch(facecolor=NOBODY, edgecolor="0.7", label="nobody gets there\nin the time allowed"))
    handles.append(Patch(facecolor=UNKNOWN, label="below what the\nreference can tell"))
    note = (
        "\nNumbers: time of a warm run,\n× its lead over the next colour.\n"
        f"Corner: who ties, within {100 * (TIE - 1):.0f} %.\n"
        f"Full equations in the form\n{usual_form(found)}, unless\na cell names another."
    )
    handles.append(Patch(facecolor="none", label=note))
    left = 1 - LEGEND_WIDTH / drawing.get_size_inches()[0]
    style = {"frameon": False, "fontsize": 8.5, "handlelength": 1.4, "borderaxespad": 0}
    drawing.legend(handles=handles, loc="center left", bbox_to_anchor=(left, 0.5), **style)


def _lines(study: Study, table: pd.DataFrame, records: Sequence[Record], maps: dict, command: str) -> list[str]:
    drift = table["sentinel_seconds"].dropna().to_numpy(float)
    text = [
        *header(study.title, command, records),
        f"The sentinel, a fixed piece of arithmetic, took {duration(drift.min())} to {duration(drift.max())}.",
        "",
        f"Each cell shows the cheapest of {len(study.solvers)} solvers ({', '.join(study.solvers)}) in the forms "
        f"{', '.join(study.forms)}, the time of a warm run with {study.samples} samples, interpolated between "
        "tolerances, and by what factor it leads over the next method of another colour; a corner shows who ties with "
        f"it, within {100 * (TIE - 1):.0f} %. Errors are maxima along the run against certified references. Every run: "
        "[runs.csv](runs.csv); every cell: [cells.csv](cells.csv).",
        "",
    ]
    for name in dict.fromkeys(name for name, _ in maps):
        scenes = [scene for own, scene in study.scenes if own == name]
        axes = ", ".join(f"{length:g}" for length in scenes[0].ellipsoid.semi_axes)
        text += [f"## The {name} ({axes})", "", f"![Winners over St and error]({name}.png)", ""]
        for error, what in (("orientation_error", "orientation"), ("slow_error", "slow variables")):
            text += [f"- {sentence}" for sentence in (*sentences(maps[name, error], what), _forms(maps[name, error]))]
        rows = [[f"{scene.stokes:g}", f"{scene.time:g}"] for scene in scenes]
        text += ["", _methods(where(table, table["scene_name"] == name), name, maps)]
        text += ["Duration in units of the inverse shear rate:", "", markdown(["St", "time"], rows, right=(0, 1))]
    return text


def _methods(table: pd.DataFrame, name: str, maps: dict) -> str:
    """Every method that was run, those that never win too."""
    full, slow = (
        {row.method: row for row in standings(table, error, maps[name, error])}
        for error in ("orientation_error", "slow_error")
    )
    rows = [
        [
            *(row.method.form, row.method.solver),
            *(f"{full[method].won} / {row.won}", f"{full[method].tied} / {row.tied}"),
            f"{full[method].front} / {row.front} of {row.measured}",
            ", ".join(f"{status.replace('_', ' ')} {number}" for status, number in row.failures.items()),
        ]
        for method, row in slow.items()
    ]
    columns = [
        "form",
        "solver",
        "cells won",
        "ties with the winner",
        "on the Pareto front, St",
        "runs without a result",
    ]
    text = "Every method, full solution / slow variables; at the other St somebody is both faster and more accurate:"
    return f"{text}\n\n{markdown(columns, rows, right=(2, 3, 4))}"


def _forms(found: Sequence[Cell]) -> str:
    forms = [cell.winner.form for cell in found if cell.winner and cell.winner.side != "averaged"]
    counts = ", ".join(f"{form} {forms.count(form)}" for form in dict.fromkeys(forms))
    return f"Cells by form, where a full one wins: {counts}."


def _write_cells(maps: dict[tuple[str, str], list[Cell]], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["scene", "error", "St", "target", "known", "form", "solver", "seconds", "lead", "tie", "next"])
        for (name, error), found in maps.items():
            for cell in found:
                winner = (cell.winner.form, cell.winner.solver) if cell.winner else ("", "")
                numbers = ("" if isnan(cell.seconds) else cell.seconds, "" if isnan(cell.lead) else cell.lead)
                after = str(cell.second or "")
                writer.writerow(
                    [name, error, cell.stokes, cell.target, cell.known, *winner, *numbers, cell.tied, after]
                )


def _side(cell: Cell) -> Side | None:
    return cell.winner.side if cell.winner else None


def _factor(value: float) -> str:
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def _power(value: float) -> str:
    exponent = log10(value) if 0 < value < inf else nan
    return f"$10^{{{round(exponent)}}}$" if abs(exponent - np.round(exponent)) < 1e-9 else f"{value:g}"


def _luminance(color: str) -> float:
    red, green, blue = (int(color[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue

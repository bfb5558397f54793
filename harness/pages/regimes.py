"""The regime map as a picture, beside its page and its data, from the records alone."""

import csv
from collections.abc import Mapping, Sequence
from math import inf, isnan, log10, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from polhode.harness.analysis.frames import frame, where
from polhode.harness.analysis.regime_map import Cell, Method, Side, cells
from polhode.harness.analysis.winners import TIE
from polhode.harness.common.store import Record
from polhode.harness.common.text import duration, short
from polhode.harness.pages.regime_text import Maps, lines
from polhode.harness.pages.work_precision import save
from polhode.harness.studies.study import Study

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
# In inches: a cell, what stands left of the map, and the legend below it; lines of a cell, in rows of the map.
CELL, LEFT, LEGEND, LINE = (0.74, 0.43), 0.95, 1.75, 0.36
# The legend needs as much width as so many columns.
LEAST_COLUMNS = 12
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
    maps: Maps = {
        (name, error): cells(where(table, table["scene_name"] == name), error) for name in names for error in ERRORS
    }
    for name in names:
        times = {scene.stokes: scene.time for own, scene in study.scenes if own == name}
        save(picture([maps[name, error] for error in ERRORS], times), folder, name)
    runs = table[[column for column in RUN_COLUMNS if column in table]]
    runs.to_csv(folder / "runs.csv", index=False, float_format="%.7g")
    _write_cells(maps, folder / "cells.csv")
    page = folder / "README.md"
    page.write_text("\n".join(lines(study, table, records, maps, command)), encoding="utf-8")
    return page


def picture(panels: Sequence[Sequence[Cell]], times: Mapping[float, float]) -> Any:
    """Two maps above each other, full solution and slow variables, with one legend.

    Parameters
    ----------
    panels : sequence of two sequences of Cell
    times : mapping
        Duration of the runs by St, in units of the inverse shear rate.
    """
    import matplotlib.pyplot as plt

    columns, rows = (len({getattr(cell, name) for cell in panels[0]}) for name in ("stokes", "target"))
    width = LEFT + CELL[0] * max(columns, LEAST_COLUMNS) + 0.1
    height = 2 * (CELL[1] * rows + 0.4) + 0.9 + LEGEND
    drawing, grid = plt.subplots(2, 1, figsize=(width, height), sharex=True)
    for axes, found, title in zip(grid, panels, ERRORS.values(), strict=True):
        draw(axes, found)
        axes.set_title(title[0].upper() + title[1:], fontsize=13, loc="left")
        axes.set_ylabel("error asked for", fontsize=11)
    _durations(grid[-1], sorted({cell.stokes for cell in panels[0]}), times)
    _legend(drawing, [cell for found in panels for cell in found])
    drawing.subplots_adjust(
        left=LEFT / width,
        right=1 - 0.1 / width,
        top=1 - 0.35 / height,
        bottom=(LEGEND + 0.9) / height,
        hspace=0.4 / (CELL[1] * rows),
    )
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
                corner = [(i + 0.77, j), (i + 1, j), (i + 1, j + 0.9)]
                axes.add_patch(Polygon(corner, facecolor=color_of(cell.second), edgecolor="none"))
            _write_in(axes, cell, i, j, usual)
    _borders(axes, [[_side(at[stokes, target]) for target in targets] for stokes in numbers])
    axes.set_xlim(0, len(numbers))
    axes.set_ylim(len(targets), 0)
    axes.set_xticks([i + 0.5 for i in range(len(numbers))], [_power(stokes) for stokes in numbers], fontsize=11)
    axes.set_yticks([j + 0.5 for j in range(len(targets))], [_power(target) for target in targets], fontsize=11)
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


def _durations(axes: "Axes", numbers: Sequence[float], times: Mapping[float, float]) -> None:
    """Three rows below a map: St, and over what time and slow time its runs go; bold where that is less than usual."""
    slow = [times[stokes] / stokes if stokes else inf for stokes in numbers]
    usual = max(slow, key=slow.count)
    rows = {
        "St": [_power(stokes) for stokes in numbers],
        "$t$": [_brief(times[stokes]) for stokes in numbers],
        "$t_2$": [_brief(value) for value in slow],
    }
    axes.set_xticklabels([])
    for k, (name, texts) in enumerate(rows.items()):
        style = {"fontsize": 9.5 if k else 11, "va": "center", "textcoords": "offset points"}
        below = -12 - 15 * k
        axes.annotate(name, (0, 0), (-10, below), xycoords="axes fraction", ha="right", **style)
        for i, text in enumerate(texts):
            weight = "bold" if k and slow[i] < usual else "normal"
            place = {"xycoords": ("data", "axes fraction"), "ha": "center", "annotation_clip": False}
            axes.annotate(text, (i + 0.5, 0), (0, below), weight=weight, **place, **style)
    note = r"St: Stokes number. $t$: duration of the runs, in shear times. $t_2 = t/\mathrm{St}$: the same in slow time"
    note += ", bold where it is shorter." if min(slow) < usual else "."
    axes.annotate(note, (0, 0), (0, -58), xycoords="axes fraction", textcoords="offset points", fontsize=9.5)


def _write_in(axes: "Axes", cell: Cell, i: int, j: int, usual: str) -> None:
    """Time and lead of the winner, and its form where that is not the usual one."""
    if cell.winner is None:
        axes.text(i + 0.5, j + 0.5, "–" if cell.known else "?", ha="center", va="center", fontsize=9, color="0.55")
        return
    ink = "white" if _luminance(color_of(cell.winner)) < DARK else "black"
    lead = "tie" if cell.tied else "alone" if isnan(cell.lead) else f"×{_factor(cell.lead)}"
    # Three digits at most, so that 999.8 µs reads as 1.0 ms.
    texts = [(duration(float(f"{cell.seconds:.3g}")), 9.5), (lead, 8.5)]
    if cell.winner.side != "averaged" and cell.winner.form != usual:
        texts = [(texts[0][0], 8.5), (lead, 7.5), (cell.winner.form, 7.0)]
    gap = LINE if len(texts) < 3 else 0.3
    for k, (line, size) in enumerate(texts):
        y = j + 0.52 + gap * (k - (len(texts) - 1) / 2)
        axes.text(i + 0.44, y, line, ha="center", va="center", fontsize=size, color=ink)


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
    columns: list[list[Any]] = []
    for side, (heading, what) in HEADINGS.items():
        if shown[side]:
            title = rf"$\bf{{{heading.replace(' ', '~')}}}$"
            own = sorted(shown[side], key=lambda method: [*COLORS, method.label].index(method.label))
            patches = [Patch(facecolor=color_of(method), label=method.label) for method in own]
            columns.append([Patch(facecolor="none", label=f"{title}\n{what}"), *patches])
    columns.append(
        [
            Patch(facecolor=NOBODY, edgecolor="0.7", label="no run measured gets there"),
            Patch(facecolor=UNKNOWN, label="below what the\nreference can tell"),
        ]
    )
    width, height = drawing.get_size_inches()
    top, style = LEGEND / height, {"frameon": False, "fontsize": 9.5, "handlelength": 1.3, "borderaxespad": 0}
    for k, handles in enumerate(columns):
        place = (0.15 / width + k * (1 - 0.2 / width) / len(columns), top)
        drawing.add_artist(drawing.legend(handles=handles, loc="upper left", bbox_to_anchor=place, **style))
    note = (
        f"Numbers: time of a warm run, × its lead over the next colour; alone: no other colour gets there. "
        f"Corner: who ties, within {100 * (TIE - 1):.0f} %.\n"
        f"Full equations in the form {usual_form(found)}, unless a cell names another."
    )
    drawing.text(0.2 / width, 0.1 / height, note, fontsize=9.5, va="bottom")


def _write_cells(maps: Maps, path: Path) -> None:
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


def _brief(value: float) -> str:
    """A number in few characters: 20, 5000, 5e4."""
    return short(value) if value < 1e4 else "∞" if value == inf else f"{value:.3g}".replace("e+0", "e")


def _power(value: float) -> str:
    exponent = log10(value) if 0 < value < inf else nan
    return f"$10^{{{round(exponent)}}}$" if abs(exponent - np.round(exponent)) < 1e-9 else f"{value:g}"


def _luminance(color: str) -> float:
    red, green, blue = (int(color[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue

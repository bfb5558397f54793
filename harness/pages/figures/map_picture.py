"""The regime map as a picture."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from math import inf, isnan
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Polygon, Rectangle

from polhode.harness.analysis.pareto import TIE, Cell, Method, Side, usual_form
from polhode.harness.common.text import duration, factor, short
from polhode.harness.pages.figures.style import colour, power, rank
from polhode.harness.pages.tables import fill

_NOBODY = "#FFFFFF"
_UNKNOWN = "#E4E4E4"
HEADINGS: dict[Side, tuple[str, str]] = {
    "implicit": ("Stiff side", "implicit methods"),
    "explicit": ("Oscillatory middle", "explicit methods"),
    "tailored": ("Made for large St", "full solution at large St"),
    "averaged": ("Averaged side", "slow equations, any solver"),
}
_CELL = (0.74, 0.43)  # Inches: width and height of a cell.
_BESIDE = (0.85, 2.7)  # Inches: width and height of all but cells and legend.
_ENTRY = 0.192  # Inches: height of an entry of the legend.
_LINE = 0.36  # Distance of the lines in a cell, over its height.
# Columns of cells that are as wide as the legend.
_LEAST_COLUMNS = 12
# Errors of the maps: the word for sentences, and the title.
MAP_ERRORS = {
    "orientation_error": ("orientation", "Full solution: orientation error, rad"),
    "slow_error": ("slow variables", "Slow variables: error over $I_{max}$"),
}


def picture(panels: Sequence[Sequence[Cell]], times: Mapping[float, float]) -> Any:
    """Two maps, full solution above slow variables, with one legend; `times` are the runs' durations by St."""
    columns, rows = (
        len({getattr(cell, name) for cell in panels[0]}) for name in ("stokes", "target")
    )
    cells = [*chain.from_iterable(panels)]
    entries = _entries(cells)
    longest = max(map(len, entries))
    width = _BESIDE[0] + _CELL[0] * max(columns, _LEAST_COLUMNS)
    height = _BESIDE[1] + _CELL[1] * rows * 2 + _ENTRY * longest
    drawing, grid = plt.subplots(2, 1, figsize=(width, height), sharex=True, layout="constrained")
    for axes, panel, (_, title) in zip(grid, panels, MAP_ERRORS.values(), strict=True):
        draw(axes, panel)
        axes.set_title(title, fontsize=13, loc="left")
        axes.set_ylabel("error asked for", fontsize=11)
    shorter = _durations(grid[-1], sorted({cell.stokes for cell in panels[0]}), times)
    handles = []
    for column in entries:
        # Empty entries fill the shorter columns of the legend.
        handles += [*column, *[Patch(facecolor="none")] * (longest - len(column))]
    note = fill("regimes-note", shorter=shorter, tie=100 * (TIE - 1), usual=usual_form(cells))
    style = {
        "frameon": False,
        "fontsize": 9.5,
        "handlelength": 1.3,
        "ncols": len(entries),
        "columnspacing": 2.0,
    }
    drawing.legend(
        handles=handles,
        loc="outside lower left",
        title=note,
        title_fontsize=9.5,
        alignment="left",
        **style,
    )
    return drawing


def by_side(methods: Iterable[Method]) -> list[tuple[tuple[str, str], list[str]]]:
    """Labels of methods below the headings of their sides, in the order of `rank`; no side without any."""
    sides = {method.label: method.side for method in methods}
    ranked = sorted(sides, key=rank)
    columns = []
    for side, heading in HEADINGS.items():
        labels = [label for label in ranked if sides[label] == side]
        if labels:
            columns.append((heading, labels))
    return columns


def draw(axes: Axes, panel: Sequence[Cell]) -> Axes:
    """Draw one map: colour names the winner, a corner who ties with it, numbers its time and its lead."""
    numbers = sorted({cell.stokes for cell in panel})
    targets = sorted({cell.target for cell in panel}, reverse=True)
    at = {(cell.stokes, cell.target): cell for cell in panel}
    usual = usual_form(panel)
    for i, stokes in enumerate(numbers):
        for j, target in enumerate(targets):
            cell = at[stokes, target]
            nobody = _NOBODY if cell.known else _UNKNOWN
            color = colour(cell.winner.label) if cell.winner else nobody
            axes.add_patch(
                Rectangle((i, j), 1, 1, facecolor=color, edgecolor="white", linewidth=0.8)
            )
            if cell.tied and cell.second:
                corner = [(i + 0.77, j), (i + 1, j), (i + 1, j + 0.9)]
                axes.add_patch(
                    Polygon(corner, facecolor=colour(cell.second.label), edgecolor="none")
                )
            _write_in(axes, cell, i, j, usual)
    # Heavy lines where one kind of method hands over to another.
    columns = []
    for stokes in numbers:
        winners = [at[stokes, target].winner for target in targets]
        columns.append([winner.side if winner else "" for winner in winners])
    sides = np.array(columns)
    style = {"color": "black", "linewidth": 2.2, "solid_capstyle": "round", "zorder": 3}
    for i, j in np.argwhere(sides[1:] != sides[:-1]):
        axes.plot([i + 1, i + 1], [j, j + 1], **style)
    for i, j in np.argwhere(sides[:, 1:] != sides[:, :-1]):
        axes.plot([i, i + 1], [j + 1, j + 1], **style)
    axes.set(xlim=(0, len(numbers)), ylim=(len(targets), 0))
    axes.set_xticks(
        [i + 0.5 for i in range(len(numbers))], [power(stokes) for stokes in numbers], fontsize=11
    )
    axes.set_yticks(
        [j + 0.5 for j in range(len(targets))], [power(target) for target in targets], fontsize=11
    )
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return axes


def _durations(axes: Axes, numbers: Sequence[float], times: Mapping[float, float]) -> bool:
    """Rows below a map: St, time and slow time of its runs; returns whether some, bold, go over less than usual."""
    slow = [times[stokes] / stokes if stokes else inf for stokes in numbers]
    usual = max(slow, key=slow.count)
    rows = {
        "St": [power(stokes) for stokes in numbers],
        "$t$": [short(times[stokes]) for stokes in numbers],
        "$t_2$": ["∞" if value == inf else short(value) for value in slow],
    }
    axes.set_xticklabels([])
    for k, (name, texts) in enumerate(rows.items()):
        style = {"fontsize": 9.5 if k else 11, "va": "center", "textcoords": "offset points"}
        below = -12 - 15 * k
        axes.annotate(name, (0, 0), (-10, below), xycoords="axes fraction", ha="right", **style)
        for i, text in enumerate(texts):
            weight = "bold" if k and slow[i] < usual else "normal"
            place = {
                "xycoords": ("data", "axes fraction"),
                "ha": "center",
                "annotation_clip": False,
            }
            axes.annotate(text, (i + 0.5, 0), (0, below), weight=weight, **place, **style)
    return min(slow) < usual


def _write_in(axes: Axes, cell: Cell, i: int, j: int, usual: str) -> None:
    """Time and lead of the winner, and its form where that is not the usual one."""
    if cell.winner is None:
        axes.text(
            i + 0.5,
            j + 0.5,
            "–" if cell.known else "?",
            ha="center",
            va="center",
            fontsize=9,
            color="0.55",
        )
        return
    red, green, blue = to_rgb(colour(cell.winner.label))
    # Dark colours carry white numbers.
    ink = "white" if 0.2126 * red + 0.7152 * green + 0.0722 * blue < 0.4 else "black"
    untied = "alone" if isnan(cell.lead) else factor(cell.lead)
    lead = "tie" if cell.tied else untied
    texts = [(duration(cell.seconds), 9.5), (lead, 8.5)]
    if cell.winner.label != cell.winner.form and cell.winner.form != usual:
        texts = [(texts[0][0], 8.5), (lead, 7.5), (cell.winner.form, 7.0)]
    gap = _LINE if len(texts) < 3 else 0.3
    for k, (line, size) in enumerate(texts):
        y = j + 0.52 + gap * (k - (len(texts) - 1) / 2)
        axes.text(i + 0.44, y, line, ha="center", va="center", fontsize=size, color=ink)


def _entries(panel: Sequence[Cell]) -> list[list[Any]]:
    """Entries of the legend by column: a heading and the methods of each side, and what empty cells mean."""
    methods = []
    for cell in panel:
        if cell.winner:
            methods.append(cell.winner)
        if cell.tied and cell.second:
            methods.append(cell.second)
    columns: list[list[Any]] = []
    for (heading, explanation), labels in by_side(methods):
        title = rf"$\bf{{{heading.replace(' ', '~')}}}$"
        patches = [Patch(facecolor=colour(label), label=label) for label in labels]
        columns.append([Patch(facecolor="none", label=f"{title}\n{explanation}"), *patches])
    nobody = Patch(facecolor=_NOBODY, edgecolor="0.7", label="no run measured gets there")
    return [
        *columns,
        [nobody, Patch(facecolor=_UNKNOWN, label="below what the\nreference resolves")],
    ]

"""The regime map as a picture: one panel, with its key on top.

Columns are St, rows requested errors. A cell has the colour and the letters of the cheapest method
there, its winner. A side is a kind of method: implicit, explicit, made for large St, or averaged.
Looks and sizes without a reason are chosen by eye (`style`).
"""

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Polygon, Rectangle

from polhode.harness.analysis.pareto import Method, Side
from polhode.harness.analysis.regime_map import Cell, usual_form
from polhode.harness.common.text import short
from polhode.harness.pages.figures.style import (
    INK,
    LETTERS,
    SMALL_LETTERS,
    TITLE,
    TITLE_LEFT,
    WIDTH,
    caption,
    colour,
    key,
    power,
    rank,
)
from polhode.harness.pages.tables import fill

_NOBODY = "#FFFFFF"  # Cells of errors to which no run gets.
_UNKNOWN = "#E4E4E4"  # Cells of errors that the reference does not resolve.
# By side, from small St to large: its heading in the key, and the line below it.
HEADINGS: dict[Side, tuple[str, str]] = {
    "implicit": ("Stiff side", "implicit methods"),
    "explicit": ("Oscillatory middle", "explicit methods"),
    "tailored": ("Made for large St", "full solution"),
    "averaged": ("Averaged side", "slow equations"),
}
# Errors of the maps: the word for sentences, and the title.
MAP_ERRORS = {
    "orientation_error": ("orientation", "Full solution: orientation error, rad"),
    "slow_error": ("slow variables", "Slow variables: error over $I_{max}$"),
}
# Letters of the winner, which stand in a cell beside the colour. Others have the first two of their name.
CODES = {
    "taylor": "T",
    "cyrk-vern8": "V8",
    "cyrk-vern7": "V7",
    "cyrk-dop853": "D8",
    "cyrk-tsit5": "T5",
    "cyrk-radau": "R",
    "cyrk-bdf": "B",
    "cyrk-lsoda": "L",
    "cvode-bdf": "CB",
    "cvode-adams": "CA",
    "ida": "I",
    "dop853": "D",
    "rk45": "RK",
    "radau": "Ra",
    "bdf": "Bd",
    "lsoda": "Ls",
    "splitting": "S",
    "splitting-extended": "SE",
    "stroboscopic": "St",
    "hybrid": "H",
    "exact": "E",
    "averaged": "A1",
    "averaged-spheroid": "A1",
    "averaged-second-order": "A2",
}
# Inches.
_LEFT = 0.62  # Numbers and label of the error.
_ROW = 0.27  # Height of a cell.
_BELOW = 0.45  # Rows of St and t below the cells.
_TITLE_ROOM = 0.32  # The title above the cells.
_RIGHT = 0.05  # From the cells to the figure's edge.
_LARGEST_COLUMN = 0.8  # Width of a cell, at most.
_KEY_LINE = 0.185  # A line of the key.
_BELOW_KEY = 0.1
# Columns that the key has room for; with fewer, each is as wide.
_KEY_COLUMNS = 4
# The rows of words below a map, in points: from its foot to the first one, and from one to the next.
_FIRST_ROW = 9
_ROW_DISTANCE = 15
# Corners of the mark of a tie in a cell of width and height 1: x from its left side, y from its top.
_TIE_CORNERS = ((0.72, 0.02), (0.98, 0.02), (0.98, 0.6))


def picture(panel: Sequence[Cell], times: Mapping[float, float], title: str, note: str = "") -> Any:
    """A map below its key.

    Parameters
    ----------
    panel
        Cells of one particle and one kind of error.
    times
        Durations of the runs by St, in inverse shear rates.
    title
        Stands above the map.
    note
        What was measured and where.
    """
    columns = len({cell.stokes for cell in panel})
    rows = len({cell.target for cell in panel})
    entries = _entries(panel)
    lines = max(map(len, entries))
    height = _KEY_LINE * lines + _BELOW_KEY + _TITLE_ROOM + _ROW * rows + _BELOW
    drawing = plt.figure(figsize=(WIDTH, height))
    width = min(WIDTH - _LEFT - _RIGHT, _LARGEST_COLUMN * columns)
    box = (_LEFT / WIDTH, _BELOW / height, width / WIDTH, _ROW * rows / height)
    axes = drawing.add_axes(box)
    draw(axes, panel)
    # From the left edge of the cells, over their width.
    title_at = (TITLE_LEFT - _LEFT) / width
    axes.set_title(title, fontsize=TITLE, loc="left", color=INK, x=title_at, pad=7)
    axes.set_ylabel("error allowed", fontsize=LETTERS, color=INK)
    _durations(axes, sorted({cell.stokes for cell in panel}), times)
    for place, handles in enumerate(entries):
        key(
            drawing,
            handles,
            1,
            loc="upper left",
            bbox_to_anchor=(place / max(_KEY_COLUMNS, len(entries)), 1.0),
            fontsize=SMALL_LETTERS,
            # In units of the letters' size.
            handlelength=1.1,
            handletextpad=0.4,
            labelspacing=0.3,
            borderaxespad=0.1,
        )
    words = fill("regimes-note", usual=usual_form(panel))
    caption(drawing, f"{words} {note}".strip())
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
    """Draw one map on axes, which are returned: colour and letters name the winner, a corner who ties with it."""
    # Cell (i, j) is a unit square at x = i, y = j; j grows downwards, with tighter errors.
    numbers = sorted({cell.stokes for cell in panel})
    targets = sorted({cell.target for cell in panel}, reverse=True)
    at = {(cell.stokes, cell.target): cell for cell in panel}
    for i, stokes in enumerate(numbers):
        for j, target in enumerate(targets):
            cell = at[stokes, target]
            nobody = _NOBODY if cell.resolved else _UNKNOWN
            color = colour(cell.winner.label) if cell.winner else nobody
            axes.add_patch(
                Rectangle((i, j), 1, 1, facecolor=color, edgecolor="white", linewidth=0.8)
            )
            if cell.tied and cell.second:
                corner = [(i + x, j + y) for x, y in _TIE_CORNERS]
                tied = Polygon(
                    corner, facecolor=colour(cell.second.label), edgecolor="white", linewidth=0.6
                )
                axes.add_patch(tied)
            _write_in(axes, cell, i, j)
    # Heavy lines where one kind of method hands over to another: `sides[i, j]` is the kind of cell (i, j).
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
    places = [j + 0.5 for j in range(len(targets))]
    axes.set_yticks(places, [power(target) for target in targets], fontsize=LETTERS, color=INK)
    axes.set_xticks([])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return axes


def _durations(axes: Axes, numbers: Sequence[float], times: Mapping[float, float]) -> None:
    """Rows below a map: St, and the time or the slow time that its runs go over.

    A text that neighbouring columns share stands once, in the middle below them.
    """
    # Slow times of the runs; inf at St = 0, where there is none.
    slow = [times[stokes] / stokes if stokes else inf for stokes in numbers]
    usual = max(slow, key=slow.count)
    rows = {"St": [power(stokes) for stokes in numbers]}
    # Runs at large St share a slow time t₂ = t/St: it says more than the time itself. Runs at small St
    # share a time.
    rows["over"] = [
        f"$t_2$={short(value)}"
        if value == usual and slow.count(usual) > 1
        else f"$t$={short(times[stokes])}"
        for stokes, value in zip(numbers, slow, strict=True)
    ]
    for k, (name, texts) in enumerate(rows.items()):
        style = {"fontsize": LETTERS, "va": "center", "textcoords": "offset points", "color": INK}
        below = -_FIRST_ROW - _ROW_DISTANCE * k
        axes.annotate(name, (0, 0), (-8, below), xycoords="axes fraction", ha="right", **style)
        # Each St stands alone; durations are grouped.
        for i, text in enumerate(_grouped(texts) if k else texts):
            place = {
                "xycoords": ("data", "axes fraction"),
                "ha": "center",
                "annotation_clip": False,
            }
            if isinstance(text, tuple):
                text, first, last = text
                axes.annotate(text, ((first + last + 1) / 2, 0), (0, below), **place, **style)
            elif text:
                axes.annotate(text, (i + 0.5, 0), (0, below), **place, **style)


def _grouped(texts: Sequence[str]) -> list[tuple[str, int, int]]:
    """Each run of neighbours with the same text once: the text, and the places of the first and the last one."""
    groups: list[tuple[str, int, int]] = []
    for i, text in enumerate(texts):
        if groups and groups[-1][0] == text:
            groups[-1] = (text, groups[-1][1], i)
        else:
            groups.append((text, i, i))
    return groups


def ink_on(color: str) -> str:
    """Black or white, whichever stands out more on a colour.

    WCAG 2 defines the numbers: the linear values of sRGB, their relative luminance, and the contrast of two
    luminances, (lighter + 0.05)/(darker + 0.05).
    """
    red, green, blue = map(_linear, to_rgb(color))
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    contrast_to_white = (1.0 + 0.05) / (luminance + 0.05)
    contrast_to_black = (luminance + 0.05) / (0.0 + 0.05)
    return "white" if contrast_to_white > contrast_to_black else "black"


def _linear(value: float) -> float:
    """The linear value of a component of sRGB, both from 0 to 1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _write_in(axes: Axes, cell: Cell, i: int, j: int) -> None:
    """Write the letters of the winner into cell (i, j); a dash or a question mark where there is none.

    Letters stand a little to the left of the middle, beside the mark of a tie, and a little below it.
    """
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": LETTERS}
    if cell.winner is None:
        axes.text(i + 0.5, j + 0.52, "–" if cell.resolved else "?", color="0.35", **style)
        return
    label = cell.winner.label
    axes.text(i + 0.42, j + 0.52, CODES.get(label, label[:2]), color=ink_on(colour(label)), **style)


def _entries(panel: Sequence[Cell]) -> list[list[Any]]:
    """Entries of the key by column: a heading and the methods of each side, and what empty cells mean."""
    methods = []
    for cell in panel:
        if cell.winner:
            methods.append(cell.winner)
        if cell.tied and cell.second:
            methods.append(cell.second)
    columns: list[list[Any]] = []
    for (heading, explanation), labels in by_side(methods):
        title = rf"$\bf{{{heading.replace(' ', '~')}}}$"
        patches = [
            Patch(facecolor=colour(label), label=f"{CODES.get(label, label[:2])}  {_short(label)}")
            for label in labels
        ]
        columns.append(
            [
                Patch(facecolor="none", label=title),
                Patch(facecolor="none", label=explanation),
                *patches,
            ]
        )
    empty = [
        Patch(facecolor=_NOBODY, edgecolor="0.5", label="–  no run there"),
        Patch(facecolor=_UNKNOWN, label="?  not known"),
    ]
    # They stand under the shortest column, which leaves room for names.
    shortest = min(columns, key=len, default=None)
    if shortest is None:
        return [empty]
    shortest += empty
    return columns


def _short(label: str) -> str:
    """A name as the key has room for it."""
    if label in ("averaged", "averaged-spheroid"):
        return "first order"
    if "averaged" in label:
        return label.replace("averaged-", "").replace("-", " ")
    return label

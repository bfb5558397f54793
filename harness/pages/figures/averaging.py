"""Errors of averaging over random bodies against St, as bands by kind of body.

`polhode accuracy` runs the study; `polhode.harness.pages.averaging.random_bodies` makes the bands. By
averaging of first order the error falls like 1/St, by averaging of second order like 1/St². Looks and
sizes without a reason are chosen by eye (`style`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, log10, nan
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator

from polhode.harness.pages.figures.style import (
    BAND_OPACITY,
    BLUE,
    INK,
    LETTERS,
    TITLE,
    VERMILLION,
    WIDTH,
    caption,
    key,
    panels,
    slopes,
    square_decades,
)

# Bodies that stay on one side of L² = 2EI₂, and those that cross it. L² = 2EI₂ is the separatrix of
# the free motion: its period is infinite there, so that averaging over it loses accuracy.
_COLOURS = {False: BLUE, True: VERMILLION}
_DASHES = {"first order": "-", "second order": "--"}
_LINE_WIDTH = 1.6  # Points, of the line in the middle of a band.
_EDGE_WIDTH = 0.8  # Points, of a band's edges, which bands that overlap are told apart by.
# Hatch of a band: first order has a tint, on which another tint would hardly show.
_HATCHES = {"first order": "", "second order": "////"}
_HATCH_OPACITY = 0.6  # Lines stand out from their hatch.
_COLUMNS = 3  # Panels in a row, and entries in a line of the key.
# Letters in a line of words in a panel, which the panel's width allows.
_LETTERS_OF_PANEL = 18
# Ends of the axis of St, a little beyond those of the study (`random_study.BODIES`).
_STOKES = (7.0, 1.5e8)
# Ends of the axis of the error: of L and E over I_max, or of the orientation in rad, which is π at most.
_ERRORS = (1e-9, 4.0)
# Factor between the powers of ten that are written on both axes: more would touch.
_TICK_STEP = 100.0
_MAX_TICKS = 20  # More than an axis has: the locator would else leave out some.
# Room in inches.
_LEFT = 0.68  # For the axes' name and numbers.
_RIGHT = 0.12  # For half a number.
_BETWEEN = 0.17  # Between columns.
_TITLE_ROOM = 0.36  # Above each panel.
_KEY_LINE = 0.27  # For a line of the key.
_BOTTOM = 0.46  # For numbers and the axes' name.
# Inches: a decade of St is as long as one of the error.
_PANEL_WIDTH = (WIDTH - _LEFT - _RIGHT - (_COLUMNS - 1) * _BETWEEN) / _COLUMNS
_PANEL_HEIGHT = _PANEL_WIDTH * log10(_ERRORS[1] / _ERRORS[0]) / log10(_STOKES[1] / _STOKES[0])
# St and error at which the dotted lines of slopes begin, and St at which they end: below the bands there.
_SLOPES_FROM = (12.0, 1e-5)
_SLOPES_TO = 400.0


@dataclass(frozen=True)
class Band:
    """Errors at St, by an order of averaging: what 2.5 %, half and 97.5 % of the bodies stay below.

    `order` is "first order" or "second order", `crosses` whether the bodies cross L² = 2EI₂. All sequences have an
    entry for each St, NaN or inf where none is known.
    """

    order: str
    crosses: bool
    stokes: Sequence[float]
    low: Sequence[float]
    middle: Sequence[float]
    high: Sequence[float]


def bands(
    titles: Mapping[str, Sequence[Band]], note: str = "", words: Mapping[str, str] | None = None
) -> Figure:
    """A panel for each title, with its bands: in one colour for bodies that cross L² = 2EI₂, in one for the others.

    `note` stands below. `words` stand in the panels of their titles, which have no bands, and say why.
    """
    entries = _entries(titles)
    figure, grid = _grid(ceil(len(titles) / _COLUMNS), ceil(len(entries) / _COLUMNS))
    for axes, (title, panel) in zip(grid.flat, titles.items(), strict=False):
        for band in panel:
            _draw(axes, band)
        axes.set_title(title, loc="left", fontsize=TITLE, color=INK)
    for title, text in (words or {}).items():
        axes = grid.flat[[*titles].index(title)]
        style = {"ha": "center", "va": "center", "fontsize": LETTERS, "color": INK}
        # The grid would cross the letters.
        style["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
        axes.text(0.5, 0.5, fill(text, _LETTERS_OF_PANEL), transform=axes.transAxes, **style)
    for axes in grid.flat[len(titles) :]:
        axes.set_visible(False)
    for column in grid.T:
        lowest = [axes for axes in column if axes.get_visible()][-1:]
        for axes in lowest:
            axes.set_xlabel("Stokes number")
            axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel("error")
    slopes(grid[0, 0], _SLOPES_FROM, _SLOPES_TO, {-1: "1/St", -2: "1/St²"})
    # All panels share their axes. A line that is drawn later would give them other ticks.
    first = grid[0, 0]
    first.set(xlim=_STOKES, ylim=_ERRORS)
    for axis in (first.xaxis, first.yaxis):
        axis.set_major_locator(LogLocator(_TICK_STEP, numticks=_MAX_TICKS))
    for axes in grid.flat:
        axes.minorticks_off()
        square_decades(axes)
    place = {"loc": "upper left", "handlelength": 2.2, "handleheight": 1.2}
    if entries:
        key(figure, [*entries.values()], _COLUMNS, labels=[*entries], **place)
    caption(figure, note)
    return figure


def _grid(rows: int, key_lines: int) -> tuple[Figure, np.ndarray]:
    """A figure with room for its key, and its panels, each of `_PANEL_WIDTH` and `_PANEL_HEIGHT`."""
    key_room = key_lines * _KEY_LINE
    height = key_room + rows * (_TITLE_ROOM + _PANEL_HEIGHT) + _BOTTOM
    places = {
        "left": _LEFT / WIDTH,
        "right": 1 - _RIGHT / WIDTH,
        "bottom": _BOTTOM / height,
        "top": 1 - (key_room + _TITLE_ROOM) / height,
        "wspace": _BETWEEN / _PANEL_WIDTH,
        "hspace": _TITLE_ROOM / _PANEL_HEIGHT,
    }
    style: dict[str, Any] = {"sharex": True, "sharey": True, "layout": None, "gridspec_kw": places}
    return panels(rows, _COLUMNS, height, **style)


def _draw(axes: Axes, band: Band) -> None:
    """A band with its edges, and the line in its middle."""
    look = {"color": _COLOURS[band.crosses], "linestyle": _DASHES[band.order]}
    axes.fill_between(band.stokes, band.low, band.high, **_area(band.order, band.crosses))
    # The lower edge is known at more St than the upper one: alone it would bound nothing.
    known = np.isfinite(band.high)
    for edge in (band.low, band.high):
        axes.loglog(band.stokes, np.where(known, edge, nan), linewidth=_EDGE_WIDTH, **look)
    axes.loglog(band.stokes, band.middle, linewidth=_LINE_WIDTH, **look)


def _area(order: str, crosses: bool) -> dict[str, Any]:
    """The look of a band: a tint, or a hatch."""
    shade = _COLOURS[crosses]
    if not _HATCHES[order]:
        return {"facecolor": shade, "alpha": BAND_OPACITY, "linewidth": 0}
    # A hatch has the colour of the edge, which has no width here.
    style = {"facecolor": "none", "edgecolor": shade, "alpha": _HATCH_OPACITY, "linewidth": 0}
    return style | {"hatch": _HATCHES[order]}


def _entries(titles: Mapping[str, Sequence[Band]]) -> dict[str, tuple[Patch, Line2D]]:
    """The key's entries by label: a piece of a band with its line, for each order and colour that is drawn."""
    drawn = {
        (band.order, band.crosses)
        for panel in titles.values()
        for band in panel
        if np.isfinite(band.middle).any()
    }
    words = {False: "", True: ", crossing L² = 2EI₂"}
    entries = {}
    for crosses in (False, True):
        for order, dash in _DASHES.items():
            if (order, crosses) in drawn:
                style = {"color": _COLOURS[crosses], "linestyle": dash, "linewidth": _LINE_WIDTH}
                patch = Patch(**_area(order, crosses))
                entries[order + words[crosses]] = (patch, Line2D([], [], **style))
    return entries

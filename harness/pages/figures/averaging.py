"""Errors of averaging over random bodies against St, as bands by kind of body.

`polhode accuracy` runs the study; `polhode.harness.pages.averaging.random_bodies` makes the bands. By
averaging of first order the error falls like 1/St, by averaging of second order like 1/St². Looks and
sizes without a reason are chosen by eye (`style`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator

from polhode.harness.pages.figures.style import (
    BAND_OPACITY,
    BLUE,
    INK,
    TITLE,
    VERMILLION,
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
# Panels in a row: at their width a decade of St is as long as one of the error in `_ROW`.
_COLUMNS = 4
_LINE_WIDTH = 1.6  # Points, of the line in the middle of a band.
# Letters in a line of a panel's title, which the panel's width allows.
_LETTERS_OF_TITLE = 15
# Inches of a row: seven decades of St have 1.17, ten and a half of the error 1.75; the rest is for titles
# and numbers.
_ROW = 2.3
_KEY_AND_LABELS = 0.75  # Inches of the key on top and the label below.
# Factors between the powers of ten that are written on the axes of St and of the error: more would touch.
_STOKES_STEP = 100.0
_ERROR_STEP = 1000.0
_MAX_TICKS = 20  # More than an axis has: the locator would else leave out some.
# Ends of the axis of the error: of L and E over I_max, or of the orientation in rad.
_ERRORS = (1e-10, 3.0)
# St and error at which the dotted lines of slopes begin, and St at which they end: below the bands there.
_SLOPES_FROM = (20.0, 1e-6)
_SLOPES_TO = 1e3


@dataclass(frozen=True)
class Band:
    """Errors at St, by an order of averaging: what 2.5 %, half and 97.5 % of the bodies stay below.

    `order` is "first order" or "second order", `crosses` whether the bodies cross L² = 2EI₂. All sequences have an
    entry for each St, NaN where none is known.
    """

    order: str
    crosses: bool
    stokes: Sequence[float]
    low: Sequence[float]
    middle: Sequence[float]
    high: Sequence[float]


def bands(titles: Mapping[str, Sequence[Band]], note: str = "") -> Figure:
    """A panel for each title, with its bands: in one colour for bodies that cross L² = 2EI₂, in one for the others.

    `note` stands below.
    """
    rows = ceil(len(titles) / _COLUMNS)
    style: dict[str, Any] = {"sharex": True, "sharey": True, "layout": "compressed"}
    figure, grid = panels(rows, _COLUMNS, _KEY_AND_LABELS + _ROW * rows, **style)
    for axes, (title, panel) in zip(grid.flat, titles.items(), strict=False):
        for band in panel:
            shade = _COLOURS[band.crosses]
            area = {"color": shade, "alpha": BAND_OPACITY, "linewidth": 0}
            axes.fill_between(band.stokes, band.low, band.high, **area)
            style = {"color": shade, "linestyle": _DASHES.get(band.order, "--")}
            axes.loglog(band.stokes, band.middle, linewidth=_LINE_WIDTH, **style)
        words = "\n".join(wrap(title, _LETTERS_OF_TITLE))
        axes.set_title(words, loc="left", fontsize=TITLE, color=INK)
        axes.xaxis.set_major_locator(LogLocator(_STOKES_STEP, numticks=_MAX_TICKS))
        axes.yaxis.set_major_locator(LogLocator(_ERROR_STEP, numticks=_MAX_TICKS))
        axes.minorticks_off()
        square_decades(axes)
    for axes in grid.flat[len(titles) :]:
        axes.set_visible(False)
    for column in grid.T:
        lowest = [axes for axes in column if axes.get_visible()][-1:]
        for axes in lowest:
            axes.set_xlabel("Stokes number")
            axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel("error")
    grid[0, 0].set_ylim(*_ERRORS)
    slopes(grid[0, 0], _SLOPES_FROM, _SLOPES_TO, {-1: "1/St", -2: "1/St²"})
    key(figure, _handles(titles), 2)
    caption(figure, note)
    return figure


def _handles(titles: Mapping[str, Sequence[Band]]) -> list[Line2D | Patch]:
    """Entries of the key: what lines, dashes, colours and bands mean, as far as there are any."""
    drawn = [band for panel in titles.values() for band in panel if np.isfinite(band.middle).any()]
    words = {False: "", True: ", crosses L² = 2EI₂"}
    handles: list[Line2D | Patch] = []
    for crosses in (False, True):
        for order, dash in _DASHES.items():
            if any((band.order, band.crosses) == (order, crosses) for band in drawn):
                label = f"{order}{words[crosses]}, half"
                style = {"color": _COLOURS[crosses], "linestyle": dash, "linewidth": _LINE_WIDTH}
                handles.append(Line2D([], [], label=label, **style))
    label = "2.5 to 97.5 % of the bodies"
    handles.append(Patch(facecolor=_COLOURS[False], alpha=BAND_OPACITY, label=label))
    return handles
